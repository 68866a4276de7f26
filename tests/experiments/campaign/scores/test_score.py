"""What a campaign keeps of a run, from thirteen steps and a square room made by hand, against plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from experiments.campaign.scores.innovation import InnovationEar
from experiments.campaign.scores.observer import Fate, Moment, Observer
from experiments.campaign.scores.score import offsets, record_of, wall_errors
from experiments.scoring.association import Votes
from experiments.scoring.coverage import alignment
from experiments.scoring.summary import nees_of_poses
from experiments.trial import TrialResult
from slam.estimation.backend import Joint
from slam.geometry.poses import compose, inverse, to_world
from slam.map.chains import OpenEnd
from slam.map.reliability import ReliabilityConfig
from tests.experiments.by_hand import true_map

N = 13
RNG = np.random.default_rng(12)
TRUE = np.column_stack([1.0 + 0.1 * np.arange(N), 1.0 + 0.02 * np.arange(N) ** 1.5, 0.3 * np.arange(N)])
OFF = np.column_stack([0.1 + 0.05 * RNG.normal(size=(N, 2)), 0.03 * RNG.normal(size=N)])
COVS = np.array([np.diag([0.01, 0.02, 0.003]) * (1.0 + 0.1 * k) for k in range(N)])
PATH = np.linspace(0.0, 12.0, N)
START_COV = np.diag([0.01, 0.01, np.deg2rad(2.0) ** 2])


@pytest.fixture
def made(world, make_map, make_chains):
    """A run of so many steps, with the true map off by the start's error."""
    run = true_map(world, make_map, make_chains)
    columns = {
        name: np.repeat(getattr(run.log, name)[:1], N, axis=0)
        for name in ("ranges_m", "odometry", "odometry_cov", "face_of_beam", "open_ends", "tentative", "closed_chains",
                     "set_aside", "seconds", "planning_seconds", "touched", "nis", "nis_dof",
                     "unstated_motion", "is_lost", "wheel_noise_factor")
    }  # fmt: skip
    log = replace(
        run.log, **columns, time_s=np.arange(float(N)), scan_start_s=np.arange(float(N)) - 0.1,
        estimated_world=TRUE + OFF, estimated_cov=COVS, true_world=TRUE,
        path_length_m=PATH, lines=np.arange(N), reasons=("",) * N,
    )  # fmt: skip
    return replace(run, log=log, step=replace(run.step, index=N - 1, path_length_m=12.0))


def result_of(run):
    return TrialResult(run.scenario, run.ending, run.log, run.votes, run.step, run.joint, None, {"world": "square"})


def observer_of(run, **more):
    return Observer(run.votes.truth.walls, lambda index: run.log.face_of_beam[index], **more)


def kept(run, ear=None, **more):
    return record_of(result_of(run), observer_of(run, **more), ear)


def test_a_trial_that_ended_before_its_first_step_keeps_its_summary_alone(made):
    result = replace(result_of(made), log=None, last=None)
    record = record_of(result, observer_of(made), None)
    assert (record.summary, record.arrays) == ({"world": "square"}, {})
    assert record.summary is not result.summary


def motion(before, after):
    return compose(inverse(before), after)


def test_errors_of_the_path_are_those_of_plain_loops(made):
    found = kept(made).summary
    estimated = TRUE + OFF
    assert found["ate_m"] == pytest.approx(np.sqrt(np.mean(np.sum(OFF[:, :2] ** 2, axis=1))))

    def off(moved):
        return np.mean(np.sum((to_world(estimated[:, :2], moved) - TRUE[:, :2]) ** 2, axis=1))

    best = minimize(off, np.zeros(3), tol=1e-14)
    assert found["ate_aligned_m"] == pytest.approx(np.sqrt(best.fun), rel=1e-6)
    parts = [motion(estimated[k], estimated[k + 10]) - motion(TRUE[k], TRUE[k + 10]) for k in range(N - 10)]
    shifts = [np.hypot(*part[:2]) for part in parts]
    turns = [np.angle(np.exp(1j * part[2])) for part in parts]
    assert found["rpe_m"] == pytest.approx(np.sqrt(np.mean(np.square(shifts))))
    assert found["rpe_rad"] == pytest.approx(np.sqrt(np.mean(np.square(turns))))
    assert found["world"] == "square"


def test_the_relative_error_takes_more_than_ten_steps(made):
    def shortened(n):
        names = [name for name, value in vars(made.log).items() if isinstance(value, np.ndarray) and len(value) == N]
        log = replace(made.log, **{name: getattr(made.log, name)[:n] for name in names}, reasons=("",) * n)
        return kept(replace(made, log=log)).summary

    assert (shortened(10)["rpe_m"], shortened(10)["rpe_rad"]) == (None, None)
    assert shortened(11)["rpe_m"] > 0.0


def test_the_trace_is_held_against_that_of_the_start(made):
    start = np.trace(START_COV)
    factors = np.array([1.0, 1.0 - 1e-7, 0.9, 0.5, 2.0] + 8 * [1.5])
    log = replace(made.log, estimated_cov=factors[:, None, None] * START_COV)
    assert np.trace(made.scenario.start_cov) == pytest.approx(start)
    found = kept(replace(made, log=log)).summary
    assert found["trace_least"] == pytest.approx(0.5)
    assert found["trace_below"] == pytest.approx(2 / N), "less than a millionth below is rounding"


def test_the_bound_is_missed_first_and_worst_somewhere(made):
    """The robot stands, so that the bound is the start's own covariance."""
    estimated = np.repeat(TRUE[:1], N, axis=0)
    factors = np.array([1.0, 1.0 - 1e-9, 0.9, 0.4, 0.8, 2.0] + 7 * [1.5])
    log = replace(made.log, estimated_world=estimated, estimated_cov=factors[:, None, None] * START_COV)
    found = kept(replace(made, log=log)).summary
    assert found["bound_margin"] == pytest.approx(-0.6 * START_COV.max() / np.trace(START_COV))
    assert (found["bound_first_m"], found["bound_worst_m"]) == (PATH[2], PATH[3])
    log = replace(log, estimated_cov=np.maximum(factors, 1.0)[:, None, None] * START_COV)
    found = kept(replace(made, log=log)).summary
    assert found["bound_margin"] == pytest.approx(0.0, abs=1e-15)
    assert found["bound_first_m"] is found["bound_worst_m"] is None


def test_the_arrays_of_the_steps_are_what_each_step_knew(made):
    arrays = kept(made).arrays
    np.testing.assert_array_equal(arrays["path_length_m"], PATH)
    np.testing.assert_array_equal(arrays["lines"], np.arange(N))
    np.testing.assert_allclose(arrays["pose_trace"], [cov[0, 0] + cov[1, 1] + cov[2, 2] for cov in COVS])
    np.testing.assert_allclose(arrays["pose_error_m"], np.hypot(*OFF[:, :2].T))
    np.testing.assert_allclose(arrays["heading_error_rad"], np.abs(OFF[:, 2]))
    np.testing.assert_allclose(arrays["heading_sigma_rad"], np.sqrt(0.003 * (1.0 + 0.1 * np.arange(N))))
    np.testing.assert_allclose(arrays["pose_nees"], nees_of_poses(TRUE + OFF, COVS, TRUE))
    turned = replace(made.log, estimated_world=TRUE + OFF + [0.0, 0.0, 2.0 * np.pi])
    np.testing.assert_allclose(kept(replace(made, log=turned)).arrays["heading_error_rad"], np.abs(OFF[:, 2]))


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


@pytest.fixture
def truth_faces(made):
    return made.votes.truth.faces


# Distances between corners of which the true ones are known.


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


# Walls.


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


# Marks.


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


# Matches and innovations.


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
