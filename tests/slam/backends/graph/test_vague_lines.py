"""Lines that are a cluster of points, seen from all around: their direction is hardly known, and must come to rest."""

import numpy as np
import pytest

from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, to_robot, wrap
from chainslam.slam.robot import Odometry

pytestmark = pytest.mark.usefixtures("_unchecked")

START, P0 = np.zeros(3), 1e-8 * np.eye(3)
STEP, STEP_COV = np.array([0.1, 0.0, 0.05]), np.diag([0.01, 0.01, 0.01]) ** 2
WALLS = np.array([[0.0, 3.0], [np.pi / 2, 3.0], [np.pi, 3.0], [-np.pi / 2, 3.0]])
BLOB = np.array([1.5, 1.5])
VAGUE_RAD, ACROSS_M, WIDE_M = 0.6, 0.02, 0.04


def seen_walls(pose, rng):
    lines = np.stack([wrap(WALLS[:, 0] - pose[2]), WALLS[:, 1] - normals(WALLS[:, 0]) @ pose[:2]], axis=-1)
    return lines + rng.normal(0.0, [0.005, 0.01], lines.shape), np.tile(np.diag([0.005, 0.01]) ** 2, (4, 1, 1))


def seen_blob(pose, rng):
    """Return a segment of two beams or three on a cluster of points: in any direction, somewhere among them."""
    centre = to_robot((BLOB + rng.normal(0.0, WIDE_M, 2))[None], pose)[0]
    alpha = np.arctan2(centre[1], centre[0]) + rng.uniform(-1.0, 1.0)
    t = float(directions(np.array([alpha]))[0] @ centre)
    turn = np.array([[1.0, 0.0], [t, 1.0]])
    line = np.array([[alpha, float(normals(np.array([alpha]))[0] @ centre)]])
    return line, (turn @ np.diag([VAGUE_RAD, ACROSS_M]) ** 2 @ turn.T)[None], centre[None]


def drive(graph, seed):
    """See the cluster from ten poses, then walls alone; return its direction in each step from then on, rad."""
    rng, true, found = np.random.default_rng(seed), START.copy(), list[float]()
    lines, cov = seen_walls(true, rng)
    walls = graph.grow(lines, cov, lines[:, 1:] * normals(lines[:, 0]))
    blob = None
    for k in range(16):
        graph.predict(Odometry(STEP, STEP_COV))
        true = compose(true, STEP + rng.normal(0.0, np.sqrt(np.diag(STEP_COV))))
        observed = Observations(walls, *seen_walls(true, rng))
        graph.update(observed, observed)
        _ = graph.belief
        if k < 10:
            line, cov, centre = seen_blob(true, rng)
            if blob is None:
                blob = graph.grow(line, cov, centre)
            else:
                observed = Observations(blob, line, cov)
                graph.update(observed, observed)
        else:
            found.append(float(graph.belief.means[-1, 0]))
    return np.array(found)


@pytest.mark.parametrize("seed", range(6))
def test_a_line_that_is_no_longer_seen_comes_to_rest(seed):
    found = drive(Graph(START, P0), seed)
    assert np.abs(wrap(np.diff(found)))[1:].max() < 0.02


def test_a_line_that_is_no_longer_seen_rests_near_the_optimum():
    """A line that turns in a solution takes its old observations with it.

    In sets of 40 drives nine of ten lines end within 0.09 to 0.24 sigma; 0.28 to 0.67 where observations are linearised
    anew after a solution only. The tenth may end farther off either way.
    """
    off = []
    for seed in range(40):
        graph = Graph(START, P0)
        found = drive(graph, seed)[-1]
        for _ in range(2):
            graph.relinearise()
        optimum = graph.belief.joint(graph.belief.ids[-1:])
        off.append(abs(wrap(optimum.mean[3] - found)) / np.sqrt(optimum.cov[3, 3]))
    assert np.quantile(off, 0.9) < 0.25
