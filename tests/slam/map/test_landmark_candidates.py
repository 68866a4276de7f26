"""Lines of few beams become walls when looks from several places make them likely enough."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import to_robot
from chainslam.slam.map.existence import ExistenceConfig, LandmarkCandidates
from chainslam.slam.robot import Scan

SIGMA_M = 0.005
GATE, ANGLE_RAD, LEAST_BEAMS = 0.99, 1.05, 3
CONFIG = ExistenceConfig()


def look(face_world: np.ndarray, pose_world: np.ndarray, rng: np.random.Generator, beams: int = 3) -> Segments:
    """Return one face as a segment of so many beams, with the covariance of ends that are off by noise."""
    ends = to_robot(face_world, pose_world)
    n = np.array([np.cos(through(ends[None])[0, 0]), np.sin(through(ends[None])[0, 0])])
    noisy = ends + SIGMA_M * np.clip(rng.standard_normal((2, 1)), -1.0, 1.0) * n
    line, length = through(noisy[None]), float(np.hypot(*(ends[1] - ends[0])))
    along = float(noisy.mean(axis=0) @ np.array([-np.sin(line[0, 0]), np.cos(line[0, 0])]))
    var_alpha, var_across = 2 * SIGMA_M**2 / length**2, SIGMA_M**2 / 2
    # The line's distance from the robot's origin changes with its direction by the lever to its middle.
    cov = np.array([[[var_alpha, along * var_alpha], [along * var_alpha, var_across + along**2 * var_alpha]]])
    apart = np.zeros((1, 2), bool)
    return Segments(
        line, cov, noisy[None], np.array([[0, beams - 1]]), np.array([beams]), apart, np.zeros(1), np.array([beams < 5])
    )


class Looked(LandmarkCandidates):
    """All segments that are shown have few beams."""

    def see(self, pose_world, scan, segments):
        return super().see(pose_world, scan, segments, np.arange(len(segments)))


def candidates(existence: ExistenceConfig = CONFIG) -> Looked:
    return Looked(GATE, ANGLE_RAD, LEAST_BEAMS, existence)


def scan_of(faces: list[np.ndarray], pose: np.ndarray) -> Scan:
    finder = RangeFinder(np.asarray(faces, dtype=float).reshape(-1, 2, 2), LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)


NONE = look(np.eye(2), np.zeros(3), np.random.default_rng(0)).take(np.zeros(0, int))
"""No segments."""


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 4))
def test_a_face_is_believed_once_four_scans_showed_it_from_three_places(seed: int, beams: int) -> None:
    """The prior and three looks pass the odds of a sure segment; from one place all scans are one look."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(-np.pi, np.pi)
    face = 0.06 * np.array([[-np.sin(turn), np.cos(turn)]]) * np.array([[-1.0], [1.0]])
    free_side = -np.array([np.cos(turn), np.sin(turn)])
    poses = [np.array([*(0.8 * free_side + 0.1 * k * face[1] / 0.06), 0.3 * k]) for k in range(4)]
    moving, standing = candidates(), candidates()
    believed = [len(moving.see(pose, scan_of([face], pose), look(face, pose, rng, beams))[0]) for pose in poses]
    assert believed == [0, 0, 0, 1]
    assert not any(
        len(standing.see(poses[0], scan_of([face], poses[0]), look(face, poses[0], rng, 4))[0]) for _ in range(10)
    )


def test_lines_that_are_elsewhere_each_time_are_never_believed() -> None:
    rng = np.random.default_rng(3)
    faint = candidates()
    for k in range(15):
        face = np.array([[1.0 + 0.08 * k, 0.05], [1.0 + 0.08 * k, -0.05]])[::-1]
        pose = np.array([0.0, 0.06 * k, 0.0])
        assert not len(faint.see(pose, scan_of([face], pose), look(face, pose, rng))[0])


@pytest.mark.parametrize("existence", [CONFIG, ExistenceConfig(shown=0.5, few_shown_over_faces=0.5)])
def test_a_line_in_whose_place_a_look_shows_nothing_is_forgotten(existence: ExistenceConfig) -> None:
    """It begins anew; where looks say nothing of what is, it goes on, and is never believed either."""
    rng, faint = np.random.default_rng(4), candidates(existence)
    face, wall = np.array([[0.5, -0.1], [0.5, 0.1]]), np.array([[3.0, -3.0], [3.0, 3.0]])
    poses = [np.array([0.0, 0.1 * k, 0.0]) for k in range(4)]
    for k in range(2):
        faint.see(poses[k], scan_of([face], poses[k]), look(face, poses[k], rng))
    for k in range(2, 4):
        faint.see(poses[k], scan_of([wall], poses[k]), NONE)
    assert len(faint) == (0 if existence.shown > 0.5 else 1)
