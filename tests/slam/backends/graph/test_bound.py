"""A factor graph learns nothing of where the world lies: P_pose >= A P0 A'."""

import numpy as np
import pytest

from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.poses import J

P0 = np.diag([0.1, 0.1, np.deg2rad(2.0)]) ** 2
START = np.array([0.0, -1.0, 0.3])

pytestmark = pytest.mark.usefixtures("_unchecked")


def margin(graph):
    """Return the smallest eigenvalue of P - A P0 A' at the estimate."""
    belief, A = graph.belief, np.eye(3)
    A[:2, 2] = J @ (belief.pose_world[:2] - START[:2])
    return np.linalg.eigvalsh(belief.pose_cov - A @ P0 @ A.T).min()


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
            found.append(margin(graph))
    print(f"standing still, smallest eigenvalue over tr P0: {min(found) / np.trace(P0):.1e}")
    assert min(found) >= -1e-12 * np.trace(P0)


def test_a_drive_never_makes_the_pose_surer_than_its_start_carried_along(make_walls):
    rng, walls, graph = np.random.default_rng(43), make_walls(16, sigmas=(1e-3, 1e-3)), Graph(START, P0)
    true = START + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
    ids = dict(enumerate(graph.grow(*walls.look(true, np.arange(6), rng)).tolist()))
    found = [margin(graph) for _ in walls.tour(graph, true, rng, 150, ids, sigmas=(0.03, 0.02, 0.03))]
    print(f"moving, smallest eigenvalue over tr P0: {min(found) / np.trace(P0):.1e}")
    assert min(found) >= -1e-12 * np.trace(P0)
