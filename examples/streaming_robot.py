"""A robot that streams: its scanner turns on while it drives, and it drives on until it is told to stop.

Four methods instead of two; `chainslam.SteppedRobot` makes the rest. Here a simulation stands for the drivers.
"""

import numpy as np
from own_robot import ROOM

import chainslam

BEAMS, TURN_S = 360, 0.1
SIDES = np.roll(ROOM, -1, axis=0) - ROOM


class StreamingDisc:
    """A disc whose scanner takes 0.1 s for a turn of 360 beams, clockwise; its wheels slip by one per cent."""

    def __init__(self, seed: int = 0) -> None:
        self.rng, self.twist = np.random.default_rng(seed), chainslam.Twist(0.0, 0.0)
        self.times, self.true, self.told = [0.0], [np.array([1.0, 1.0, 0.0])], [np.zeros(3)]

    def scan(self) -> chainslam.TimedScan:
        """Let one turn of the scanner go by; a driver would wait for the next message instead."""
        bearings, start = np.linspace(np.pi, -np.pi, BEAMS, endpoint=False), self.times[-1]
        ranges = np.array([self._beam(bearing) for bearing in bearings]) + 0.01 * self.rng.standard_normal(BEAMS)
        return chainslam.TimedScan(bearings, ranges, 0.01, 8.0, start, self.times[-1])

    def odometry(self, from_s: float, to_s: float) -> chainslam.Odometry:
        """Return what the wheels say of the motion between two times, between whose samples it is even."""
        told = np.array(self.told)
        before, after = (np.array([np.interp(t, self.times, column) for column in told.T]) for t in (from_s, to_s))
        x, y, turn = after - before
        c, s = np.cos(before[2]), np.sin(before[2])
        way = np.hypot(x, y)
        sigmas = np.array([0.02 * way + 0.001, 0.005 * way + 0.001, 0.02 * abs(turn) + 0.01 * way + 0.001])
        return chainslam.Odometry(np.array([c * x + s * y, c * y - s * x, turn]), np.diag(sigmas**2))

    def send(self, twist: chainslam.Twist) -> None:
        """Drive like this from now on."""
        self.twist = twist

    def stop(self) -> None:
        """Stand still."""
        self.twist = chainslam.Twist(0.0, 0.0)

    def _beam(self, bearing: float) -> float:
        """Move on by the time of one beam, and return its range."""
        seconds = TURN_S / BEAMS
        said = np.array([self.twist.speed_m_s, self.twist.turn_rad_s]) * seconds
        slip = 1.0 + 0.01 * self.rng.standard_normal()
        for poses, (forward, turn) in ((self.told, said), (self.true, slip * said)):
            x, y, heading = poses[-1]
            poses.append(np.array([x + forward * np.cos(heading), y + forward * np.sin(heading), heading + turn]))
        self.times.append(self.times[-1] + seconds)
        x, y, heading = self.true[-1]
        u, a, ab = np.array([np.cos(heading + bearing), np.sin(heading + bearing)]), ROOM - (x, y), SIDES
        cross = u[0] * ab[:, 1] - u[1] * ab[:, 0] + 1e-15
        along, share = (a[:, 0] * ab[:, 1] - a[:, 1] * ab[:, 0]) / cross, (a[:, 0] * u[1] - a[:, 1] * u[0]) / cross
        return float(np.where((along > 0) & (share >= 0) & (share <= 1), along, np.inf).min())


if __name__ == "__main__":
    robot = chainslam.SteppedRobot(StreamingDisc())
    run = chainslam.explore(robot, robot=chainslam.RobotSpec(radius_m=0.2), max_steps=400)
    print(f"{run.summary['status']}: {len(run.map)} walls after {run.summary['steps']} steps")
