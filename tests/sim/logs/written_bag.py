"""Bags of all kinds, written message by message with the library that reads them."""

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from chainslam.slam.geometry.poses import compose
from tests.slam.streaming_base import ranges_from

BEAMS = 5
STORES = {"ros1": get_typestore(Stores.ROS1_NOETIC), "ros2": get_typestore(Stores.ROS2_HUMBLE)}
TF_FIELDS = "geometry_msgs/TransformStamped[] transforms"
STORES["ros1"].register(get_types_from_msg(TF_FIELDS, "tf2_msgs/msg/TFMessage"))
LASER, ODOMETRY, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"


class Bag:
    """Writes messages of one kind of bag."""

    def __init__(self, path, kind):
        self.is1 = kind == "ros1"
        self.store = STORES["ros1" if self.is1 else "ros2"]
        if self.is1:
            self.writer = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer2(path, version=9, storage_plugin=plugin)
        self.connections = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *error):
        self.writer.close()

    def type(self, name, **fields):
        return self.store.types[name](**fields)

    def header(self, time_s, frame):
        stamp = self.type("builtin_interfaces/msg/Time", sec=int(time_s), nanosec=round((time_s % 1) * 1e9))
        more = {"seq": 0} if self.is1 else {}
        return self.type("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **more)

    def write(self, topic, kind, message, time_s):
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_ros1 if self.is1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], round(time_s * 1e9), serialize(message, kind))

    def scan(self, time_s, ranges=(1.0,) * BEAMS, low=-0.4, step=0.2, topic="/scan", most=8.0, beam_s=0.0, late_s=0.0):
        message = self.type(
            LASER, header=self.header(time_s, "laser"), angle_min=low, angle_max=low + step * (len(ranges) - 1),
            angle_increment=step, time_increment=beam_s, scan_time=0.1, range_min=0.1, range_max=most,
            ranges=np.array(ranges, dtype=np.float32), intensities=np.zeros(0, dtype=np.float32),
        )  # fmt: skip
        self.write(topic, LASER, message, time_s + late_s)

    def quaternion(self, heading, over=False):
        if over:  # half a turn about the ahead axis, then the heading
            return self.type("geometry_msgs/msg/Quaternion", x=np.cos(heading / 2), y=np.sin(heading / 2), z=0.0, w=0.0)
        return self.type("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(heading / 2), w=np.cos(heading / 2))

    def odometry(self, time_s, pose, topic="/odom"):
        at = self.type("geometry_msgs/msg/Point", x=pose[0], y=pose[1], z=0.0)
        pose = self.type("geometry_msgs/msg/Pose", position=at, orientation=self.quaternion(pose[2]))
        none = self.type("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        message = self.type(
            ODOMETRY, header=self.header(time_s, "odom"), child_frame_id="base",
            pose=self.type("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=self.type(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=self.type("geometry_msgs/msg/Twist", linear=none, angular=none), covariance=np.zeros(36),
            ),
        )  # fmt: skip
        self.write(topic, ODOMETRY, message, time_s)

    def transform(self, time_s, parent, child, pose, over=False, topic="/tf"):
        at = self.type("geometry_msgs/msg/Vector3", x=pose[0], y=pose[1], z=0.3)
        turn = self.type("geometry_msgs/msg/Transform", translation=at, rotation=self.quaternion(pose[2], over))
        stamped = self.type(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(time_s, parent), child_frame_id=child, transform=turn,
        )  # fmt: skip
        self.write(topic, TF, self.type(TF, transforms=[stamped]), time_s)


PLACE = np.array([0.1, -0.05, 0.4])
LAST_S = 3.0


def pose_at(time_s):
    """Return where the robot is: it drives an arc at 0.35 m/s and 0.5 rad/s."""
    turn = 0.5 * time_s
    return np.array([1.3 + 0.7 * np.sin(turn), 0.7 + 0.7 * (1.0 - np.cos(turn)), turn])


def room_bag(
    path, kind="mcap", count=lambda k: 180, beam_s=0.0, late_s=0.0, place=PLACE, odometry=True, mounting="first",
    clockwise=False, noise_m=0.0, depth=False,
):  # fmt: skip
    """Write a scan each 0.1 s and odometry each 0.02 s, as they would be recorded."""
    rng, events = np.random.default_rng(1), []
    for k in range(int(LAST_S / 0.1)):
        time_s, beams = 1.0 + 0.1 * k, count(k)
        step = (-1.0 if clockwise else 1.0) * 2.0 * np.pi / beams
        low = np.pi if clockwise else -np.pi
        times = time_s + beam_s * np.arange(beams)
        poses = np.array([compose(pose_at(t - 1.0), place) for t in times])
        ranges = ranges_from(poses, low + step * np.arange(beams)) + noise_m * rng.standard_normal(beams)
        scan = {"ranges": ranges, "low": low, "step": step, "beam_s": beam_s, "late_s": late_s}
        events.append((time_s + late_s, "scan", (time_s,), scan))
        if depth:
            events.append((time_s, "scan", (time_s, ranges[80:100], -0.3, step), {"topic": "/depth"}))
    events += [(t, "odometry", (t, pose_at(t - 1.0)), {}) for t in np.arange(0.99, 1.3 + LAST_S, 0.02) if odometry]
    mounted = {"first": [(0.5, "transform", (0.5, "base", "laser", place), {"topic": "/tf_static"})]}
    mounted["late"] = [(3.0, *mounted["first"][0][1:])]
    events += mounted.get(mounting, [])
    with Bag(path, kind) as bag:
        for _, what, values, options in sorted(events, key=lambda event: event[0]):
            getattr(bag, what)(*values, **options)
    return path
