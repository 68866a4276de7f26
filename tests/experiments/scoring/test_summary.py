"""Every number in summary.json, from three steps and a few walls made by hand, against plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.optimize import approx_fprime
from scipy.stats import chi2

from chainslam.experiments.scoring.maps.coverage import alignment
from chainslam.experiments.scoring.maps.swept import SOON
from chainslam.experiments.scoring.records import Sketch
from chainslam.experiments.scoring.summary import Ending, nees_of_poses, pose_nees_from_start
from chainslam.explore.goal import GivenUp, SetAside
from chainslam.explore.outcome import Outcome
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.map.chains import OpenEnd
from tests.experiments.by_hand import COVS, OFF, TRUE, log_of, marked, xi_of


def without_noise(run):
    return replace(run, scenario=replace(run.scenario, config=replace(run.scenario.config, errorless=True)))


def test_a_summary_says_which_run_it_was(run):
    config = replace(run.scenario.config, backend="graph", strategy="same-chain", seed=9)
    found = replace(run, scenario=replace(run.scenario, config=config)).summary()
    assert {key: found[key] for key in ("world", "backend", "strategy", "seed", "p0", "errorless")} == {
        "world": "square", "backend": "graph", "strategy": "same-chain", "seed": 9, "p0": "large", "errorless": False,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("outcome", "status", "code"),
    [
        (Outcome.ALL_CLOSED, "complete", 0),
        (Outcome.NONE_REACHABLE, "complete", 0),
        (Outcome.ENDS_LEFT, "stopped", 0),
        (Outcome.STEP_LIMIT, "stopped", 0),
        (Outcome.INTERRUPTED, "stopped", 130),
        (Outcome.FAILED, "failed", 1),
    ],
)
def test_a_summary_says_how_the_run_ended(run, outcome, status, code):
    ending = Ending(outcome, "in these words")
    found = replace(run, ending=ending).summary()
    assert (found["status"], found["outcome"], found["reason"]) == (status, str(outcome), "in these words")
    assert ending.exit_status == code


def test_what_the_robot_did_is_taken_from_its_record_and_its_last_step(run):
    record = run.scenario.robot.record
    record.collisions, record.drive_time_s, record.path_length_m = 2, 7.5, 0.375
    gone, aside = (SetAside(wall, 1, np.array([2.0, 3.0]), "too narrow") for wall in (99, 6))
    closed, opened = run.step.chains
    chains = (closed, replace(opened, open_ends=(OpenEnd(6, 1, aside.position_world),)))
    decision = replace(run.step.decision, given_up=GivenUp((gone, aside)))
    found = replace(run, step=replace(run.step, chains=chains, decision=decision)).summary()
    assert (found["steps"], found["path_length_m"], found["path_length_true_m"]) == (3, 0.25, 0.375)
    assert (found["collisions"], found["drive_time_s"], found["open_ends"]) == (2, 7.5, 4)
    assert (found["chains_closed"], found["chains_open"]) == (1, 1)
    assert found["set_aside"] == [{"wall": 6, "side": 1, "position_m": [2.0, 3.0], "why": "too narrow"}]
    assert found["return_to_start"] is None


@pytest.mark.parametrize(("back_m", "reached"), [(0.19, True), (0.21, False)])
def test_the_way_back_to_the_start_is_measured_as_believed_and_as_it_was(run, back_m, reached):
    mission = replace(run.scenario.config.mission, return_to_start=True)
    scenario = replace(run.scenario, config=replace(run.scenario.config, mission=mission))
    estimated = np.array([[5.0, 5.0, 0.0], [7.0, 7.0, 0.0], [5.0, 5.0 + back_m, 1.0]])
    found = replace(run, scenario=scenario, log=log_of(estimated)).summary()["return_to_start"]
    assert found["reached"] is reached
    assert found["distance_m"] == pytest.approx(back_m)
    assert found["distance_true_m"] == pytest.approx(np.sqrt(0.2**2 + 0.3**2))


def test_times_are_told_in_milliseconds_by_mean_and_percentiles(run):
    found = run.summary()
    assert found["step_ms"] == pytest.approx({"mean": 3.0, "p50": 2.0, "p95": 5.6, "max": 6.0})
    assert found["planning_ms"] == pytest.approx({"mean": 0.3, "p50": 0.3, "p95": 0.48, "max": 0.5})


def test_the_errors_of_the_path_are_root_mean_squares_with_nothing_taken_away(run):
    found = run.summary()
    assert found["pose_rmse_m"] == pytest.approx(np.sqrt((0.25 + 0.0 + 0.36) / 3))
    assert found["heading_rmse_rad"] == pytest.approx(np.sqrt((0.01 + 0.01 + 0.04) / 3))


def test_a_heading_that_is_off_by_a_turn_is_not_off(run):
    turned = TRUE + OFF + [[0.0, 0.0, 2.0 * np.pi]]
    found = replace(run, log=log_of(turned)).summary()
    assert found["heading_rmse_rad"] == pytest.approx(np.sqrt(0.06 / 3))


def test_the_wheels_alone_go_from_the_true_start_on(run):
    """Both motions lead 0.1 m ahead: to (1.1, 1) and (1.2, 1), which the truth leaves by 0.5 and 0.3 m."""
    found = run.summary()
    assert found["odometry_rmse_m"] == pytest.approx(np.sqrt((0.25 + 0.09) / 3))
    assert found["odometry_max_m"] == pytest.approx(0.5)
    assert found["odometry_end_m"] == pytest.approx(0.3)


def nees_of(estimated, true, cov):
    """The covariance moves with the derivative of the error where it is zero."""
    jacobian = approx_fprime(estimated, lambda pose: xi_of(pose, estimated), 1e-7)
    xi = xi_of(estimated, true)
    return xi @ np.linalg.solve(jacobian @ cov @ jacobian.T, xi)


def test_the_nees_of_poses_is_that_of_the_logarithm_of_matrices(run):
    values = [nees_of(*rows) for rows in zip(TRUE + OFF, TRUE, COVS, strict=True)]
    found = run.summary()
    assert found["pose_anees"] == pytest.approx(np.mean(values) / 3.0, rel=1e-4)
    low, high = chi2.ppf([0.025, 0.975], 3)
    inside = [low <= value <= high for value in values]
    assert inside == [False, False, True], "expected values on both sides of the band and in it"
    assert [value < low for value in values] == [False, True, False]
    assert found["pose_nees_in_band"] == pytest.approx(1 / 3)


def test_the_score_from_the_start_is_that_of_the_pose_told_beside_the_estimate(run):
    """The estimate as it would be had the start been known has poses and covariances of its own."""
    other, covs = TRUE + 0.5 * OFF, 2.0 * COVS
    log = log_of(from_start_world=other, from_start_cov=covs)
    values = [nees_of(*rows) for rows in zip(other, TRUE, covs, strict=True)]
    found = replace(run, log=log).summary()
    assert found["pose_anees_from_start"] == pytest.approx(np.mean(values) / 3.0, rel=1e-4)
    assert found["pose_anees"] == pytest.approx(run.summary()["pose_anees"])
    np.testing.assert_allclose(pose_nees_from_start(log), values, rtol=1e-4)  # "pose_nees_from_start" of steps.csv
    covs = covs.copy()
    covs[1] = np.nan
    lacking = replace(run, log=log_of(from_start_world=other, from_start_cov=covs)).summary()
    assert lacking["pose_anees_from_start"] is None


def test_one_covariance_that_is_none_leaves_no_mean_and_spoils_no_other_step(run):
    covs = COVS.copy()
    covs[1, 0, 0] = -1.0
    found = replace(run, log=log_of(estimated_cov=covs)).summary()
    assert found["pose_anees"] is found["pose_nees_in_band"] is None
    values = nees_of_poses(TRUE + OFF, covs, TRUE)
    assert np.isnan(values).tolist() == [False, True, False]
    assert values[2] == pytest.approx(nees_of(TRUE[2] + OFF[2], TRUE[2], COVS[2]), rel=1e-4)


def test_without_noise_there_is_no_nees(run):
    found = without_noise(run).summary()
    nees = ("pose_anees", "pose_anees_from_start", "pose_nees_in_band", "map_anees", "map_anees_straight")
    assert [found[key] for key in nees] == 5 * [None]
    assert found["pose_rmse_m"] > 0.0


def test_lines_are_counted_by_kind(run):
    marked_run = marked(run, tentative=[1, 2, 3], crooked=[3, 4])
    for line in (3, 6, 7):
        del marked_run.votes.beams[line]
    found = marked_run.summary()
    assert (found["lines"], found["lines_tentative"], found["lines_crooked"]) == (8, 3, 2)
    assert found["lines_unlabelled"] == 2, "a tentative line is not expected to have a label"


def test_the_true_map_in_the_frame_of_the_start_is_whole(run):
    found = run.summary()
    assert (found["coverage"], found["coverage_own_frame"], found["map_began_step"]) == (1.0, 1.0, 0)
    assert (found["contours_closed"], found["contours_reachable"]) == (2, 2)
    assert found["duplicate_lines"] == found["false_matches"] == found["merges"] == found["false_merges"] == 0
    assert found["distances"]["A-B"]["mapped_m"] == pytest.approx(5.0)
    assert found["distances"]["A-B"]["true_m"] == 5.0


def test_the_curve_of_coverage_is_that_of_each_sketch_in_the_frame_of_the_start(run):
    whole = run.step.map.ends_world
    sketches = (Sketch(0.0, whole[:0]), Sketch(1.2, whole[:1]), Sketch(2.5, whole))
    curve = replace(run, sketches=sketches).summary()["coverage_curve"]
    assert curve["path_length_m"] == [0.0, 1.2, 2.5]
    assert curve["coverage"] == pytest.approx([0.0, 5.0 / 22.4, 1.0], abs=1e-3)


@pytest.mark.parametrize(
    ("errorless", "off_m", "covered"),
    [(False, 0.29, True), (False, 0.31, False), (True, 0.09, True), (True, 0.11, False)],
)
def test_a_wall_covers_what_is_near_to_it_nearer_without_noise(run, truth, make_map, errorless, off_m, covered):
    """Of the outer wall of 5 m one side is mapped, so far outside."""
    alpha = through(truth.faces[:1])[0, 0]
    back = inverse(alignment(run.scenario.start_estimate, TRUE[0]))
    side = truth.faces[:1] + off_m * np.array([np.cos(alpha), np.sin(alpha)])
    walls = make_map(to_world(side, back), np.zeros(3))
    changed = replace(run, step=replace(run.step, map=walls, chains=()), joint=None)
    found = (without_noise(changed) if errorless else changed).summary()
    assert found["coverage"] == pytest.approx(5.0 / 22.4 if covered else 0.0, abs=1e-3)


def test_a_tentative_wall_covers_nothing(run):
    found = marked(run, tentative=[0]).summary()
    assert found["coverage"] == found["coverage_own_frame"] == pytest.approx(1.0 - 5.0 / 22.4, abs=1e-3)


def test_a_map_that_began_late_is_also_held_against_the_truth_in_its_own_frame(run, truth, make_map):
    """It is off by what the last pose is off, which no later scan can tell."""
    lost = compose(TRUE[2] + OFF[2], inverse(TRUE[2]))
    walls = make_map(to_world(truth.faces, lost), np.zeros(3))
    log = log_of(lines=np.array([2, 0, 8]))
    found = replace(run, log=log, step=replace(run.step, map=walls)).summary()
    assert found["map_began_step"] == 2
    assert found["coverage_own_frame"] == 1.0
    assert found["coverage"] < 0.6
    assert found["contours_closed"] == 2


def test_swept_is_the_share_of_the_floor_within_half_a_metre_of_the_path(run):
    """Three circles of radius 0.5 m, of the 25 - 0.36 m2 that can be seen; the pillar is out of reach."""
    circles = shapely.union_all([shapely.Point(pose[:2]).buffer(0.5, quad_segs=64) for pose in TRUE])
    assert run.summary()["swept"] == pytest.approx(circles.area / (25.0 - 0.36), rel=0.01)


def test_what_was_matched_and_merged_wrongly_is_counted(run, truth):
    run.votes.fused += [(0, int(truth.walls[1])), (0, int(truth.walls[0])), (1, int(truth.walls[0])), (2, -1)]
    run.votes.merges, run.votes.false_merges = 5, 3
    run.votes.fused_of_few_beams += [(2, int(truth.walls[1]))]
    found = run.summary()
    assert (found["false_matches"], found["false_matches_few_beams"]) == (3, 1)
    assert (found["merges"], found["false_merges"]) == (5, 3)


def test_a_wall_that_is_mapped_twice_is_counted_once_beyond_the_first(run, truth, make_map):
    back = inverse(alignment(run.scenario.start_estimate, TRUE[0]))
    faces = to_world(np.concatenate([truth.faces, truth.faces[:2]]), back)
    run.votes.beams |= {8: run.votes.beams[0], 9: run.votes.beams[1]}
    twice = replace(run, step=replace(run.step, map=make_map(faces, np.zeros(3))), joint=None)
    assert twice.summary()["duplicate_lines"] == 2
    assert marked(twice, tentative=[9]).summary()["duplicate_lines"] == 1


def test_the_distance_of_two_names_has_the_deviation_of_the_walls_along_it(run, make_map, make_chains, truth):
    """A and B are the ends of one side: only the two walls across it move them along it, each by its own sigma."""
    walls = make_map(truth.faces, np.zeros(3), cov_line=1e-4)
    scenario = replace(run.scenario, start_estimate=TRUE[0])
    step = replace(run.step, map=walls, chains=make_chains(truth.faces, truth.rings))
    straight = replace(run, scenario=scenario, step=step, joint=walls.belief.joint(walls.ids))
    found = straight.summary()["distances"]["A-B"]
    # Each wall is known at its middle, 2.5 m from the corner, and turns about it by its own alpha.
    assert found["sigma_m"] == pytest.approx(np.sqrt(2 * 1e-4 * (1.0 + 2.5**2)))
    assert replace(straight, joint=None).summary()["distances"]["A-B"]["sigma_m"] is None


def test_how_soon_the_floor_is_seen_is_on_the_clock_and_the_path_of_the_log(run):
    """Scans without a return show all within 4 m: 86, 97 and 100 % of the square after each."""
    assert {run.summary()[key] for key in SOON} == {None}
    true = np.array([[1.0, 1.0, 0.0], [2.5, 1.0, 0.0], [4.0, 4.0, 0.0]])
    found = replace(run, log=log_of(true_world=true, ranges_m=np.full((3, 36), np.inf))).summary()
    assert [found[key] for key in SOON] == [1.0, 0.1, 2, 2.0, 0.25, 3]
    assert found["swept"] == pytest.approx(1.0, abs=1e-3)
