"""What a campaign keeps of a run, from thirteen steps and a square room made by hand, against plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from chainslam.experiments.campaign.scores.innovation import InnovationEar
from chainslam.experiments.campaign.scores.observer import Fate, Moment
from chainslam.experiments.campaign.scores.score import offsets, record_of, wall_errors
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.maps.coverage import alignment
from chainslam.experiments.scoring.summary import nees_of_poses
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.geometry.poses import inverse, to_world
from chainslam.slam.map.chains import OpenEnd
from chainslam.slam.map.reliability import ReliabilityConfig
from tests.experiments.campaign.scores.thirteen_steps import (
    COVS,
    OFF,
    PATH,
    TRUE,
    N,
    kept,
    observer_of,
    result_of,
)


def test_a_trial_that_ended_before_its_first_step_keeps_its_summary_alone(made):
    result = replace(result_of(made), log=None, last=None)
    record = record_of(result, observer_of(made), None)
    assert (record.summary, record.arrays) == ({"world": "square"}, {})
    assert record.summary is not result.summary


def test_the_last_map_and_the_path_are_moved_by_the_start_s_error(made, truth_faces):
    to_true = alignment(made.scenario.start_estimate, TRUE[0])
    ends = (OpenEnd(4, 0, np.zeros(2)), OpenEnd(7, 1, np.zeros(2)))
    chains = (made.step.chains[0], replace(made.step.chains[1], open_ends=ends))
    walls = replace(made.step.map, tentative=np.arange(8) == 5)
    arrays = kept(replace(made, step=replace(made.step, map=walls, chains=chains))).arrays
    np.testing.assert_allclose(arrays["map_ends"], truth_faces, atol=1e-9)
    assert arrays["map_closed"].tolist() == 4 * [True] + 4 * [False]
    assert arrays["map_tentative"].tolist() == [False] * 5 + [True] + 2 * [False]
    np.testing.assert_allclose(arrays["path_estimated"], to_world((TRUE + OFF)[:, :2], to_true))
    np.testing.assert_array_equal(arrays["path_true"], TRUE[:, :2])


def test_all_pairs_of_true_corners_are_measured_once(made, truth_faces):
    arrays = kept(made).arrays
    corners = truth_faces[:, 1]
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8)]
    true = [np.hypot(*(corners[a] - corners[b])) for a, b in pairs]
    assert len(true) == 28
    np.testing.assert_allclose(sorted(arrays["distance_true_m"]), sorted(true))
    # The map is the truth, moved.
    np.testing.assert_allclose(arrays["distance_m"], arrays["distance_true_m"], atol=1e-9)
    # Corners of the room, 5 m apart: two walls across, each 0.01 m and 0.01 rad at 2.5 m.
    side = np.isclose(arrays["distance_true_m"], 5.0)
    assert side.sum() == 4
    np.testing.assert_allclose(arrays["distance_sigma_m"][side], np.sqrt(2 * 1e-4 * (1.0 + 2.5**2)))


def test_a_map_that_is_off_is_measured_as_it_lies(made, make_map):
    back = inverse(alignment(made.scenario.start_estimate, TRUE[0]))
    faces = made.votes.truth.faces.copy()
    faces[1] += [0.3, 0.0]  # the right wall of the room stands too far out
    walls = make_map(to_world(faces, back), np.zeros(3))
    corners = to_world(np.array([[5.3, 0.0], [5.3, 5.0], [0.0, 5.0], [0.0, 0.0]]), back)
    chains = (replace(made.step.chains[0], corners_world=corners),)
    step = replace(made.step, map=walls, chains=chains)
    arrays = kept(replace(made, step=step, joint=walls.belief.joint(walls.ids))).arrays
    found = {(round(t, 2), round(m, 2)) for t, m in zip(arrays["distance_true_m"], arrays["distance_m"], strict=True)}
    assert found == {(5.0, 5.0), (5.0, 5.3), (7.07, round(float(np.hypot(5.0, 5.3)), 2))}


def test_only_corners_of_which_beams_tell_the_walls_are_measured(made):
    votes = Votes(made.votes.truth, dict(made.votes.beams))
    del votes.beams[0]
    assert len(kept(replace(made, votes=votes)).arrays["distance_m"]) == 15, "six corners are left of eight"
    for line in (1, 2, 5):
        del votes.beams[line]
    assert len(kept(replace(made, votes=votes)).arrays["distance_m"]) == 1, "that between walls 6, 7 and 4"
    for run in (replace(made, joint=None), replace(made, votes=Votes(votes.truth))):
        arrays = kept(run).arrays
        assert [len(arrays[f"distance_{name}"]) for name in ("m", "sigma_m", "true_m")] == [0, 0, 0]


def test_wall_errors_are_those_of_the_ends_and_of_the_best_small_motion(made, make_map):
    off = np.array([0.02, -0.01, 0.004])
    faces = made.votes.truth.faces
    noise = 0.001 * np.random.default_rng(3).normal(size=faces.shape)
    walls = make_map(to_world(faces, off) + noise, np.zeros(3))
    among = np.isin(np.arange(8), [0, 1, 2, 4, 5])
    to_true = np.array([0.1, 0.0, 0.0])
    ends = walls.ends_world[among] + to_true[:2]

    def rms(shift_x, shift_y, turn):
        across = []
        for wall, (a, b) in zip(ends, faces[among], strict=True):
            along = (b - a) / np.hypot(*(b - a))
            n = np.array([along[1], -along[0]])
            for end in wall:
                moved = end + np.array([shift_x - turn * end[1], shift_y + turn * end[0]])
                across.append(n @ (moved - a))
        return np.sqrt(np.mean(np.square(across)))

    found = wall_errors(walls, made.votes, among, to_true)
    best = minimize(lambda motion: rms(*motion) ** 2, np.zeros(3), tol=1e-16)
    assert found == pytest.approx((rms(0.0, 0.0, 0.0), np.sqrt(best.fun)), rel=1e-6)
    assert found[1] < 0.002 < 0.05 < found[0]
    assert wall_errors(walls, made.votes, among & False, to_true) == (None, None)


def test_offsets_of_points_on_their_lines_are_nothing():
    lines = np.array([[0.0, 1.0], [np.pi / 2, 2.0]])
    points = np.array([[[1.0, 0.0], [1.0, 5.0]], [[0.0, 2.0], [3.0, 2.0]]])
    assert offsets(points, lines) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert offsets(points + np.array([0.3, 0.0]), lines) == pytest.approx((0.3 / np.sqrt(2.0), 0.0), abs=1e-9)


def moment(run, index, **changes):
    return Moment(index, float(PATH[index]), replace(run.step.map, **changes), run.joint)


def test_a_mark_has_the_scores_of_its_own_step_and_map(made):
    walls = replace(made.step.map, tentative=np.arange(8) == 0)
    at = Moment(4, 4.0, walls, made.joint)
    found = kept(made, marks={10.0: at}).summary["marks"]
    assert list(found) == ["10", "end"]
    row, values = found["10"], nees_of_poses(TRUE + OFF, COVS, TRUE)
    assert (row["step"], row["path_length_m"], row["lines"]) == (4, 4.0, 8)
    assert row["pose_error_m"] == pytest.approx(np.hypot(*OFF[4, :2]))
    assert row["heading_error_rad"] == pytest.approx(abs(OFF[4, 2]))
    assert row["pose_nees"] == pytest.approx(values[4])
    assert row["pose_anees_so_far"] == pytest.approx(np.mean(values[:5]) / 3.0)
    assert row["pose_trace"] == pytest.approx(np.trace(COVS[4]))
    assert row["coverage"] == pytest.approx(1.0 - 5.0 / 22.4, abs=1e-3)
    assert row["wall_rmse_m"] == pytest.approx(0.0, abs=1e-9)
    assert (row["duplicate_lines"], found["end"]["step"], found["end"]["path_length_m"]) == (0, N - 1, 12.0)
    assert found["end"]["coverage"] == 1.0
    # The walls of that step's map, and with the pose of that step.
    assert [row["map_anees"], found["end"]["map_anees"]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert row["joint_anees"] != pytest.approx(found["end"]["joint_anees"])


def test_the_scores_of_the_map_are_of_firm_walls_with_a_label(made, make_map):
    back = inverse(alignment(made.scenario.start_estimate, TRUE[0]))
    faces = made.votes.truth.faces.copy()
    faces[0] += [0.0, -0.2]
    walls = make_map(to_world(faces, back), np.zeros(3))
    run = replace(made, step=replace(made.step, map=walls), joint=walls.belief.joint(walls.ids))
    whole = kept(run).summary
    assert whole["wall_rmse_m"] == pytest.approx(0.2 / np.sqrt(8))
    assert whole["wall_shape_m"] < whole["wall_rmse_m"]
    for key in ("wall_rmse_m", "wall_shape_m", "joint_anees"):
        assert whole[key] == whole["marks"]["end"][key] is not None
    firm = replace(run, step=replace(run.step, map=replace(walls, tentative=np.arange(8) == 0)))
    assert kept(firm).summary["wall_rmse_m"] == pytest.approx(0.0, abs=1e-9)
    votes = Votes(run.votes.truth, {line: beams for line, beams in run.votes.beams.items() if line})
    unlabelled = kept(replace(run, votes=votes)).summary
    assert unlabelled["wall_rmse_m"] == pytest.approx(0.0, abs=1e-9)
    assert unlabelled["marks"]["end"]["map_anees"] < whole["marks"]["end"]["map_anees"]
    twice = {**run.votes.beams, 1: run.votes.beams[0]}
    assert kept(replace(run, votes=Votes(run.votes.truth, twice))).summary["marks"]["end"]["duplicate_lines"] == 0


def test_where_a_covariance_is_none_a_mark_has_no_nees(made):
    covs = COVS.copy()
    covs[3, 0, 0] = -1.0
    run = replace(made, log=replace(made.log, estimated_cov=covs))
    marks = {10.0: moment(made, 2), 20.0: moment(made, 3), 33.0: moment(made, 4)}
    found = kept(run, marks=marks).summary["marks"]
    assert [found[key]["pose_nees"] is None for key in ("10", "20", "33")] == [False, True, False]
    assert [found[key]["pose_anees_so_far"] is None for key in ("10", "20", "33")] == [False, True, True]
    flat = Joint(made.joint.mean, -made.joint.cov, made.joint.anchors)
    assert kept(replace(made, joint=flat)).summary["joint_anees"] is None


def test_the_curve_of_coverage_ends_where_the_run_does(made):
    marks = [moment(made, k, tentative=np.arange(8) >= k) for k in (0, 4, N - 1)]
    arrays = kept(made, moments=marks).arrays
    np.testing.assert_allclose(arrays["coverage_path_m"], [0.0, 4.0, 12.0])
    np.testing.assert_allclose(arrays["coverage"], [0.0, 20.0 / 22.4, 1.0], atol=1e-3)


def test_segments_are_counted_by_what_became_of_them(made):
    fates = [Fate(1, True, 1, ()), Fate(1, True, 2, ()), Fate(-1, False, 3, (3,)), Fate(-1, False, 3, (4,))]
    found = kept(made, fates=fates).summary
    assert (found["matches_true"], found["matches_false"], found["matches_missed"]) == (1, 1, 1)


def test_the_innovations_of_a_run_are_averaged_over_their_dimensions(made):
    ear = InnovationEar(ReliabilityConfig(), values=[3.0, 8.0], dofs=[2, 6])
    record = kept(made, ear)
    assert record.summary["nis_mean"] == pytest.approx(11.0 / 8.0)
    assert record.summary["nis_whiteness"] is None
    assert (record.arrays["nis"].tolist(), record.arrays["nis_dof"].tolist()) == ([3.0, 8.0], [2, 6])
    ear._pairs = [np.array([[1.0, 0.0], [1.0, 0.0]])]
    assert kept(made, ear).summary["nis_whiteness"] == 1.0
    for deaf in (None, InnovationEar(ReliabilityConfig())):
        record = kept(made, deaf)
        assert record.summary["nis_mean"] is record.summary["nis_whiteness"] is None
        assert not {"nis", "nis_dof"} & record.arrays.keys()
