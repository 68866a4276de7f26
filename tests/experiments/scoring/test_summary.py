"""Every number in summary.json, from three steps and a few walls made by hand, against plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.linalg import logm
from scipy.optimize import approx_fprime, least_squares
from scipy.stats import chi2

from experiments.scoring.coverage import alignment
from experiments.scoring.records import Sketch
from experiments.scoring.summary import Ending, joint_anees, map_error, map_scores, nees_of_poses
from experiments.scoring.truth import truth_of
from explore.goal import GivenUp, SetAside
from explore.outcome import Outcome
from sim.robot import RobotConfig
from slam.estimation.backend import Joint
from slam.geometry.lines import through
from slam.geometry.poses import compose, inverse, to_world
from slam.map.chains import OpenEnd
from tests.experiments.by_hand import COVS, OFF, TRUE, log_of, true_map


@pytest.fixture
def truth(world):
    return truth_of(world, RobotConfig())


@pytest.fixture
def run(world, make_map, make_chains):
    return true_map(world, make_map, make_chains)


def without_noise(run):
    return replace(run, scenario=replace(run.scenario, config=replace(run.scenario.config, errorless=True)))


def marked(run, **marks):
    """The run with some walls marked as tentative or crooked."""
    walls = run.step.map
    rows = {name: np.isin(np.arange(len(walls)), which) for name, which in marks.items()}
    return replace(run, step=replace(run.step, map=replace(walls, **rows)))


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
        (Outcome.ENDS_LEFT, "complete", 0),
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


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def xi_of(estimated, true):
    """The error of a pose by the logarithm of matrices: X_est = Exp(xi) X_true."""
    log = np.real(logm(matrix(estimated) @ np.linalg.inv(matrix(true))))
    return np.array([log[0, 2], log[1, 2], log[1, 0]])


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
    nees = ("pose_anees", "pose_nees_in_band", "map_anees", "map_anees_straight")
    assert [found[key] for key in nees] == 4 * [None]
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
    found = run.summary()
    assert (found["false_matches"], found["merges"], found["false_merges"]) == (2, 5, 3)


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


# The joint NEES of the walls.

LINES = 4


def joint_of(truth, rng, lines=LINES):
    """A pose and lines a little off the truth, with a full covariance."""
    faces = truth.faces[:lines]
    anchors = faces.mean(axis=1) + rng.normal(size=(lines, 2))
    pose = TRUE[2] + rng.normal(size=3) * [0.1, 0.1, 0.02]
    n = np.column_stack([np.cos(truth.lines[:lines, 0]), np.sin(truth.lines[:lines, 0])])
    means = np.column_stack([truth.lines[:lines, 0], truth.lines[:lines, 1] - np.sum(n * anchors, axis=1)])
    means += rng.normal(size=means.shape) * 0.02
    root = rng.normal(size=(3 + 2 * lines, 3 + 2 * lines)) * 0.05
    return Joint(np.concatenate([pose, means.ravel()]), root @ root.T + 1e-3 * np.eye(3 + 2 * lines), anchors)


def errors_of(mean, anchors, pose_true, lines_true):
    """The errors as docs/estimation.md states them, line by line: undo the motion of the pose, then compare."""
    motion = np.linalg.inv(matrix(mean[:3]) @ np.linalg.inv(matrix(pose_true)))
    errors = list(xi_of(mean[:3], pose_true))
    for k, (alpha, d) in enumerate(mean[3:].reshape(-1, 2)):
        foot = anchors[k] + d * np.array([np.cos(alpha), np.sin(alpha)])
        moved, anchor = ((motion @ [*point, 1.0])[:2] for point in (foot, anchors[k]))
        turned = alpha + np.arctan2(motion[1, 0], motion[0, 0])
        own = np.array([np.cos(turned), np.sin(turned)]) @ (moved - anchor)
        true_n = np.array([np.cos(lines_true[k, 0]), np.sin(lines_true[k, 0])])
        errors += [np.angle(np.exp(1j * (turned - lines_true[k, 0]))), own - (lines_true[k, 1] - true_n @ anchor)]
    return np.array(errors)


def left_by(motion, joint, truth, rows):
    """Errors (alpha, d) of the walls once a motion has carried the true ones, by two points of each."""
    errors = []
    for row in rows:
        carried = (matrix(motion) @ np.column_stack([truth.faces[row], np.ones(2)]).T).T[:, :2]
        along = carried[1] - carried[0]
        n = np.array([along[1], -along[0]]) / np.hypot(*along)
        alpha, d = joint.mean[3 + 2 * row : 5 + 2 * row]
        errors += [np.angle(np.exp(1j * (alpha - np.arctan2(n[1], n[0])))), d - n @ (carried[0] - joint.anchors[row])]
    keep = [3 + 2 * row + k for row in rows for k in (0, 1)]
    return np.linalg.solve(np.linalg.cholesky(joint.cov[np.ix_(keep, keep)]), errors)


def expected_shape(joint, truth, rows):
    """Return what the best motion leaves over its degrees of freedom, and that motion."""
    found = least_squares(left_by, np.zeros(3), "3-point", args=(joint, truth, rows), ftol=1e-14, xtol=1e-14)
    told = np.linalg.matrix_rank(found.jac, 1e-6)  # parallel walls do not tell a shift along them
    return 2.0 * found.cost / (2 * len(rows) - told), found.x


def expected_anees(joint, truth, rows):
    lines = truth.lines[: len(joint.anchors)]
    alpha = joint.mean[3::2]
    n = np.column_stack([np.cos(alpha), np.sin(alpha)])
    lines_there = np.column_stack([alpha, joint.mean[4::2] + np.sum(n * joint.anchors, axis=1)])
    jacobian = approx_fprime(joint.mean, lambda mean: errors_of(mean, joint.anchors, joint.mean[:3], lines_there), 1e-7)
    error = errors_of(joint.mean, joint.anchors, TRUE[2], lines)
    keep = [0, 1, 2] + [3 + 2 * row + k for row in rows for k in (0, 1)]
    cov = (jacobian @ joint.cov @ jacobian.T)[np.ix_(keep, keep)]
    return error[keep] @ np.linalg.solve(cov, error[keep]) / len(keep)


@pytest.mark.parametrize("rows", [[0, 1, 2, 3], [1, 3], [2]])
def test_the_nees_of_pose_and_walls_is_that_of_its_definition_over_its_dimension(run, truth, rows):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    found = joint_anees(run.votes, ids, joint, TRUE[2], np.isin(ids, rows))
    assert found == pytest.approx(expected_anees(joint, truth, rows), rel=1e-4)


@pytest.mark.parametrize("rows", [[0, 1, 2, 3], [1, 2, 3], [0, 1]])
def test_the_nees_of_the_map_is_what_no_common_motion_takes_away(run, truth, rows):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    found = map_scores(map_error(run.votes, ids, joint, np.isin(ids, rows)))
    anees, motion = expected_shape(joint, truth, rows)
    assert found["map_anees"] == pytest.approx(anees, rel=1e-4)
    assert found["map_frame_rad"] == pytest.approx(abs(motion[2]), abs=1e-4)
    middle = joint.anchors[rows].mean(axis=0)
    back = np.linalg.inv(matrix(motion)) @ [*middle, 1.0]
    assert found["map_frame_m"] == pytest.approx(np.hypot(*(back[:2] - middle)), abs=1e-4)
    # Near the best motion the squared errors grow as the frame's information: by differences of the whitened errors.
    xi, step = xi_of(motion, np.zeros(3)), 1e-5
    turned = [matrix(sign * step * axis) @ matrix(motion) for axis in np.eye(3) for sign in (1, -1)]
    sides = [left_by([*t[:2, 2], np.arctan2(t[1, 0], t[0, 0])], joint, truth, rows) for t in turned]
    by_frame = np.column_stack([(sides[2 * k] - sides[2 * k + 1]) / (2 * step) for k in range(3)])
    assert found["map_frame_anees"] == pytest.approx(np.sum((by_frame @ xi) ** 2) / 3, rel=1e-4)


def test_a_robot_lost_at_the_end_does_not_spoil_the_score_of_its_map(run, truth):
    joint, ids = joint_of(truth, np.random.default_rng(5)), np.arange(LINES)
    lost = replace(joint, mean=joint.mean + 0.9 * (np.arange(len(joint.mean)) == 2))
    every = np.ones(LINES, bool)
    found, expected = (map_scores(map_error(run.votes, ids, each, every)) for each in (lost, joint))
    assert found == expected


def test_crooked_walls_are_in_one_score_of_the_map_and_tentative_or_unlabelled_ones_in_none(run, truth, make_map):
    joint = joint_of(truth, np.random.default_rng(6))
    walls = make_map(truth.faces[:LINES], np.zeros(3))
    small = replace(run, step=replace(run.step, map=walls, chains=()), joint=joint)
    found = marked(small, crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [0, 1, 2, 3])[0], rel=1e-4)
    assert found["map_anees_straight"] == pytest.approx(expected_shape(joint, truth, [0, 2, 3])[0], rel=1e-4)
    found = marked(small, tentative=[0], crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [1, 2, 3])[0], rel=1e-4)
    del small.votes.beams[3]
    found = marked(small, crooked=[1]).summary()
    assert found["map_anees"] == pytest.approx(expected_shape(joint, truth, [0, 1, 2])[0], rel=1e-4)
    assert found["map_anees_straight"] == pytest.approx(expected_shape(joint, truth, [0, 2])[0], rel=1e-4)


def test_without_a_wall_or_a_covariance_the_map_has_no_nees(run, truth):
    joint, ids = joint_of(truth, np.random.default_rng(7)), np.arange(LINES)
    every = np.ones(LINES, bool)
    nothing = dict.fromkeys(("map_anees", "map_frame_anees", "map_frame_m", "map_frame_rad"))
    assert map_scores(map_error(run.votes, ids, None, every)) == nothing
    assert map_error(run.votes, ids, joint, ~every) is joint_anees(run.votes, ids, joint, TRUE[2], ~every) is None
    assert joint_anees(run.votes, ids, None, TRUE[2], every) is None
    assert map_scores(map_error(run.votes, ids, joint, ids == 1))["map_anees"] is None
    flat = replace(joint, cov=-joint.cov)
    assert map_error(run.votes, ids, flat, every) is joint_anees(run.votes, ids, flat, TRUE[2], every) is None
