"""Which walls carry a map's error: what is told of one short run, and how a table shows it."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.scenario import TrialConfig
from experiments.scoring.summary import map_error
from experiments.trial import run_trial
from slam.geometry.lines import lines_to_world
from studies.exploration.map_causes import (
    causes,
    other_faces,
    shares_of_one_wall,
    stated_beside,
    table,
    table_of_worst,
    worst,
)


@cache
def figure_4():
    return run_trial(TrialConfig("paper-fig4", "invariant-ekf", seed=1, max_steps=40))


def test_the_share_of_one_wall_counts_all_its_faces():
    truth = SimpleNamespace(walls=np.array([0, 0, 1]))
    votes = SimpleNamespace(truth=truth, beams={3: np.array([4, 2, 2]), 5: np.array([0, 0, 7]), 8: np.zeros(3, int)})
    assert shares_of_one_wall(votes, np.array([3, 5, 8, 9])).tolist() == [0.75, 1.0, 1.0, 1.0]


def test_of_one_run_all_walls_are_scored_as_in_its_summary():
    result = figure_4()
    found = causes(result)
    assert found["map_anees"] == pytest.approx(result.summary["map_anees"])
    assert 0 < found["lines"] >= found["short"]
    told = table([{"world": "paper-fig4"} | found])
    assert next(told.columns[0].cells) == "paper-fig4"
    assert next(told.columns[1].cells) == str(found["lines"])


def test_tentative_walls_are_scored_by_themselves_only():
    """After two scans of figure 9 one wall was seen once."""
    result = run_trial(TrialConfig("paper-fig9", "invariant-ekf", seed=1, max_steps=2))
    found, walls = causes(result), result.last.map
    assert np.count_nonzero(walls.tentative) == 1 == len(walls) - found["lines"]
    every = map_error(result.votes, walls.ids, result.joint, np.ones(len(walls), dtype=bool))
    assert found["with_tentative"] == pytest.approx(every.anees) != pytest.approx(found["map_anees"])


def test_the_walls_left_out_are_those_without_which_the_rest_is_best():
    result = run_trial(TrialConfig("paper-fig9", "invariant-ekf", seed=2, max_steps=60))
    ids, among = result.last.map.ids, ~result.last.map.tentative
    found = worst(result, among)
    assert len(found) == 3
    for wall in found:
        others = [map_error(result.votes, ids, result.joint, among & (ids != each)).anees for each in ids[among]]
        among = among & (ids != wall["wall"])
        rest = map_error(result.votes, ids, result.joint, among)
        assert wall["map_anees_without"] == rest.anees == min(others)


def test_a_wall_that_is_turned_is_the_worst_and_its_error_is_told():
    result = figure_4()
    mean, row = result.joint.mean.copy(), int(np.argmax(np.ptp(result.last.map.extents, axis=1)))
    before = worst(result, ~result.last.map.tentative)
    mean[3 + 2 * row : 5 + 2 * row] += [np.deg2rad(20.0), 0.4]
    turned = replace(result, joint=replace(result.joint, mean=mean))
    first = worst(turned, ~result.last.map.tentative)[0]
    assert first["wall"] == result.last.map.ids[row]
    assert first["off_deg"] == pytest.approx(20.0, abs=1.0)
    assert first["off_mm"] == pytest.approx(400.0, abs=40.0)
    assert first["observations"] == result.last.map.observations[row]
    assert first["length_m"] == pytest.approx(np.ptp(result.last.map.extents[row]))
    assert 0.0 < first["off_sigma_deg"] < 2.0
    shown = table_of_worst([{"world": "paper-fig4", "worst": before}])
    assert list(shown.columns[0].cells) == ["paper-fig4"] * 3


def test_where_the_frame_lies_is_no_error_of_a_wall():
    result = figure_4()
    truth, among = result.votes.truth, ~result.last.map.tentative
    elsewhere = replace(truth, lines=lines_to_world(truth.lines, np.array([0.3, -0.2, 0.4])))
    before, moved = worst(result, among), worst(replace(result, votes=replace(result.votes, truth=elsewhere)), among)
    for there, here in zip(moved, before, strict=True):
        told = [{key: value for key, value in wall.items() if key != "other_faces"} for wall in (there, here)]
        assert told[0] == pytest.approx(told[1], rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_what_a_wall_states_beside_others_is_how_far_it_is_off_where_they_have_the_frame(seed):
    """Of drawn maps, each moved onto the mean by all walls but the last; however little is known of the frame."""
    rng = np.random.default_rng(seed)
    result = figure_4()
    joint = result.joint
    walls, n = np.arange(5), (len(joint.mean) - 3) // 2
    frames = np.zeros((2 * n, 3))
    alpha = joint.mean[3::2]
    frames[0::2, 2], frames[1::2, 0], frames[1::2, 1] = 1.0, np.cos(alpha), np.sin(alpha)
    frames[1::2, 2] = np.sin(alpha) * joint.anchors[:, 0] - np.cos(alpha) * joint.anchors[:, 1]
    loose = joint.cov.copy()
    loose[3:, 3:] += frames @ np.diag([4.0, 9.0, 0.2]) ** 2 @ frames.T
    stated = stated_beside(joint, 5, walls)
    np.testing.assert_allclose(stated_beside(replace(joint, cov=loose), 5, walls), stated, rtol=1e-4)
    part = joint.take(np.arange(6)).cov[3:, 3:]
    draws = np.linalg.cholesky(part) @ rng.standard_normal((12, 20_000))
    white = np.linalg.inv(np.linalg.cholesky(part[:10, :10]))
    frame = np.linalg.lstsq(white @ frames[:10], white @ draws[:10], rcond=None)[0]
    np.testing.assert_allclose(np.cov(draws[10:] - frames[10:12] @ frame), stated, rtol=0.06, atol=1e-7)


def test_the_faces_beside_the_one_with_most_beams_are_told_by_turn_and_distance():
    faces = np.array([[[0.0, 3.0], [1.0, 3.0]], [[1.0, 3.02], [2.0, 3.02]], [[2.0, 3.0], [2.0, 4.0]]])
    lines = np.array([[-np.pi / 2, -3.0], [-np.pi / 2, -3.02], [0.0, 2.0]])
    votes = SimpleNamespace(truth=SimpleNamespace(faces=faces, lines=lines), beams={4: np.array([50, 30, 20])})
    np.testing.assert_allclose(other_faces(votes, 4), [[0.0, -20.0], [90.0, -500.0]], atol=1e-9)
    votes.beams[4] = np.array([95, 5, 0])
    assert other_faces(votes, 4) == []
