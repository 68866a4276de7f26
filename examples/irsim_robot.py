"""A robot of IR-SIM (PyPI `ir-sim`): what stands between its steps and `sense` and `drive`."""

from pathlib import Path

import irsim
import numpy as np
import yaml

import chainslam

WORLD = Path(__file__).with_name("irsim_room.yaml")
FLOOR = 1e-6
"""Standard deviation, m and rad, of the odometry of a robot that does not move."""


class IrSimRobot:
    """The first robot of a world: differential drive, a `lidar2d`, noise as its YAML says."""

    def __init__(self, world: Path = WORLD, seed: int = 0) -> None:
        """Read the world file once for IR-SIM and once for what the robot states of itself."""
        self._env = irsim.make(str(world), display=False, save_ani=False, log_level="ERROR", seed=seed)
        said = yaml.safe_load(world.read_text())["robot"][0]
        lidar, wheels = said["sensors"][0], said["kinematics"]
        self._sigma_m = float(lidar["std"]) if lidar.get("noise") else 0.001
        self._alpha = np.array(wheels.get("alpha", [0.03, 0, 0, 0.03]) if wheels.get("noise") else np.zeros(4))
        self._fastest = np.array(said["vel_max"], dtype=float)
        x, y, heading = (float(each) for each in lidar.get("offset", [0.0, 0.0, 0.0]))
        scanner = chainslam.ScannerSpec(x, y, heading)
        self.spec = chainslam.RobotSpec(radius_m=float(said["shape"]["radius"]), scanner=scanner)
        self.collided = False

    @property
    def true_pose(self) -> np.ndarray:
        """Where the robot really is, x m, y m, heading rad: to look at, never to plan by."""
        return self._env.get_robot_state()[:3, 0].copy()

    def sense(self) -> chainslam.Scan:
        """Return the scan: IR-SIM says `range_max` where nothing came back, and its last beam repeats the first."""
        said = self._env.get_lidar_scan()
        bearings = said["angle_min"] + said["angle_increment"] * np.arange(len(said["ranges"]))
        ranges = np.where(said["valid"], said["ranges"], np.inf)
        ranges[said["ranges"] <= said["range_min"]] = np.nan
        return chainslam.Scan.ordered(bearings, ranges, self._sigma_m, float(said["range_max"]), float(self._env.time))

    def drive(self, command: chainslam.MotionCommand) -> chainslam.Odometry:
        """Drive an arc at constant speeds for as many steps as it takes, and report what the wheels were told."""
        dt, asked = self._env.step_time, np.array([command.forward_m, command.turn_rad])
        steps = max(int(np.ceil(np.max(np.abs(asked) / (0.5 * self._fastest * dt)))), 1)
        speed = asked / (steps * dt)
        # IR-SIM scatters both speeds anew in each step, by these standard deviations.
        sigmas = np.sqrt(self._alpha.reshape(2, 2) @ speed**2) * dt
        motion, cov = np.zeros(3), FLOOR**2 * np.eye(3)
        for _ in range(steps):
            self._env.step(speed[:, None])
            c, s = np.cos(motion[2]), np.sin(motion[2])
            F, G = np.eye(3), np.array([[c, 0.0], [s, 0.0], [0.0, 1.0]])
            F[:2, 2] = speed[0] * dt * np.array([-s, c])
            cov = F @ cov @ F.T + G @ np.diag(sigmas**2) @ G.T
            motion = motion + G @ speed * dt
        self.collided |= bool(self._env.robot.collision)
        return chainslam.Odometry(motion, cov, touched=bool(self._env.robot.collision))


if __name__ == "__main__":
    robot = IrSimRobot()
    run = chainslam.explore(robot, robot=robot.spec)
    print(f"{run.summary['status']}: {len(run.map)} walls after {run.summary['steps']} steps")
