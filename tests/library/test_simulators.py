"""Robots of other simulators, each an adaptor of fewer than a hundred lines: they explore, and know where they are."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import chainslam
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.geometry.poses import compose, inverse, to_world, wrap
from chainslam.slam.robot import MotionCommand, ScannerSpec

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROBOTS = {"irsim_robot": "IrSimRobot", "mujoco_robot": "MujocoRobot"}
IRSIM_WALLS = [
    [(0.5, 0.5), (8, 0.5), (8, 6), (4.6, 6), (4.6, 3), (4.5, 3), (4.5, 6), (0.5, 6), (0.5, 0.5)],
    [(6, 3), (7, 3), (7, 4), (6, 4), (6, 3)],
]
MUJOCO_WALLS = [
    *((0, 0, 6, 0), (6, 0, 6, 5), (6, 5, 0, 5), (0, 5, 0, 0), (3.5, 0, 3.5, 2.2)),
    *((1.25, 3.05, 2.15, 3.05), (1.25, 3.55, 2.15, 3.55), (1.25, 3.05, 1.25, 3.55), (2.15, 3.05, 2.15, 3.55)),
]
"""Middles of walls 0.1 m thick."""
SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4, 5))]


@pytest.fixture
def loaded(monkeypatch, tmp_path):
    """Return an example by its name; what a simulator logs goes elsewhere."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(EXAMPLES))
    yield importlib.import_module
    for name in ROBOTS:
        sys.modules.pop(name, None)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_of_another_simulator_explores_to_the_end(loaded, name, seed):
    robot = getattr(loaded(name), ROBOTS[name])(seed=seed)
    start, errors, ends = robot.true_pose, [], []

    def watch(step):
        off = compose(start, step.pose_world) - robot.true_pose
        errors.append([np.hypot(*off[:2]), abs(wrap(off[2]))])
        ends.append([chain.is_closed for chain in step.chains])

    run = chainslam.explore(robot, robot=robot.spec, max_steps=400, watch=watch)
    assert run.summary["status"] == "complete"
    assert ends[-1] == [True, True]
    assert np.max(errors, axis=0) == pytest.approx([0.0, 0.0], abs=0.03)
    assert not getattr(robot, "collided", False)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", ROBOTS)
def test_scans_show_the_walls_and_odometry_the_way_as_well_as_both_say(loaded, name):
    module = loaded(name)
    robot = getattr(module, ROBOTS[name])(seed=3)
    walls = [np.array(line, dtype=float) for line in IRSIM_WALLS]
    faces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in walls])
    thick = 0.0
    if name == "mujoco_robot":
        faces, thick = np.array(MUJOCO_WALLS, dtype=float).reshape(-1, 2, 2), 0.05
    errors = []
    for command in [MotionCommand(0.1, 0.0), MotionCommand(0.0, 0.15), MotionCommand(0.1, -0.1)] * 6:
        scan = robot.sense()
        assert scan.is_full_turn
        hit = np.isfinite(scan.ranges_m)
        along = np.stack([np.cos(scan.bearings_rad[hit]), np.sin(scan.bearings_rad[hit])], axis=-1)
        points = to_world(scan.ranges_m[hit, None] * along, robot.true_pose)
        off = distance_to_segments(points, faces).min(axis=1)
        assert np.quantile(off, 0.9) < thick + 5.0 * 0.01
        before = robot.true_pose
        odometry = robot.drive(command)
        error = compose(inverse(before), robot.true_pose) - odometry.motion
        errors.append(error @ np.linalg.solve(odometry.cov, error))
        assert not odometry.touched
    assert np.mean(errors) < 6.0  # 3 for odometry that states its errors exactly


@pytest.mark.filterwarnings("default")
def test_what_the_robot_states_is_read_from_irsims_world_and_a_scanner_off_the_axle_maps_as_well(loaded, tmp_path):
    module = loaded("irsim_robot")
    text = module.WORLD.read_text().replace("radius: 0.2", "radius: 0.25").replace(
        "range_min: 0.05", "offset: [0.12, 0, 0.5], range_min: 0.05"
    )  # fmt: skip
    path = tmp_path / "room.yaml"
    path.write_text(text)
    robot = module.IrSimRobot(path)
    assert (robot.spec.radius_m, robot.spec.scanner) == (0.25, ScannerSpec(0.12, 0.0, 0.5))
    start, errors = robot.true_pose, []

    def watch(step):
        errors.append(np.hypot(*(compose(start, step.pose_world) - robot.true_pose)[:2]))

    run = chainslam.explore(robot, robot=robot.spec, max_steps=400, watch=watch)
    assert (run.summary["status"], len(run.map)) == ("complete", 12)
    assert np.max(errors) < 0.02
    assert not robot.collided


def test_each_adaptor_has_fewer_than_a_hundred_lines():
    for name in ROBOTS:
        assert len((EXAMPLES / f"{name}.py").read_text().splitlines()) < 100
