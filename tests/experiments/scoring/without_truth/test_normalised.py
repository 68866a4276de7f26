"""Normalised errors by what others measured: drives past known walls, where the graph knows how wrong it is."""

import numpy as np
import pytest

from chainslam.experiments.scoring.without_truth.normalised import normalised_path, normalised_relations, pair_covs_of
from chainslam.experiments.scoring.without_truth.references import References
from chainslam.experiments.scoring.without_truth.relations import Relations, between
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.axioms.room import Room, see
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import Odometry, ScannerSpec

STEPS, RUNS = 60, 10
START_COV = np.diag([1e-4, 1e-4, 1e-5]) ** 2
ODOMETRY_COV = np.diag([0.01, 0.005, 0.02]) ** 2
ALL = np.arange(STEPS + 1)


def drive(name, seed):
    """Drive past known walls; return the back end, the path as known at each step, its covariances and the truth."""
    rng = np.random.default_rng([7, seed])
    room = Room.random(rng, 14)
    backend, ids = BACKENDS[name].make(np.zeros(3), START_COV), {}
    true, online, covs = [np.zeros(3)], [], []
    for step in ALL:
        if step:
            motion = np.array([0.15, 0.0, 0.1])
            true.append(compose(true[-1], motion + np.linalg.cholesky(ODOMETRY_COV) @ rng.standard_normal(3)))
            backend.predict(Odometry(motion, ODOMETRY_COV))
        rows = (step // 5 + np.arange(4)) % len(room.lines)
        lines, cov, centres = room.seen(true[-1], rows, rng)
        known = np.array([row in ids for row in rows])
        if np.any(known):
            see(backend, np.array([ids[row] for row in rows[known]]), (lines[known], cov[known], centres[known]))
        if not np.all(known):
            ids |= dict(zip(rows[~known], backend.grow(lines[~known], cov[~known], centres[~known]), strict=True))
        online.append(backend.belief.pose_world)
        covs.append(backend.belief.pose_cov)
    return backend, np.array(online), np.array(covs), np.array(true)


def relations_of(true, seed, count=40):
    pairs = np.sort(np.random.default_rng([8, seed]).choice(len(true), (count, 2)), axis=1)
    first, second = pairs[pairs[:, 0] != pairs[:, 1]].T
    return Relations(10.0 * first, 10.0 * second, between(true[first], true[second]))


def mean(scores, part="all", key="anees"):
    return np.mean([score[part][key] for score in scores])


@pytest.fixture(scope="module")
def graphs():
    return [drive("graph", seed) for seed in range(RUNS)]


def of_relations(graphs, scale=1.0):
    scores = []
    for seed, (graph, _, _, true) in enumerate(graphs):
        path, pair_covs = pair_covs_of(graph, ScannerSpec(), ALL)
        relations = relations_of(true, seed)
        scores.append(
            normalised_relations(relations, 10.0 * ALL, path, lambda a, b, covs=pair_covs: scale * covs(a, b))
        )
    return scores


def test_the_graph_knows_how_wrong_its_relations_are(graphs):
    scores = of_relations(graphs)
    assert all(score["all"]["count"] > 30 and 0 < score["far"]["count"] <= score["all"]["count"] for score in scores)
    assert 0.7 < mean(scores) < 1.4
    assert 0.6 < mean(scores, "far", "median") < 1.6
    assert mean(scores, key="in_band") > 0.85
    assert mean(scores, key="stated_m") == pytest.approx(mean(scores, key="error_m"), rel=0.35)
    assert mean(of_relations(graphs, 0.25)) == pytest.approx(4.0 * mean(scores), rel=1e-2)


def test_the_path_of_each_step_is_told_rightly_by_the_graph_and_too_surely_by_the_block_filter(graphs):
    def scores(drives):
        return [
            normalised_path(References(path=(10.0 * ALL, true)), 10.0 * ALL, online, covs)
            for _, online, covs, true in drives
        ]

    rigorous, block = scores(graphs), scores([drive("block-ekf", seed) for seed in range(RUNS)])
    assert rigorous[0]["all"]["count"] == STEPS
    assert 0.6 < mean(rigorous) < 1.6
    assert mean(block) > 3.0 * mean(rigorous)


def test_the_frame_of_the_reference_says_nothing(graphs):
    _, online, covs, true = graphs[0]
    moved = np.array([compose(np.array([4.0, -7.0, 2.5]), pose) for pose in true])
    here, there = (
        normalised_path(References(path=(1.0 * ALL, path)), 1.0 * ALL, online, covs) for path in (true, moved)
    )
    assert here["all"] == pytest.approx(there["all"], rel=1e-6)


def test_an_error_of_the_reference_is_told_by_relations_and_allowed_for(graphs):
    _, online, covs, true = graphs[0]
    rng = np.random.default_rng(9)
    noise = rng.standard_normal(true.shape) * np.array([0.1, 0.1, 0.05])
    wrong = np.array([compose(pose, error) for pose, error in zip(true, noise, strict=True)])
    relations = relations_of(true, 1, 400)
    time_s = 10.0 * ALL
    blind = normalised_path(References(path=(time_s, wrong)), time_s, online, covs)
    told = normalised_path(References(relations, (time_s, wrong)), time_s, online, covs)
    assert blind["measured"]["sigma_m"] is None
    assert told["measured"]["sigma_m"] == pytest.approx(0.1, rel=0.2)
    assert told["measured"]["sigma_rad"] == pytest.approx(0.05, rel=0.2)
    assert told["measured"]["told_by"] + told["measured"]["mistaken"] == np.count_nonzero(relations.far)
    assert blind["all"]["anees"] > 10.0 > 3.0 > told["all"]["anees"]


def test_relations_of_a_body_are_those_of_the_scanner_on_it(graphs):
    """Whatever fixed point of the robot is followed, a relation is off by as many sigma."""
    graph, _, _, true = graphs[0]
    scanner = ScannerSpec(0.4, -0.2, 0.7)
    of_scanner, of_body = (pair_covs_of(graph, spec, ALL) for spec in (ScannerSpec(), scanner))
    body = np.array([compose(pose, inverse(scanner.pose_robot)) for pose in true])
    at_scanner, at_body = (
        normalised_relations(relations_of(path, 0), 10.0 * ALL, *known)
        for path, known in ((true, of_scanner), (body, of_body))
    )
    assert at_body["all"]["anees"] == pytest.approx(at_scanner["all"]["anees"], rel=0.05)
    assert at_body["all"]["error_m"] != pytest.approx(at_scanner["all"]["error_m"], rel=0.01)


def test_nothing_at_the_times_of_poses_leaves_null(graphs):
    graph, online, covs, true = graphs[0]
    late = 10.0 * ALL + 1e6
    relations = normalised_relations(relations_of(true, 0), late, *pair_covs_of(graph, ScannerSpec(), ALL))
    path = normalised_path(References(path=(10.0 * ALL, true)), late, online, covs)
    for score in (relations["all"], relations["far"], path["all"]):
        assert score["count"] == 0
        assert score["anees"] is None
    assert relations["measured"]["sigma_m"] is not None
    assert normalised_path(References(), late, online, covs) is None


def test_the_scan_beside_one_that_is_missing_is_not_taken_for_it(graphs):
    graph, online, covs, true = graphs[0]
    path, pair_covs = pair_covs_of(graph, ScannerSpec(), ALL)
    relations = relations_of(true, 0)
    late = 10.0 * ALL + np.where(ALL % 2, 0.002, 0.0)
    even = np.all(np.stack([relations.first_s, relations.second_s]) % 20.0 == 0.0, axis=0)
    told = normalised_relations(relations, late, path, pair_covs, 0.001)["all"]
    assert 0 < told["count"] == np.count_nonzero(even) < len(even)
    assert normalised_relations(relations, late, path, pair_covs)["all"]["count"] == len(even)
    reference = References(path=(10.0 * ALL, true))
    assert normalised_path(reference, late, online, covs, 0.001)["all"]["count"] == STEPS // 2
