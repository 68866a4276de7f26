"""A robot of one's own: two methods. This one is a simulation in twenty lines; yours may be made of metal."""

import numpy as np

import chainslam

ROOM = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 3.5], [3.0, 3.5], [3.0, 2.0], [0.0, 2.0]])
BEARINGS = np.linspace(-np.pi, np.pi, 360, endpoint=False)


class MyRobot:
    """A disc with a scanner of 360 beams in a room with a bend, and wheels that slip by two per cent."""

    def __init__(self, seed: int = 0) -> None:
        self.pose, self.time_s, self.rng = np.array([1.0, 1.0, 0.0]), 0.0, np.random.default_rng(seed)

    def sense(self) -> chainslam.Scan:
        """Return the ranges of all beams, and how far they may be off."""
        beam = np.stack([np.cos(BEARINGS + self.pose[2]), np.sin(BEARINGS + self.pose[2])], axis=-1)[:, None]
        a, ab = ROOM - self.pose[:2], np.roll(ROOM, -1, axis=0) - ROOM
        cross = beam[..., 0] * ab[:, 1] - beam[..., 1] * ab[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (a[:, 0] * ab[:, 1] - a[:, 1] * ab[:, 0]) / cross
            share = (a[:, 0] * beam[..., 1] - a[:, 1] * beam[..., 0]) / cross
        ranges = np.where((along > 0) & (share >= 0) & (share <= 1), along, np.inf).min(axis=1)
        return chainslam.Scan(BEARINGS, ranges + 0.01 * self.rng.standard_normal(360), 0.01, 8.0, self.time_s)

    def drive(self, command: chainslam.MotionCommand) -> chainslam.Odometry:
        """Drive an arc, and return what the wheels say of it with its covariance."""
        said = np.array([command.forward_m, 0.0, command.turn_rad])
        sigmas = 0.02 * np.abs(said) + [0.001, 0.001, 0.002]
        x, _, turn = said + sigmas * self.rng.standard_normal(3)
        middle = self.pose[2] + 0.5 * turn
        self.pose = self.pose + np.array([x * np.cos(middle), x * np.sin(middle), turn])
        self.time_s += 0.5
        half = 0.5 * said[2]
        motion = np.array([said[0] * np.cos(half), said[0] * np.sin(half), said[2]])
        return chainslam.Odometry(motion, np.diag(sigmas**2))


if __name__ == "__main__":
    run = chainslam.explore(MyRobot(), robot=chainslam.RobotSpec(radius_m=0.2), max_steps=400)
    print(f"{run.summary['status']}: {len(run.map)} walls after {run.summary['steps']} steps")
