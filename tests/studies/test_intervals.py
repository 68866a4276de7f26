"""Intervals between corners: true corners are those of the drawing, and a right filter's shares are as expected."""

from itertools import combinations

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.maps.corners import corners
from chainslam.experiments.scoring.maps.measurements import Z_95
from chainslam.experiments.trial import run_trial
from studies.consistency import interval_causes, intervals


@pytest.fixture(scope="module")
def result():
    return run_trial(TrialConfig("paper-fig4", "invariant-ekf", seed=3))


def test_true_corners_are_corners_of_the_drawing_and_near_the_mapped_ones(result):
    vertices = result.votes.truth.faces.reshape(-1, 2)
    found = 0
    for corner in corners(result.last.map, result.last.chains):
        at = intervals.true_corner(corner, result)
        if at is not None:
            assert np.hypot(*(vertices - at).T).min() < 1e-6
            assert np.hypot(*(corner.position_world - at)) < 0.2
            found += 1
    assert found >= 6


def test_scores_are_those_of_plain_loops_over_pairs(result):
    row = intervals.scores(result)
    joint = result.last.map.belief.joint(result.last.map.ids)
    known = []
    for corner in corners(result.last.map, result.last.chains):
        at = None if corner.jacobian is None else intervals.true_corner(corner, result)
        if at is not None:
            known.append((corner, at))
    held, z2 = [], []
    for (a, true_a), (b, true_b) in combinations(known, 2):
        if np.hypot(*(true_b - true_a)) > 1e-6:
            way = b.position_world - a.position_world
            gradient = way / np.hypot(*way) @ (b.jacobian - a.jacobian)
            z = (np.hypot(*way) - np.hypot(*(true_b - true_a))) / np.sqrt(gradient @ joint.cov @ gradient)
            held.append(abs(z) <= Z_95)
            z2.append(z**2)
    assert row["pairs"] == len(held)
    assert row["held"] == pytest.approx(np.mean(held))
    assert row["mean_z2"] == pytest.approx(np.mean(z2))


def test_of_a_right_filter_nineteen_in_twenty_hold_and_pairs_are_wrong_together():
    rng = np.random.default_rng(1)
    mapped = rng.uniform(0.0, 10.0, (12, 2))
    pairs = np.argwhere(np.triu(np.ones((12, 12), dtype=bool), 1))
    jacobians = np.eye(24).reshape(12, 2, 24)
    common = np.outer(mapped.ravel(), mapped.ravel())
    shares = {}
    for name, cov in (("apart", 1e-4 * np.eye(24)), ("one scale", 1e-6 * np.eye(24) + 1e-5 * common)):
        way = mapped[pairs[:, 1]] - mapped[pairs[:, 0]]
        C = cov.reshape(12, 2, 12, 2)
        i, j = pairs.T
        spread = C[i, :, i] + C[j, :, j] - C[i, :, j] - C[j, :, i]
        sigmas = np.sqrt(np.einsum("pi,pij,pj->p", way, spread, way)) / np.hypot(*way.T)
        shares[name] = intervals.expected_shares(mapped, jacobians, cov, pairs, sigmas, 1)
        assert np.mean(shares[name]) == pytest.approx(0.95, abs=0.02)
    assert np.std(shares["one scale"]) > 3.0 * np.std(shares["apart"])


def test_the_table_counts_runs_that_their_own_covariance_calls_rare():
    row = {"pairs": 10, "mean_z2": 1.0, "expected_sd": 0.03, "backend": "full-ekf"}
    rows = [row | {"held": 0.95, "rarer": 0.5}, row | {"held": 0.6, "rarer": 0.01}]
    cells = [next(iter(column.cells)) for column in intervals.table(rows).columns]
    assert cells[1] == "2"
    assert cells[5:7] == ["0.600", "1"]
    assert cells[-1] == "0.500"


def test_the_truth_takes_the_place_of_one_stage_after_the_other(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(interval_causes, "replay", lambda run, backend, options: asked.append((backend, options)))
    monkeypatch.setattr(interval_causes, "scores", lambda replayed: {"pairs": 0})
    rows = interval_causes._replays_of("paper-fig4", "invariant-ekf", 3)
    assert [(backend, o.association, o.perfect_extraction, o.perfect_odometry) for backend, o in asked] == [
        ("invariant-ekf", "own", False, False),
        ("invariant-ekf", "true", False, False),
        ("invariant-ekf", "true", True, False),
    ]
    assert [row["stage"] for row in rows] == list(interval_causes.STAGES)
