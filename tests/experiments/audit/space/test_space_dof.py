"""How much relations and halves of graphs in space tell is as their joint covariance says."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from chainslam.experiments.library.audit.auditing import audit, read
from chainslam.experiments.library.audit.draws import effective_dof
from chainslam.slam.evaluation.consistency import whitened

from .graphs import SIGMAS, drive, helix, relations_file
from .spaces import hat, matrix, vee
from .test_space_graphs import dense


def dof_of(C, d):
    """Return the degrees of freedom of the mean NEES of errors with a joint covariance."""
    whiten = block_diag(*(np.linalg.inv(np.linalg.cholesky(C[k : k + d, k : k + d])) for k in range(0, len(C), d)))
    return len(C) ** 2 / np.sum((whiten @ C @ whiten.T) ** 2)


def test_degrees_of_freedom_of_relations_are_those_of_the_joint_covariance(tmp_path):
    path, true, ends, seen = drive(tmp_path, count=14)
    poses = read(path, space="space").poses_world
    C = dense(poses, ends, seen, np.diag(SIGMAS**-2.0))

    def of(pairs):
        G = np.zeros((6 * len(pairs), len(C)))
        for k, (i, j) in enumerate(pairs):
            M = np.linalg.inv(matrix(poses[i])) @ matrix(poses[j])
            moved = [vee(np.linalg.inv(M) @ hat(axis) @ M) for axis in np.eye(6)]
            G[6 * k : 6 * k + 6, 6 * i : 6 * i + 6] = -np.stack(moved, axis=1)
            G[6 * k : 6 * k + 6, 6 * j : 6 * j + 6] = np.eye(6)
        return dof_of(G @ C @ G.T, 6)

    [found] = audit(path, truth=true, space="space").trajectories
    assert found.lags[0].score.dof == pytest.approx(of([(k, k + 1) for k in range(1, 13)]), rel=1e-6)
    pairs = [(k, k + 2) for k in range(1, 12)]
    exact = relations_file(tmp_path / "r", helix(14), pairs)
    [found] = audit(path, relations=exact, space="space").trajectories
    assert found.pose.dof == pytest.approx(of(pairs), rel=1e-6)


def test_edges_in_space_have_six_degrees_of_freedom_each(tmp_path):
    path, _, ends, _ = drive(tmp_path, count=14)
    [note] = [note for note in read(path, space="space").notes if note.startswith("chi-square")]
    assert f"ideally {6 * (len(ends) - 13)}:" in note


def test_halves_that_are_graphs_have_the_degrees_of_freedom_of_a_series(tmp_path):
    paths = [drive(tmp_path, seed=seed, name=f"h{seed}")[0] for seed in range(2)]
    [found] = audit(paths, halves=True, space="space").trajectories
    assert found.pose.dof == pytest.approx(effective_dof(whitened(found.errors, found.covs)))
