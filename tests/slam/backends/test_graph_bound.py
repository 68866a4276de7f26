"""A factor graph learns nothing of where the world lies: P_pose >= A P0 A' at its points of linearisation."""

import numpy as np
import pytest

from slam.backend import Observations
from slam.backends.graph import Graph
from slam.geometry.poses import J, rotation

P0 = np.diag([0.1, 0.1, np.deg2rad(2.0)]) ** 2
START = np.array([0.0, -1.0, 0.3])

pytestmark = pytest.mark.usefixtures("_unchecked")


def turned(cov, angle):
    R = np.eye(3)
    R[:2, :2] = rotation(angle)
    return R @ cov @ R.T


def margin(cov, pose, first):
    """Return the smallest eigenvalue of P - A P0 A', P0 turned from the frame of the true first pose into `first`."""
    A = np.eye(3)
    A[:2, 2] = J @ (pose[:2] - first[:2])
    return np.linalg.eigvalsh(cov - A @ turned(turned(P0, -START[2]), first[2]) @ A.T).min()


def margins(graph):
    """Return the margin at the points of linearisation, and at the estimate."""
    graph.belief.joint([])
    solver = graph._solver
    body = solver.pose_cov()
    linearised, estimated = solver.isam.all(linearisation=True), solver.isam.all()
    count = solver.last + 1
    both = (linearised.poses(count), estimated.poses(count))
    return [margin(turned(body, poses[-1, 2]), poses[-1], poses[0]) for poses in both]


def test_standing_still_a_thousand_looks_tell_nothing_of_the_place(make_walls):
    rng, walls = np.random.default_rng(42), make_walls(8)
    true = START + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
    graph, rows = Graph(START, P0), np.arange(8)
    ids = graph.grow(*walls.look(true, rows, rng))
    found = []
    for k in range(1000):
        lines, cov, _ = walls.look(true, rows, rng)
        seen = Observations(ids, lines, cov)
        graph.update(seen, seen)
        if k % 20 == 19:
            found.append(margins(graph))
    at_linearisation, at_estimate = np.min(found, axis=0) / np.trace(P0)
    print(f"standing still, smallest eigenvalue over tr P0: {at_linearisation:.1e}, at the estimate {at_estimate:.1e}")
    assert at_linearisation >= -1e-8


def test_a_drive_never_makes_the_pose_surer_than_its_start_carried_along(make_walls):
    rng, walls, graph = np.random.default_rng(43), make_walls(16, sigmas=(1e-3, 1e-3)), Graph(START, P0)
    true = START + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
    ids = dict(enumerate(graph.grow(*walls.look(true, np.arange(6), rng)).tolist()))
    found = [margins(graph) for _ in walls.tour(graph, true, rng, 150, ids, sigmas=(0.03, 0.02, 0.03))]
    at_linearisation, at_estimate = np.min(found, axis=0) / np.trace(P0)
    print(f"moving, smallest eigenvalue over tr P0: {at_linearisation:.1e}, at the estimate {at_estimate:.1e}")
    assert at_linearisation >= -1e-8
