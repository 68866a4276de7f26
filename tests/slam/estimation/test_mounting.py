"""A scanner that sits off the axle: poses, odometry and lines go from one frame to the other and back."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.estimation.mounting import (
    belief_of_body,
    body_poses,
    carried,
    odometry_of_body,
    odometry_of_scanner,
    scanner_poses,
    start_of_scanner,
)
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import compose, inverse, to_robot, to_world
from chainslam.slam.robot import Odometry, ScannerSpec

SCANNER = ScannerSpec(0.12, -0.05, 0.4)
AT_AXLE = ScannerSpec()


def derivative(f, x, h=1e-6):
    return np.stack([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=-1)


@pytest.mark.parametrize("seed", range(3))
def test_a_scanner_is_carried_with_the_body_and_tells_where_that_is(seed):
    pose, other = np.random.default_rng(seed).normal(0.0, 1.0, (2, 3))
    moved, G = carried(pose, SCANNER.pose_robot)
    np.testing.assert_allclose(moved[:2], to_world(SCANNER.pose_robot[:2], pose))
    np.testing.assert_allclose(G, derivative(lambda p: carried(p, SCANNER.pose_robot)[0], pose), atol=1e-8)
    for poses in (np.array([pose, other]), np.zeros((0, 3))):
        np.testing.assert_allclose(body_poses(scanner_poses(poses, SCANNER), SCANNER), poses, atol=1e-12)


@pytest.mark.parametrize("motion", [[0.15, 0.01, 0.1], [0.0, 0.0, -0.17], [-0.1, 0.0, 0.0]])
def test_odometry_is_that_of_the_scanner_with_what_its_covariance_says_of_it(motion):
    motion = np.array(motion)
    mount = SCANNER.pose_robot

    def of_scanner(m):
        return compose(inverse(mount), compose(m, mount))

    cov = np.diag([1e-4, 2e-5, 3e-4])
    found = odometry_of_scanner(Odometry(motion, cov, touched=True), SCANNER)
    # The scanner of a body that moved is where the scanner that moved is.
    start = np.array([1.0, 2.0, 0.7])
    np.testing.assert_allclose(
        compose(compose(start, mount), found.motion), compose(compose(start, motion), mount), atol=1e-12
    )
    A = derivative(of_scanner, motion)
    np.testing.assert_allclose(found.cov, A @ cov @ A.T, atol=1e-10)
    assert found.touched
    back = odometry_of_body(found, SCANNER)
    np.testing.assert_allclose(back.motion, motion, atol=1e-12)
    np.testing.assert_allclose(back.cov, cov, atol=1e-15)


@pytest.mark.parametrize("backend", ["full-ekf", "block-ekf", "graph"])
def test_a_belief_of_the_body_has_the_pose_and_the_covariances_of_the_body(backend):
    start, cov = np.array([1.0, -2.0, 0.3]), np.diag([1e-4, 1e-4, 1e-3])
    made = BACKENDS[backend].make(*start_of_scanner(start, cov, SCANNER), BackendOptions())
    belief = belief_of_body(made.belief, SCANNER)
    np.testing.assert_allclose(belief.pose_world, start, atol=1e-9)
    np.testing.assert_allclose(belief.pose_cov, cov, atol=1e-9)
    made.predict(odometry_of_scanner(Odometry(np.array([0.1, 0.0, 0.1]), 1e-4 * np.eye(3)), SCANNER))
    made.grow(np.array([[0.0, 1.0]]), np.diag([1e-4, 1e-4])[None], np.array([[1.0, 0.0]]))
    inner, belief = made.belief, belief_of_body(made.belief, SCANNER)
    np.testing.assert_allclose(belief.pose_world, compose(start, np.array([0.1, 0.0, 0.1])), atol=1e-9)
    joint, own = belief.joint(belief.ids), inner.joint(inner.ids)
    np.testing.assert_allclose(joint.mean[:3], belief.pose_world, atol=1e-9)
    np.testing.assert_allclose(joint.cov[:3, :3], belief.pose_cov, atol=1e-12)
    np.testing.assert_allclose(joint.cov, joint.cov.T, atol=1e-15)
    np.testing.assert_array_equal(joint.cov[3:, 3:], own.cov[3:, 3:])
    np.testing.assert_array_equal(joint.anchors, own.anchors)
    G = derivative(lambda p: body_poses(p[None], SCANNER)[0], own.mean[:3])
    np.testing.assert_allclose(joint.cov[:3, 3:], G @ own.cov[:3, 3:], atol=1e-9)


def test_segments_are_those_of_the_same_walls_seen_from_the_body():
    faces = np.array([[[2.0, 1.0], [2.0, -1.0]], [[-1.0, 0.06], [3.0, 0.05]]])
    mount = SCANNER.pose_robot
    seen = to_robot(faces, mount)
    lines = through(seen)
    flip = lines[:, 1] < 0
    lines[flip] = np.column_stack([lines[flip, 0] + np.pi, -lines[flip, 1]])
    cov = np.array([[[1e-4, 3e-5], [3e-5, 2e-5]], [[2e-4, -1e-5], [-1e-5, 4e-5]]])
    none = np.zeros(2, dtype=np.int64)
    segments = Segments(lines, cov, seen, np.zeros((2, 2), dtype=np.int64), none, np.zeros((2, 2), dtype=bool),
                        np.zeros(2), np.zeros(2, dtype=bool))  # fmt: skip
    on_body = segments.on_body(SCANNER)
    np.testing.assert_allclose(on_body.ends, faces, atol=1e-12)
    n = np.stack([np.cos(on_body.lines[:, 0]), np.sin(on_body.lines[:, 0])], axis=-1)
    np.testing.assert_allclose(np.vecdot(faces, n[:, None]), on_body.lines[:, 1:].repeat(2, axis=1), atol=1e-12)

    def moved(line):
        return replace(segments, lines=np.stack([line, line])).on_body(SCANNER).lines[0]

    for k in range(2):
        G = derivative(moved, lines[k])
        np.testing.assert_allclose(on_body.cov[k], G @ cov[k] @ G.T, atol=1e-10)


def test_nothing_is_computed_for_a_scanner_at_the_axle():
    pose, cov = np.zeros(3), np.eye(3)
    assert start_of_scanner(pose, cov, AT_AXLE) == (pose, cov)
    odometry = Odometry(pose, cov)
    assert odometry_of_scanner(odometry, AT_AXLE) is odometry
    assert scanner_poses(pose[None], AT_AXLE)[0] is not None
