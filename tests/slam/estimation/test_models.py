"""Every Jacobian against central finite differences; the measurement's noise against fits of simulated beams."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.models import halfway, initialise, innovations, lines_robot, move, stack
from chainslam.slam.extraction.kernels.line_kernels import fit_run, polar, prefix_sums
from chainslam.slam.geometry.lines import lines_to_world
from chainslam.slam.geometry.poses import to_robot, to_world, wrap

seeds = st.integers(0, 2**32)
few = settings(max_examples=20, deadline=None, derandomize=True)
STEP = 1e-6


def normal(alpha):
    return np.array([np.cos(alpha), np.sin(alpha)])


def direction(alpha):
    return np.array([-np.sin(alpha), np.cos(alpha)])


def jacobian(function, at):
    """Return the derivative of `function` (a vector whose first entry is an angle) by central differences."""
    return np.stack([(function(at + d) - function(at - d)) / (2 * STEP) for d in STEP * np.eye(len(at))], axis=-1)


def random_pose(rng):
    return rng.uniform([-20, -20, -3], [20, 20, 3])


def seen_line(rng, off_side=2.0):
    """Return a line of the robot frame, its covariance, and the centre of the seen piece, far off to one side."""
    alpha, r = rng.uniform(-3, 3), rng.uniform(0.2, 4.0)
    t0 = rng.uniform(-off_side, off_side)
    sigma_alpha, sigma_across = rng.uniform(0.002, 0.1), rng.uniform(0.001, 0.02)
    turn = np.array([[1.0, 0.0], [t0, 1.0]])
    cov = turn @ np.diag([sigma_alpha**2, sigma_across**2]) @ turn.T
    return np.array([alpha, r]), cov, r * normal(alpha) + t0 * direction(alpha)


@few
@given(seeds)
def test_the_motion_jacobians_are_the_derivatives_of_the_motion(seed):
    rng = np.random.default_rng(seed)
    pose, motion = random_pose(rng), rng.uniform(-0.5, 0.5, 3)

    def moved(pose, motion):
        reached = move(pose, motion).pose_world
        return np.array([reached[0], reached[1], wrap(reached[2] - reference)])

    reference = move(pose, motion).pose_world[2]
    model = move(pose, motion)
    np.testing.assert_allclose(model.F, jacobian(lambda p: moved(p, motion), pose), atol=1e-7)
    np.testing.assert_allclose(model.W, jacobian(lambda m: moved(pose, m), motion), atol=1e-7)


def innovation_case(rng, epsilon, off_side):
    """Return a pose, and a line seen from it that is turned by `epsilon` from the map's."""
    pose = random_pose(rng)
    line, cov, centre = seen_line(rng, off_side)
    anchor = to_world(centre[None], pose)[0] + rng.uniform(-2, 2, 2)
    alpha = wrap(line[0] + pose[2] - epsilon)
    n = normal(alpha)
    d = line[1] + n @ (pose[:2] - anchor) + rng.uniform(-0.2, 0.2)
    return pose, anchor[None], np.array([[alpha, d]]), line[None], cov[None]


@pytest.mark.parametrize("off_side", [0.1, 4.0])
@pytest.mark.parametrize("epsilon", [0.0, 0.02, -0.3, 1.0, -1.4])
@few
@given(seed=seeds)
def test_the_innovation_jacobians_are_minus_the_derivatives_of_e(epsilon, off_side, seed):
    pose, anchors, means, line, cov = innovation_case(np.random.default_rng(seed), epsilon, off_side)
    model = innovations(pose, anchors, means, line, cov)
    assert model.e[0, 0] == pytest.approx(epsilon, abs=1e-9)
    by_pose = jacobian(lambda p: innovations(p, anchors, means, line, cov).e[0], pose)
    by_line = jacobian(lambda m: innovations(pose, anchors, m[None], line, cov).e[0], means[0])
    np.testing.assert_allclose(model.H_pose[0], -by_pose, atol=1e-7)
    np.testing.assert_allclose(model.H_line[0], -by_line, atol=1e-7)


@few
@given(seed=seeds, slip_rad=st.floats(-0.12, 0.12))
def test_halfway_a_slip_of_the_heading_is_linear_in_what_is_seen(seed, slip_rad):
    """The tangent at the estimate is off by r slip^2 / 2, 29 mm of a line 4 m away."""
    rng = np.random.default_rng(seed)
    pose = random_pose(rng)
    line, cov, centre = seen_line(rng)
    new = initialise(pose, line[None], centre[None])
    slipped = pose - [0.0, 0.0, slip_rad]
    model = innovations(slipped, new.anchors, new.means, line[None], cov[None])
    model = halfway(model, line[None], cov[None], model.e[:, 0])
    np.testing.assert_allclose(model.e[0], model.H_pose[0, :, 2] * slip_rad, atol=abs(slip_rad) ** 3 + 1e-12)
    by_turn = innovations(slipped, new.anchors, new.means, line[None], cov[None])
    kept = halfway(by_turn, line[None], cov[None], np.zeros(1))
    np.testing.assert_allclose(kept.H_pose, by_turn.H_pose, atol=1e-14)
    # A turn of the line and a turn of the robot are one, but that the line turns about its anchor.
    lever = model.H_line[0, 1, 0] + model.H_pose[0, 1, 2]
    assert lever == pytest.approx(by_turn.H_line[0, 1, 0] + by_turn.H_pose[0, 1, 2], abs=1e-12)


@few
@given(seeds)
def test_a_line_seen_where_the_map_has_it_leaves_no_innovation(seed):
    rng = np.random.default_rng(seed)
    pose = random_pose(rng)
    line, cov, centre = seen_line(rng)
    new = initialise(pose, line[None], centre[None])
    model = innovations(pose, new.anchors, new.means, line[None], cov[None])
    np.testing.assert_allclose(model.e, 0.0, atol=1e-12)
    predicted = lines_robot(pose, new.anchors, new.means)[0]
    np.testing.assert_allclose([wrap(predicted[0] - line[0]), predicted[1] - line[1]], 0.0, atol=1e-10)


@few
@given(seeds)
def test_the_innovation_is_the_turn_and_the_offset_of_the_seen_centre(seed):
    """However large the turn: the centre's distance from the predicted line is taken from points, not from r."""
    rng = np.random.default_rng(seed)
    pose, anchors, means, line, cov = innovation_case(rng, rng.uniform(-1.2, 1.2), 3.0)
    t0 = cov[0, 0, 1] / cov[0, 0, 0]
    centre = line[0, 1] * normal(line[0, 0]) + t0 * direction(line[0, 0])
    offset = normal(means[0, 0]) @ (to_world(centre[None], pose)[0] - anchors[0]) - means[0, 1]
    assert innovations(pose, anchors, means, line, cov).e[0, 1] == pytest.approx(offset, abs=1e-10)


@pytest.mark.parametrize("middle", [0.0, 1.5, -2.5])
@pytest.mark.parametrize("epsilon", [0.0, 0.1, -0.1])
def test_the_noise_of_the_innovation_is_that_of_fits_to_noisy_beams(middle, epsilon):
    rng, sigma, r = np.random.default_rng(3), 0.005, 1.8
    bearings = np.arctan2(np.linspace(middle - 0.6, middle + 0.6, 40), r)
    true_ranges = r / np.cos(bearings)
    anchors, means = np.array([[r, 0.0]]), np.array([[-epsilon, 0.0]])
    lines, covs = np.zeros((3000, 2)), np.zeros((3000, 2, 2))
    for k in range(3000):
        ranges = true_ranges + sigma * rng.standard_normal(40)
        sums = prefix_sums(np.cos(bearings), np.sin(bearings), ranges, np.full(len(ranges), sigma))
        alpha, r, alphas, both, rs = polar(fit_run(sums, 0, 40)[0])
        lines[k], covs[k] = (alpha, r), ((alphas, both), (both, rs))
    many = innovations(np.zeros(3), np.repeat(anchors, 3000, 0), np.repeat(means, 3000, 0), lines, covs)
    stated, seen = many.R.mean(axis=0), np.cov(many.e.T)
    scale = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(seen / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.1)


@few
@given(seeds)
def test_what_the_innovation_owes_to_the_measurement_is_r(seed):
    """R = G C G' with G the derivative of e by the seen line, its centre staying on its beam."""
    rng = np.random.default_rng(seed)
    pose, anchors, means, line, cov = innovation_case(rng, rng.uniform(-0.8, 0.8), 2.0)
    t0 = cov[0, 0, 1] / cov[0, 0, 0]
    bearing = line[0, 0] + np.arctan2(t0, line[0, 1])
    beam = np.array([np.cos(bearing), np.sin(bearing)])

    def e(measured):
        distance = measured[1] / (normal(measured[0]) @ beam)
        centre = to_world((distance * beam)[None], pose)[0]
        turn = wrap(measured[0] + pose[2] - means[0, 0])
        return np.array([turn, normal(means[0, 0]) @ (centre - anchors[0]) - means[0, 1]])

    model = innovations(pose, anchors, means, line, cov)
    np.testing.assert_allclose(model.e[0], e(line[0]), atol=1e-10)
    G = jacobian(e, line[0])
    np.testing.assert_allclose(model.R[0], G @ cov[0] @ G.T, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("at_wall", [True, False])
@few
@given(seed=seeds)
def test_the_initialisation_jacobians_are_the_derivatives_about_the_constant_anchor(at_wall, seed):
    rng = np.random.default_rng(seed)
    pose = random_pose(rng)
    line, _, centre = seen_line(rng)
    new = initialise(pose, line[None], centre[None], at_wall)

    def state(pose, line):
        alpha, r = lines_to_world(line[None], pose)[0]
        return np.array([wrap(alpha - new.means[0, 0]), r - normal(alpha) @ new.anchors[0]])

    np.testing.assert_allclose(state(pose, line), [0.0, new.means[0, 1]], atol=1e-10)
    np.testing.assert_allclose(new.G_pose[0], jacobian(lambda p: state(p, line), pose), atol=1e-6)
    np.testing.assert_allclose(new.G_line[0], jacobian(lambda m: state(pose, m), line), atol=1e-6)


@few
@given(seeds)
def test_a_line_anchored_where_it_was_seen_has_no_offset_from_its_anchor(seed):
    rng = np.random.default_rng(seed)
    pose = random_pose(rng)
    line, _, centre = seen_line(rng)
    new = initialise(pose, line[None], centre[None])
    np.testing.assert_allclose(new.means[0, 1], 0.0, atol=1e-10)
    np.testing.assert_allclose(to_robot(new.anchors, pose)[0], centre, atol=1e-10)
    world = initialise(pose, line[None], centre[None], at_wall=False)
    np.testing.assert_allclose(world.means, lines_to_world(line[None], pose), atol=1e-10)


@few
@given(seeds)
def test_moving_the_world_moves_no_innovation(seed):
    rng = np.random.default_rng(seed)
    pose, anchors, means, line, cov = innovation_case(rng, 0.1, 2.0)
    shift, turn = rng.uniform(-100, 100, 2), rng.uniform(-3, 3)
    motion = np.array([shift[0], shift[1], turn])
    moved_pose = np.append(to_world(pose[None, :2], motion)[0], pose[2] + turn)
    moved = innovations(moved_pose, to_world(anchors, motion), means + np.array([turn, 0.0]), line, cov)
    np.testing.assert_allclose(moved.e, innovations(pose, anchors, means, line, cov).e, atol=1e-10)


@pytest.mark.parametrize("rows", [[0, 2, 5], [3, 1], [2, 2, 4, 2], [7], []])
def test_stacked_observations_are_those_of_each_alone_with_a_column_for_each_line(rows):
    """Several observations of one line share its columns; what they differ in is their own noise."""
    rng, m = np.random.default_rng(len(rows)), len(rows)
    pose, means, anchors = random_pose(rng), rng.uniform(-3, 3, (8, 2)), rng.uniform(-9, 9, (8, 2))
    seen = [seen_line(rng) for _ in rows]
    lines, cov = np.array([s[0] for s in seen]).reshape(-1, 2), np.array([s[1] for s in seen]).reshape(-1, 2, 2)
    at = np.array(rows, dtype=np.int64)
    model = innovations(pose, anchors[at], means[at], lines, cov)
    found = stack(at, model)
    assert sorted(found.rows.tolist()) == sorted(set(rows))
    assert found.rows.tolist() == (rows if len(set(rows)) == m else sorted(set(rows)))
    columns = {row: 3 + 2 * k for k, row in enumerate(found.rows.tolist())}
    H, R = np.zeros((2 * m, 3 + 2 * len(columns))), np.zeros((2 * m, 2 * m))
    for k, row in enumerate(rows):
        own = slice(2 * k, 2 * k + 2)
        H[own, :3] = model.H_pose[k]
        H[own, columns[row] : columns[row] + 2] = model.H_line[k]
        R[own, own] = model.R[k]
    np.testing.assert_array_equal(found.H, H)
    np.testing.assert_array_equal(found.R, R)
    np.testing.assert_array_equal(found.e, model.e.reshape(-1))


def test_innovations_are_taken_row_by_row():
    rng = np.random.default_rng(5)
    seen = [seen_line(rng) for _ in range(4)]
    lines, cov = np.array([s[0] for s in seen]), np.array([s[1] for s in seen])
    model = innovations(random_pose(rng), rng.uniform(-9, 9, (4, 2)), rng.uniform(-3, 3, (4, 2)), lines, cov)
    taken = model.take(np.array([3, 1]))
    for name in ("e", "H_pose", "H_line", "R"):
        np.testing.assert_array_equal(getattr(taken, name), getattr(model, name)[[3, 1]])
