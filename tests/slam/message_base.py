"""A base that streams messages, as ROS would bring them: scans at 10 Hz, odometry at 50 Hz, tf once."""

from types import SimpleNamespace as Message

import numpy as np

from chainslam.slam.geometry.poses import compose
from tests.slam.streaming_base import StreamingBase, ranges_from

BEAMS = 180


def stamp(time_s):
    return Message(sec=int(time_s), nanosec=round((time_s % 1.0) * 1e9))


def quaternion(heading, over=False):
    if over:
        return Message(x=np.cos(heading / 2), y=np.sin(heading / 2), z=0.0, w=0.0)
    return Message(x=0.0, y=0.0, z=np.sin(heading / 2), w=np.cos(heading / 2))


def laser_scan(time_s, ranges, low=-np.pi, step=2.0 * np.pi / BEAMS, **fields):
    plain = {"time_increment": 0.0, "scan_time": 0.1, "range_min": 0.1, "range_max": 8.0}
    header = Message(stamp=stamp(time_s), frame_id=fields.pop("frame", "laser"))
    return Message(header=header, angle_min=low, angle_increment=step, ranges=ranges, **(plain | fields))


def odometry(time_s, pose):
    at = Message(position=Message(x=pose[0], y=pose[1], z=0.0), orientation=quaternion(pose[2]))
    return Message(header=Message(stamp=stamp(time_s), frame_id="odom"), child_frame_id="base_link",
                   pose=Message(pose=at, covariance=np.zeros(36)))  # fmt: skip


def transforms(parent, child, pose, over=False, time_s=0.0):
    turn = Message(translation=Message(x=pose[0], y=pose[1], z=0.2), rotation=quaternion(pose[2], over))
    header = Message(stamp=stamp(time_s), frame_id=parent)
    return Message(transforms=[Message(header=header, child_frame_id=child, transform=turn)])


class MessageBase:
    """Sends messages to a robot while its time goes on."""

    def __init__(self, place=(0.1, 0.0, 0.3), over=False, noise_m=0.01, encoders=False, **about):
        self.base, self.place, self.over = StreamingBase(**about), np.array(place), over
        self.robot, self.noise_m, self.encoders = None, noise_m, encoders
        self.rng, self.ways, self.next_s = np.random.default_rng(4), np.zeros(2), {"scan": 0.1, "odometry": 0.0}

    def hear(self, robot):
        self.robot = robot
        robot.on_tf(transforms("base_link", "laser", self.place, self.over))

    def twist(self, twist):
        self.base.send(twist)

    def go_on(self, seconds):
        """Let time pass, and send what falls due in it."""
        until = self.base.now_s + seconds
        while self.base.now_s < until - 1e-9:
            told = self.base.told.copy()
            self.base._tick()
            motion = self.base.told - told
            forward = np.hypot(*motion[:2]) * np.sign(motion[0] * np.cos(told[2]) + motion[1] * np.sin(told[2]))
            self.ways += forward + np.array([-0.2, 0.2]) * motion[2]
            self._send_what_is_due()

    def _send_what_is_due(self):
        now_s = self.base.now_s
        if now_s >= self.next_s["odometry"] - 1e-9:
            self.next_s["odometry"] += 0.02
            if self.encoders:
                self.robot.on_wheels(now_s, *self.ways.tolist())
            else:
                self.robot.on_odometry(odometry(now_s, self.base.told))
        if now_s >= self.next_s["scan"] - 1e-9:
            self.next_s["scan"] += 0.1
            pose, step = compose(self.base.pose, self.place), 2.0 * np.pi / BEAMS
            bearings = -np.pi + step * np.arange(BEAMS)
            ranges = ranges_from(np.tile(pose, (BEAMS, 1)), -bearings if self.over else bearings)
            self.robot.on_scan(laser_scan(now_s, ranges + self.noise_m * self.rng.standard_normal(BEAMS)))

    def in_its_time(self, robot):
        """Let waiting make its time go on: as fast as the machine is, and the same each time."""

        def wait_for(has_come, wait_s):
            until = self.base.now_s + wait_s
            while not (found := has_come()) and self.base.now_s < until:
                self.go_on(0.005)
            return found

        robot._arrived.wait_for = wait_for
