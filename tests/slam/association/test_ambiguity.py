"""A segment that may be of either of two walls, where nothing else tells where the robot is."""

from dataclasses import replace

import numpy as np
import pytest

from sim.lidar import LidarConfig, RangeFinder
from slam.association.ambiguity import observed_either_way
from slam.association.joint_compatibility import relocate
from slam.association.matching import NO_MATCHES, match
from slam.backends import BACKENDS
from slam.estimation.backend import Joint
from slam.estimation.models import lines_robot
from slam.geometry.lines import directions, normals
from slam.mapper import Mapper
from slam.robot import Odometry, Scan
from tests.slam.association.test_matching import straight_pieces

IDS = np.array([4, 9])
PRIOR = np.array([0.05, 0.08, np.deg2rad(2.0)])
SEEN = np.array([np.deg2rad(0.1), 0.003])
AMBIGUOUS = replace(NO_MATCHES, ambiguous=np.array([[0, 4, 9]]))


def two_walls(turn_rad, across_m):
    """Return a joint of a robot at the origin and two walls that it knows well, both 1.5 m in front of it."""
    mean = np.array([0.0, 0.0, 0.0, 0.0, 0.0, turn_rad, across_m])
    stated = np.diag([*PRIOR, 1e-4, 1e-4, 1e-4, 1e-4]) ** 2
    return Joint(mean, stated, np.array([[1.5, 0.0], [1.5, 0.0]]))


def observation(line):
    """Return one segment, 3 m of a line in the robot's frame."""
    foot, along = line[1] * normals(np.array(line[0])), directions(np.array(line[0]))
    piece = straight_pieces([[foot + 1.5 * along, foot - 1.5 * along]])
    return replace(piece, lines=np.array([line]), cov=np.diag(SEEN**2)[None])


@pytest.mark.parametrize(("turn_deg", "across_m"), [(0.4, 0.12), (0.0, 0.15), (-1.5, 0.0)])
def test_whichever_it_was_the_robot_knows_its_heading_better_and_no_better_than_it_says(turn_deg, across_m):
    rng = np.random.default_rng(12)
    joint = two_walls(np.deg2rad(turn_deg), across_m)
    errors, stated = [], []
    for trial in range(400):
        pose = PRIOR * rng.standard_normal(3)
        lines = lines_robot(pose, joint.anchors, joint.mean[3:].reshape(-1, 2))
        seen = observation(lines[rng.integers(2)] + SEEN * rng.standard_normal(2))
        likelier_first = AMBIGUOUS if trial % 2 else replace(AMBIGUOUS, ambiguous=np.array([[0, 9, 4]]))
        rows, observed = observed_either_way(likelier_first, seen, IDS, joint)
        assert rows.tolist() == [0]
        after = relocate(joint, IDS, observed)
        errors.append(after.mean[2] - pose[2])
        stated.append(after.cov[2, 2])
    assert np.mean(np.square(errors) / stated) < 1.2
    assert np.sqrt(np.mean(np.square(errors))) < 0.7 * PRIOR[2]


def test_two_walls_that_are_not_alike_are_no_guide():
    for turn_deg, across_m in ((3.0, 0.0), (0.0, 0.25), (1.5, 0.18)):
        joint = two_walls(np.deg2rad(turn_deg), across_m)
        seen = observation((0.0, 1.5))
        rows, observed = observed_either_way(AMBIGUOUS, seen, IDS, joint)
        assert not len(rows)
        assert not len(observed.ids)
        assert not len(observed_either_way(NO_MATCHES, seen, IDS, joint)[0])


def heading_error_deg(is_ambiguous):
    """Return the worst error where the wheels miss half a degree a step beside one wall, which may be either of two."""
    finder = RangeFinder(np.array([[[5.0, 1.0], [-5.0, 1.0]]]), LidarConfig())
    wheels = Odometry(np.zeros(3), np.diag([0.002, 0.002, np.deg2rad(0.5)]) ** 2)
    step = 0

    def ambiguous(segments, walls, joint, config, *, clear_only=False):
        if step < 5:
            return match(segments, walls, joint, config, clear_only=clear_only)
        every = np.arange(len(segments))
        either = np.column_stack([every, np.full((len(every), 2), walls.ids[0])])
        return replace(
            NO_MATCHES, unmatched=every, doubtful=every, ambiguous=either if is_ambiguous else NO_MATCHES.ambiguous
        )

    mapper = Mapper(BACKENDS["full-ekf"].make(np.zeros(3), np.diag([1e-4, 1e-4, 1e-6])), matcher=ambiguous)
    errors = []
    for step in range(60):
        turned = np.deg2rad(0.5) * max(step - 5, 0)
        if step:
            mapper.predict(wheels)
        scan = Scan(finder.bearings_rad, finder.cast(np.array([0.0, 0.0, turned]))[0], 0.01, 4.0, 0.1 * step)
        errors.append(mapper.step(scan).map.belief.pose_world[2] - turned)
    return np.rad2deg(np.abs(errors).max())


def test_beside_a_wall_that_may_be_either_the_robot_keeps_its_heading():
    assert heading_error_deg(is_ambiguous=True) < 1.0
    assert heading_error_deg(is_ambiguous=False) > 20.0
