"""A robot of MuJoCo (PyPI `mujoco`): two driven wheels that touch the floor, a castor, and a ring of rangefinders."""

from pathlib import Path

import mujoco
import numpy as np

import chainslam

BEAMS, RANGE_M, SIGMA_M = 360, 6.0, 0.01
WHEEL_M, SPEED_M_S = 0.06, 0.3
SPEC = chainslam.RobotSpec(
    radius_m=0.2, step_m=0.12, wheels=chainslam.WheelSpec(base_m=0.3, slip=0.02, lateral_slip=0.006)
)
WORLD = Path(__file__).with_name("mujoco_room.xml")
BEARINGS = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)


class MujocoRobot:
    """Encoders tell how far each wheel turned; how far it slipped over the floor nobody tells."""

    def __init__(self, seed: int = 0) -> None:
        """Let the robot settle on its wheels."""
        self._model = mujoco.MjModel.from_xml_path(str(WORLD))
        self._data, self._noise = mujoco.MjData(self._model), np.random.default_rng(seed)
        self._run(0.5, np.zeros(2))
        self.spec = SPEC

    @property
    def true_pose(self) -> np.ndarray:
        """Where the robot really is, x m, y m, heading rad: to look at, never to plan by."""
        (x, y, _, w, i, j, k) = self._data.qpos[:7]
        return np.array([x, y, np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))])

    def sense(self) -> chainslam.Scan:
        """Return what the rangefinders say, with noise: -1 where they meet nothing."""
        mujoco.mj_forward(self._model, self._data)
        ranges = np.where(self._data.sensordata < 0, np.inf, self._data.sensordata)
        ranges = ranges + SIGMA_M * self._noise.standard_normal(BEAMS)
        return chainslam.Scan(
            BEARINGS, np.where(ranges < RANGE_M, ranges, np.inf), SIGMA_M, RANGE_M, float(self._data.time)
        )

    def drive(self, command: chainslam.MotionCommand) -> chainslam.Odometry:
        """Turn both wheels for as long as the arc takes, let them come to rest, and report what the encoders say."""
        half = 0.5 * self.spec.wheels.base_m * command.turn_rad
        ways, before = np.array([command.forward_m - half, command.forward_m + half]), self._data.qpos[7:9].copy()
        seconds = max(np.abs(ways).max() / SPEED_M_S, 0.05)
        self._run(seconds, ways / seconds / WHEEL_M)
        self._run(0.2, np.zeros(2))
        left, right = WHEEL_M * (self._data.qpos[7:9] - before)
        forward, turn = 0.5 * (left + right), (right - left) / self.spec.wheels.base_m
        chord = forward * np.sinc(0.5 * turn / np.pi)
        motion = np.array([chord * np.cos(0.5 * turn), chord * np.sin(0.5 * turn), turn])
        wheels, way = self.spec.wheels, 0.5 * (abs(left) + abs(right)) + 1e-4
        along, across = wheels.slip**2 * way / 2, wheels.lateral_slip**2 * way
        heading = 2 * wheels.slip**2 * way / wheels.base_m**2
        G = np.array([1.0, 0.5 * forward, 1.0])
        cov = np.diag([along, across, 0.0]) + heading * np.outer([0, G[1], G[2]], [0, G[1], G[2]])
        return chainslam.Odometry(motion, cov)

    def _run(self, seconds: float, speeds_rad_s: np.ndarray) -> None:
        self._data.ctrl[:] = speeds_rad_s
        mujoco.mj_step(self._model, self._data, nstep=round(seconds / self._model.opt.timestep))


if __name__ == "__main__":
    robot = MujocoRobot()
    run = chainslam.explore(robot, robot=robot.spec)
    print(f"{run.summary['status']}: {len(run.map)} walls after {run.summary['steps']} steps")
