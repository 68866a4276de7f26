"""The joint NEES of pose and walls, and of the map alone, against their definitions worked out by other ways."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime, least_squares

from chainslam.experiments.scoring.summary import joint_anees, map_error, map_scores
from chainslam.slam.estimation.backend import Joint
from tests.experiments.by_hand import TRUE, marked, matrix, xi_of

LINES = 4


def joint_of(truth, rng, lines=LINES):
    """A pose and lines a little off the truth, with a full covariance."""
    faces = truth.faces[:lines]
    anchors = faces.mean(axis=1) + rng.normal(size=(lines, 2))
    pose = TRUE[2] + rng.normal(size=3) * [0.1, 0.1, 0.02]
    n = np.column_stack([np.cos(truth.lines[:lines, 0]), np.sin(truth.lines[:lines, 0])])
    means = np.column_stack([truth.lines[:lines, 0], truth.lines[:lines, 1] - np.sum(n * anchors, axis=1)])
    means += rng.normal(size=means.shape) * 0.02
    root = rng.normal(size=(3 + 2 * lines, 3 + 2 * lines)) * 0.05
    return Joint(np.concatenate([pose, means.ravel()]), root @ root.T + 1e-3 * np.eye(3 + 2 * lines), anchors)


def errors_of(mean, anchors, pose_true, lines_true):
    """The errors as docs/concepts/scores.md states them, line by line: undo the motion of the pose, then compare."""
    motion = np.linalg.inv(matrix(mean[:3]) @ np.linalg.inv(matrix(pose_true)))
    errors = list(xi_of(mean[:3], pose_true))
    for k, (alpha, d) in enumerate(mean[3:].reshape(-1, 2)):
        foot = anchors[k] + d * np.array([np.cos(alpha), np.sin(alpha)])
        moved, anchor = ((motion @ [*point, 1.0])[:2] for point in (foot, anchors[k]))
        turned = alpha + np.arctan2(motion[1, 0], motion[0, 0])
        own = np.array([np.cos(turned), np.sin(turned)]) @ (moved - anchor)
        true_n = np.array([np.cos(lines_true[k, 0]), np.sin(lines_true[k, 0])])
        errors += [np.angle(np.exp(1j * (turned - lines_true[k, 0]))), own - (lines_true[k, 1] - true_n @ anchor)]
    return np.array(errors)


def left_by(motion, joint, truth, rows):
    """Errors (alpha, d) of the walls once a motion has carried the true ones, by two points of each."""
    errors = []
    for row in rows:
        carried = (matrix(motion) @ np.column_stack([truth.faces[row], np.ones(2)]).T).T[:, :2]
        along = carried[1] - carried[0]
        n = np.array([along[1], -along[0]]) / np.hypot(*along)
        alpha, d = joint.mean[3 + 2 * row : 5 + 2 * row]
        errors += [np.angle(np.exp(1j * (alpha - np.arctan2(n[1], n[0])))), d - n @ (carried[0] - joint.anchors[row])]
    keep = [3 + 2 * row + k for row in rows for k in (0, 1)]
    return np.linalg.solve(np.linalg.cholesky(joint.cov[np.ix_(keep, keep)]), errors)


def carried(motion, joint, rows):
    """The estimated walls (alpha, d) once a motion has carried them, by two points of each; whitened."""
    there = []
    for row in rows:
        alpha, d = joint.mean[3 + 2 * row : 5 + 2 * row]
        n = np.array([np.cos(alpha), np.sin(alpha)])
        points = joint.anchors[row] + d * n + np.array([[0.0, 0.0], [-n[1], n[0]]])
        first, second = (motion @ np.column_stack([points, np.ones(2)]).T).T[:, :2]
        n = np.array([second[1] - first[1], first[0] - second[0]])
        there += [np.arctan2(n[1], n[0]), n @ (first - joint.anchors[row])]
    keep = [3 + 2 * row + k for row in rows for k in (0, 1)]
    return np.linalg.solve(np.linalg.cholesky(joint.cov[np.ix_(keep, keep)]), there)


def expected_shape(joint, truth, rows):
    """Return what the best motion leaves over its degrees of freedom, and that motion."""
    found = least_squares(left_by, np.zeros(3), "3-point", args=(joint, truth, rows), ftol=1e-14, xtol=1e-14)
    told = np.linalg.matrix_rank(found.jac, 1e-6)  # parallel walls do not tell a shift along them
    return 2.0 * found.cost / (2 * len(rows) - told), found.x


def expected_anees(joint, truth, rows):
    lines = truth.lines[: len(joint.anchors)]
    alpha = joint.mean[3::2]
    n = np.column_stack([np.cos(alpha), np.sin(alpha)])
    lines_there = np.column_stack([alpha, joint.mean[4::2] + np.sum(n * joint.anchors, axis=1)])
    jacobian = approx_fprime(joint.mean, lambda mean: errors_of(mean, joint.anchors, joint.mean[:3], lines_there), 1e-7)
    error = errors_of(joint.mean, joint.anchors, TRUE[2], lines)
    keep = [0, 1, 2] + [3 + 2 * row + k for row in rows for k in (0, 1)]
    cov = (jacobian @ joint.cov @ jacobian.T)[np.ix_(keep, keep)]
    return error[keep] @ np.linalg.solve(cov, error[keep]) / len(keep)


@pytest.mark.parametrize("rows", [[0, 1, 2, 3], [1, 3], [2]])
def test_the_nees_of_pose_and_walls_is_that_of_its_definition_over_its_dimension(run, truth, rows):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    found = joint_anees(run.votes, ids, joint, TRUE[2], np.isin(ids, rows))
    assert found == pytest.approx(expected_anees(joint, truth, rows), rel=1e-4)


@pytest.mark.parametrize("rows", [[0, 1, 2, 3], [1, 2, 3], [0, 1]])
def test_the_nees_of_the_map_is_what_no_common_motion_takes_away(run, truth, rows):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    found = map_scores(map_error(run.votes, ids, joint, np.isin(ids, rows)))
    anees, motion = expected_shape(joint, truth, rows)
    assert found["map_anees"] == pytest.approx(anees, rel=1e-4)
    assert found["map_frame_rad"] == pytest.approx(abs(motion[2]), abs=1e-4)
    middle = joint.anchors[rows].mean(axis=0)
    back = np.linalg.inv(matrix(motion)) @ [*middle, 1.0]
    assert found["map_frame_m"] == pytest.approx(np.hypot(*(back[:2] - middle)), abs=1e-4)
    # What the covariance says of the frame: how a motion of the world moves the walls where they are estimated.
    xi, step = xi_of(motion, np.zeros(3)), 1e-5
    there = [carried(matrix(sign * step * axis), joint, rows) for axis in np.eye(3) for sign in (1, -1)]
    by_world = np.column_stack([(there[2 * k] - there[2 * k + 1]) / (2 * step) for k in range(3)])
    assert found["map_frame_anees"] == pytest.approx(np.sum((by_world @ xi) ** 2) / 3, rel=1e-4)


def test_a_robot_lost_at_the_end_does_not_spoil_the_score_of_its_map(run, truth):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    lost = replace(joint, mean=joint.mean + 0.9 * (np.arange(len(joint.mean)) == 2))
    every = np.ones(LINES, bool)
    found, expected = (map_scores(map_error(run.votes, ids, each, every)) for each in (lost, joint))
    assert found == expected


def test_crooked_walls_are_in_one_score_of_the_map_and_tentative_or_unlabelled_ones_in_none(run, truth, make_map):
    joint = joint_of(truth, np.random.default_rng(6))
    walls = make_map(truth.faces[:LINES], np.zeros(3))
    small = replace(run, step=replace(run.step, map=walls, chains=()), joint=joint)
    found = marked(small, crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [0, 1, 2, 3])[0], rel=1e-4)
    assert found["map_anees_straight"] == pytest.approx(expected_shape(joint, truth, [0, 2, 3])[0], rel=1e-4)
    found = marked(small, tentative=[0], crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [1, 2, 3])[0], rel=1e-4)
    del small.votes.beams[3]
    found = marked(small, crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [0, 1, 2])[0], rel=1e-4)
    assert found["map_anees_straight"] == pytest.approx(expected_shape(joint, truth, [0, 2])[0], rel=1e-4)


def test_without_a_wall_or_a_covariance_the_map_has_no_nees(run, truth):
    joint, ids = joint_of(truth, np.random.default_rng(7)), np.arange(LINES)
    every = np.ones(LINES, bool)
    nothing = dict.fromkeys(("map_anees", "map_frame_anees", "map_frame_m", "map_frame_rad"))
    assert map_scores(map_error(run.votes, ids, None, every)) == nothing
    assert map_error(run.votes, ids, joint, ~every) is joint_anees(run.votes, ids, joint, TRUE[2], ~every) is None
    assert joint_anees(run.votes, ids, None, TRUE[2], every) is None
    assert map_scores(map_error(run.votes, ids, joint, ids == 1))["map_anees"] is None
    flat = replace(joint, cov=-joint.cov)
    assert map_error(run.votes, ids, flat, every) is joint_anees(run.votes, ids, flat, TRUE[2], every) is None
