"""Lines of few beams become walls when they stay where they are, seen from several places."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.extraction.segments import EndKind, Segments
from slam.geometry.lines import through
from slam.geometry.poses import to_robot
from slam.map.candidates import CandidatesConfig, LandmarkCandidates

SIGMA_M = 0.005
GATE, ANGLE_RAD, SURE_BEAMS = 0.99, 1.05, 5


def look(face_world: np.ndarray, pose_world: np.ndarray, rng: np.random.Generator, beams: int = 3) -> Segments:
    """Return one face as a segment of so many beams, its two ends off by noise, with the covariance of that."""
    ends = to_robot(face_world, pose_world)
    n = np.array([np.cos(through(ends[None])[0, 0]), np.sin(through(ends[None])[0, 0])])
    noisy = ends + SIGMA_M * rng.standard_normal((2, 1)) * n
    line, length = through(noisy[None]), float(np.hypot(*(ends[1] - ends[0])))
    along = float(noisy.mean(axis=0) @ np.array([-np.sin(line[0, 0]), np.cos(line[0, 0])]))
    var_alpha, var_across = 2 * SIGMA_M**2 / length**2, SIGMA_M**2 / 2
    # The line's distance from the robot's origin changes with its direction by the lever to its middle.
    cov = np.array([[[var_alpha, along * var_alpha], [along * var_alpha, var_across + along**2 * var_alpha]]])
    kinds = np.full((1, 2), int(EndKind.OPEN))
    return Segments(
        line, cov, noisy[None], np.array([[0, beams - 1]]), np.array([beams]), kinds, np.zeros(1), np.array([beams < 5])
    )


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10**6), st.sampled_from([([3, 3, 3], 2), ([4, 4], 1), ([4, 3], 1), ([3, 4], 1), ([3, 3, 4, 3], 2)])
)
def test_a_face_is_believed_once_several_places_showed_three_spare_beams(
    seed: int, shown: tuple[list[int], int]
) -> None:
    """Two that any line goes through are none; from one place never."""
    rng = np.random.default_rng(seed)
    beams, look_of_belief = shown
    turn = rng.uniform(-np.pi, np.pi)
    face = 0.06 * np.array([[-np.sin(turn), np.cos(turn)]]) * np.array([[-1.0], [1.0]])
    free_side = -np.array([np.cos(turn), np.sin(turn)])
    poses = [np.array([*(0.8 * free_side + 0.1 * k * face[1] / 0.06), 0.3 * k]) for k in range(len(beams))]
    moving, standing = (
        LandmarkCandidates(0.99999, ANGLE_RAD, SURE_BEAMS),
        LandmarkCandidates(0.99999, ANGLE_RAD, SURE_BEAMS),
    )
    believed = [len(moving.see(pose, look(face, pose, rng, m))) for pose, m in zip(poses, beams, strict=True)]
    assert believed == [k == look_of_belief for k in range(len(beams))]
    assert not any(len(standing.see(poses[0], look(face, poses[0], rng, 4))) for _ in range(10))


def test_lines_that_are_elsewhere_each_time_are_never_believed() -> None:
    rng = np.random.default_rng(3)
    faint = LandmarkCandidates(GATE, ANGLE_RAD, SURE_BEAMS)
    for k in range(15):
        face = np.array([[1.0 + 0.08 * k, 0.05], [1.0 + 0.08 * k, -0.05]])[::-1]
        pose = np.array([0.0, 0.06 * k, 0.0])
        assert not len(faint.see(pose, look(face, pose, rng)))


def test_a_line_unseen_for_long_is_forgotten() -> None:
    rng = np.random.default_rng(4)
    faint = LandmarkCandidates(GATE, ANGLE_RAD, SURE_BEAMS, CandidatesConfig(patience_m=5 * 0.15))
    face, nothing = (
        np.array([[1.0, 0.05], [1.0, -0.05]])[::-1],
        look(np.eye(2), np.zeros(3), rng).take(np.zeros(0, int)),
    )
    poses = [np.array([0.0, 0.1 * k, 0.0]) for k in range(4)]
    for pose in poses[:2]:
        faint.see(pose, look(face, pose, rng))
    for _ in range(7):
        faint.see(poses[1], nothing)
    assert not len(faint.see(poses[2], look(face, poses[2], rng)))


def test_a_line_longer_than_a_door_end_is_never_believed() -> None:
    """What shows three or four beams there is mostly a line from one wall's corner to the next wall."""
    rng = np.random.default_rng(5)
    for half_m, is_believed in ((0.08, True), (0.1, False)):
        faint, face = LandmarkCandidates(GATE, ANGLE_RAD, SURE_BEAMS), np.array([[1.0, -half_m], [1.0, half_m]])
        poses = [np.array([0.0, 0.1 * k, 0.0]) for k in range(4)]
        assert any(len(faint.see(pose, look(face, pose, rng, 4))) for pose in poses) == is_believed
