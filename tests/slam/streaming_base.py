"""A streaming robot by a clock of its own, with whatever a scanner, a motor and an encoder do wrong."""

import math
import threading
from bisect import bisect_right
from collections import deque

import numpy as np

from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import Odometry
from chainslam.slam.robot.streaming import TimedScan, Twist

ROOM = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 3.5], [3.0, 3.5], [3.0, 2.0], [0.0, 2.0]])
COV = np.diag([0.004, 0.004, 0.006]) ** 2
TICK_S = 0.005
REST = Twist(0.0, 0.0)


def ranges_from(poses, bearings):
    """Return the range of each beam, each from a pose of its own, by crossing every ray with every wall."""
    heading = bearings + poses[:, 2]
    beam = np.stack([np.cos(heading), np.sin(heading)], axis=-1)[:, None]
    a, ab = ROOM[None] - poses[:, None, :2], np.roll(ROOM, -1, axis=0) - ROOM
    cross = beam[..., 0] * ab[:, 1] - beam[..., 1] * ab[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (a[..., 0] * ab[:, 1] - a[..., 1] * ab[:, 0]) / cross
        share = (a[..., 0] * beam[..., 1] - a[..., 1] * beam[..., 0]) / cross
    return np.where((along > 0) & (share >= 0) & (share <= 1), along, np.inf).min(axis=1)


class StreamingBase:
    """All times in seconds, by its clock, which goes on only while somebody waits for it."""

    def __init__(
        self,
        hz=10.0, degrees=360.0, beams=90, turns=False, scan_late_s=0.0, every=1,
        odom_hz=50.0, odom_late_s=0.0, waits=False, holds=False,
        timeout_s=np.inf, obeys_late_s=0.0, inertia_s=0.0, gain=1.0, least_m_s=0.0, coasts_s=0.0, creeps_m_s=0.0,
        encoders=2, dies_s=np.inf, stuck_s=np.inf, silent_s=np.inf, silence="blocks", odometry_silent_s=np.inf,
        bumps_s=np.inf, seed=0,
    ):  # fmt: skip
        self.__dict__ |= {k: v for k, v in locals().items() if k != "self"}
        self.now_s, self.next_scan_s = 0.0, 1.0 / hz
        self.pose, self.told = np.array([1.5, 1.0, 0.0]), np.zeros(3)
        self.track, self.samples = [(0.0, self.pose)], [(0.0, self.told)]
        self.orders, self.twist, self.heard_s, self.moves = deque(), REST, 0.0, np.zeros(2)
        self.coasting_s, self.sends, self.stops = 0.0, 0, 0
        self.rng = np.random.default_rng(seed)
        self.bearings = np.deg2rad(degrees) * ((np.arange(beams) + 0.5) / beams - 0.5)
        self.last = None

    def clock(self):
        return self.now_s

    def scan(self):
        while True:
            at_s = self.next_scan_s
            self._wait_until(at_s + self.scan_late_s)
            steps = self.every if self.every == 1 else int(self.rng.integers(1, self.every + 1))
            self.next_scan_s += steps / self.hz
            if at_s < self.silent_s or self.last is None:
                break
            if self.silence == "none":
                return None
            if self.silence == "same":
                return self.last
            if self.silence == "raises":
                raise TimeoutError("no scan within 1 s")
            threading.Event().wait()
        start_s = at_s - 1.0 / self.hz if self.turns else at_s
        a, b = self.true_at(start_s), self.true_at(at_s)
        poses = a + np.linspace(0.0, 1.0, len(self.bearings))[:, None] * (b - a)
        ranges = ranges_from(poses, self.bearings)
        self.last = TimedScan(self.bearings, np.where(ranges < 8.0, ranges, np.inf), 0.01, 8.0, start_s, at_s)
        return self.last

    def odometry(self, from_s, to_s):
        if to_s >= self.odometry_silent_s:
            threading.Event().wait()
        while self.waits and self.now_s < to_s + self.odom_late_s + 1.0 / self.odom_hz:
            self._tick()
        return Odometry(compose(inverse(self._told_at(from_s)), self._told_at(to_s)), COV)

    def send(self, twist):
        self.sends += 1
        self.orders.append((self.now_s + self.obeys_late_s, twist))

    def stop(self):
        self.stops += 1
        self.orders.append((self.now_s + self.obeys_late_s, REST))

    def true_at(self, time_s):
        return at(time_s, self.track)

    def moved(self, since=0.0):
        """Return how far it truly went since a time, and turned."""
        motion = compose(inverse(self.true_at(since)), self.pose)
        return float(np.hypot(*motion[:2]) * (1.0 if motion[0] >= 0.0 else -1.0)), float(motion[2])

    def go_on(self, seconds):
        """Let time pass in which nobody listens."""
        self._wait_until(self.now_s + seconds)
        while self.next_scan_s <= self.now_s:
            self.next_scan_s += 1.0 / self.hz

    def _told_at(self, time_s):
        """Return the pose by the encoders; before and after what is known, the nearest."""
        known = max(bisect_right(self.samples, self.now_s - self.odom_late_s, key=lambda s: s[0]), 1)
        if self.holds:
            return self.samples[max(bisect_right(self.samples, time_s, hi=known, key=lambda s: s[0]), 1) - 1][1]
        return at(time_s, self.samples, known)

    def _wait_until(self, time_s):
        while self.now_s < time_s - 1e-9:
            self._tick()

    def _tick(self):
        while self.orders and self.orders[0][0] <= self.now_s:
            before, (self.heard_s, self.twist) = self.twist, self.orders.popleft()
            if self.twist == REST and before != REST:
                self.coasting_s, self._coast = self.now_s + self.coasts_s, self.moves
        wanted = np.array([self.twist.speed_m_s, self.twist.turn_rad_s]) * self.gain
        if self.now_s - self.heard_s > self.timeout_s or np.abs(wanted).max() < self.least_m_s:
            wanted = np.zeros(2)
        if self.twist == REST and self.now_s < self.coasting_s:
            wanted = self._coast
        share = min(TICK_S / self.inertia_s, 1.0) if self.inertia_s else 1.0
        self.moves = self.moves + share * (wanted - self.moves)
        true = np.zeros(2) if self.now_s >= self.stuck_s else self.moves + np.array([self.creeps_m_s, 0.0])
        forward, turn = true * TICK_S
        if self.bumps_s <= self.now_s < self.bumps_s + TICK_S:
            turn += np.deg2rad(40.0)
        self.now_s += TICK_S
        self.pose = moved_on(self.pose, forward, turn)
        self.track.append((self.now_s, self.pose))
        self.told = moved_on(self.told, *self._counted(forward, turn))
        if self.now_s - self.samples[-1][0] >= 1.0 / self.odom_hz - 1e-9:
            self.samples.append((self.now_s, self.told))

    def _counted(self, forward, turn, base_m=0.4):
        """Return what the encoders say of a motion, of which one or both may have died."""
        if self.now_s < self.dies_s:
            return forward, turn
        left, right = forward - 0.5 * base_m * turn, forward + 0.5 * base_m * turn
        left, right = (0.0, right) if self.encoders == 1 else (0.0, 0.0)
        return 0.5 * (left + right), (right - left) / base_m


def moved_on(pose, forward, turn):
    """Return a pose after a short arc."""
    x, y, heading = pose
    ahead = heading + turn / 2
    return np.array([x + forward * math.cos(ahead), y + forward * math.sin(ahead), heading + turn])


def at(time_s, track, known=None):
    """Return the pose at a time, the motion being even between two."""
    last = (len(track) if known is None else known) - 1
    k = max(min(bisect_right(track, time_s, key=lambda s: s[0]), last), 1) - 1
    (t0, a), (t1, b) = track[k], track[min(k + 1, last)]
    share = float(np.clip((time_s - t0) / (t1 - t0), 0.0, 1.0)) if t1 > t0 else 1.0
    return compose(a, compose(inverse(a), b) * share)
