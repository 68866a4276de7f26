"""Second looks: segments of a whole drive are associated anew, and poses and lines solved for together."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from chainslam.slam.association.second_looks.closures import Closure, Drive, settled
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.landmarks import associated, firm, joined
from chainslam.slam.association.second_looks.second_looks import second_looks
from chainslam.slam.association.second_looks.solve import begun, normal_equations, of_links, of_sightings, solved
from chainslam.slam.association.second_looks.walls import surveyed
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import lines_to_world, through
from chainslam.slam.geometry.poses import compose, inverse, rotation, to_robot, wrap
from tests.slam.association.drives import driven

WALLS = np.array([[[6, 0], [0, 0]], [[0, 0], [0, 4]], [[0, 4], [6, 4]], [[6, 4], [6, 0]], [[2, 1.5], [4, 1.5]]], float)
CONFIG = SecondLooksConfig()


def segments_at(pose, rng, walls=WALLS):
    """All walls as they are seen from a pose, a little off."""
    ends = np.array([to_robot(wall, pose) for wall in walls]) + rng.normal(0.0, 0.003, (len(walls), 2, 2))
    lines = through(ends)
    n = len(walls)
    middles = ends.mean(axis=1)
    t0 = np.sum(middles * np.column_stack([-np.sin(lines[:, 0]), np.cos(lines[:, 0])]), axis=1)
    a = 0.002**2
    cov = np.array([[[a, t * a], [t * a, 0.003**2 + t**2 * a]] for t in t0])
    return Segments(
        lines, cov, ends, np.zeros((n, 2), dtype=np.int64), np.full(n, 20), np.zeros((n, 2), dtype=bool),
        np.zeros(n), np.zeros(n, dtype=bool),
    )  # fmt: skip


def drive(count=60, seed=1, walls=WALLS, worse=1.0):
    """True poses round a room, and what odometry makes of them: a drift of a fifth of a metre, or times as much."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 4.0 * np.pi, count)
    true = np.column_stack([3 + 2 * np.cos(turn), 2.6 + np.sin(turn), wrap(turn)])
    motions = np.array([compose(inverse(a), b) for a, b in pairwise(true)])
    motions += worse * rng.normal(0.0, [0.01, 0.01, 0.004], (count - 1, 3))
    poses = [true[0]]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return true, np.array(poses), motions, [segments_at(pose, rng, walls) for pose in true]


def looked(poses, motions, segments):
    """Poses by lines alone: without returns no place is sought."""
    return second_looks(poses[0], driven(motions), segments, [np.zeros((0, 2))] * len(poses)).poses


def test_a_drift_goes_that_no_filter_had_a_say_in():
    true, drifted, motions, segments = drive()
    before = np.hypot(*(drifted - true)[:, :2].T)
    found = looked(drifted, motions, segments)
    after = np.hypot(*(found - true)[:, :2].T)
    assert before.max() > 0.08
    assert after.max() < 0.02
    assert np.abs(wrap(found[:, 2] - true[:, 2])).max() < 0.005
    np.testing.assert_allclose(found[0], drifted[0], atol=1e-5)


@pytest.mark.parametrize("seed", [5, 6])
def test_a_drift_of_far_more_than_the_last_gate_goes(seed):
    true, drifted, motions, segments = drive(seed=seed, worse=3.0)
    assert np.hypot(*(drifted - true)[:, :2].T).max() > 4.0 * CONFIG.gates_m[-1] > CONFIG.gates_m[0]
    survey = second_looks(drifted[0], driven(motions), segments, [np.zeros((0, 2))] * len(true))
    assert np.hypot(*(survey.poses - true)[:, :2].T).max() < 0.04
    assert len(survey.walls) == len(WALLS)


def test_one_scan_after_a_slip_that_nobody_told_does_not_bend_the_others():
    true, drifted, motions, segments = drive()
    motions[30] += [0.1, 0.05, 0.05]
    for k in range(31, len(drifted)):
        drifted[k] = compose(drifted[k - 1], motions[k - 1])
    found = looked(drifted, motions, segments)
    assert np.hypot(*(found - true)[:, :2].T).max() < 0.02


def test_the_sides_of_a_thin_wall_are_two_lines_and_pieces_far_apart_too():
    true, _, _, _ = drive(4)
    walls = np.array([[[2, 1], [4, 1]], [[4, 1.1], [2, 1.1]], [[6, 1], [8, 1]]], float)
    rng = np.random.default_rng(0)
    sightings = joined([firm(k, segments_at(pose, rng, walls), CONFIG) for k, pose in enumerate(true)])
    owner = associated(sightings, true, 0.25, CONFIG)
    np.testing.assert_array_equal(owner.reshape(4, 3), np.tile([0, 1, 2], (4, 1)))


def test_lines_that_were_seen_rarely_say_nothing_and_short_segments_are_left_out():
    true, _, _, _ = drive(2)
    rng = np.random.default_rng(0)
    short = np.array([[[2, 1], [2.3, 1]], [[2, 3], [4, 3]]], float)
    parts = [firm(k, segments_at(pose, rng, short), CONFIG) for k, pose in enumerate(true)]
    assert [len(part) for part in parts] == [1, 1]
    np.testing.assert_array_equal(associated(joined(parts), true, 0.25, CONFIG), [-1, -1])


def problem():
    true, drifted, motions, segments = drive(8)
    sightings = joined([firm(k, each, CONFIG) for k, each in enumerate(segments)])
    owner = associated(sightings, true, 0.25, CONFIG)
    assert owner.min() == 0
    return true, drifted, motions, sightings, owner


def test_lines_begin_where_their_sightings_have_them():
    true, _, _, sightings, owner = problem()
    start = begun(true, sightings, owner)
    for k in range(len(sightings)):
        world = lines_to_world(through(sightings.ends[k : k + 1]), true[sightings.scan[k]])[0]
        line, anchor = start.lines[owner[k]], start.anchors[owner[k]]
        assert abs(wrap(world[0] - line[0])) < 0.01
        assert abs(np.array([np.cos(world[0]), np.sin(world[0])]) @ anchor - world[1]) < 0.03


@pytest.mark.parametrize("of", ["motions", "sightings"])
def test_derivatives_are_those_of_differences(of):
    _, drifted, motions, sightings, owner = problem()
    start = begun(drifted, sightings, owner)

    def terms(unknowns):
        if of == "motions":
            return of_links(unknowns.poses, driven(motions).links(CONFIG.doubt, CONFIG))
        return of_sightings(unknowns, sightings, owner, CONFIG)

    at = terms(start)
    size, step = start.poses.size + start.lines.size, 1e-6
    for u in range(size):
        change = np.zeros(size)
        change[u] = step
        slope = (terms(start.plus(change)).errors - terms(start.plus(-change)).errors) / (2 * step)
        told = np.zeros_like(slope)
        for g, v in np.argwhere(at.columns == u):
            told[g] = at.jacobians[g, :, v]
        np.testing.assert_allclose(slope, told, atol=1e-4)


def test_where_the_robot_was_carried_the_motion_counts_as_it_is_stated():
    """A search for the place states its error, and scan matching more than its own."""
    covs = np.tile(np.diag([0.1, 0.1, 0.02]) ** 2, (4, 1, 1))
    believed = Drive(np.zeros((4, 3)), covs, carried=(3,)).believed(CONFIG)
    np.testing.assert_array_equal(believed[2], covs[2])
    for k in (0, 1, 3):
        np.testing.assert_allclose(believed[k], covs[k] / CONFIG.understated)


def test_a_motion_holds_as_far_as_it_is_stated_and_least_where_it_is_stated_least():
    """A corridor told the motion across it alone: what closes the loop is found in the motion along it."""
    motions = np.array([[1.0, 0.0, 0.0]] * 4)
    covs = np.tile(np.diag([0.01, 0.01, 0.01]) ** 2, (4, 1, 1))
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    covs[2] = turned @ np.diag([0.6, 0.01, 0.01]) ** 2 @ turned.T
    links = Drive(motions, covs).links(CONFIG.doubt, CONFIG)
    errors = of_links(np.zeros((5, 3)), links).errors
    stated = np.einsum("ki,kij,kj->k", motions, np.linalg.inv(covs), motions)
    np.testing.assert_allclose((errors**2).sum(axis=1), CONFIG.understated * stated, rtol=1e-2)
    closed = [Closure(0, 4, np.array([3.92, -0.06, 0.0]))]
    poses = settled(np.column_stack([np.arange(5.0), np.zeros((5, 2))]), Drive(motions, covs), closed, CONFIG)
    steps = np.diff(poses[:, :2], axis=0)
    np.testing.assert_allclose(steps[2], [0.92, -0.06], atol=0.01)
    np.testing.assert_allclose(np.delete(steps, 2, axis=0), motions[:3, :2], atol=0.005)


def test_the_solution_is_a_least_of_the_weighted_errors():
    _, drifted, motions, sightings, owner = problem()
    found = solved(
        begun(drifted, sightings, owner),
        [driven(motions).links(CONFIG.doubt, CONFIG)],
        sightings,
        owner,
        SecondLooksConfig(iterations=30),
    )

    def cost(unknowns):
        parts = (
            of_links(unknowns.poses, driven(motions).links(CONFIG.doubt, CONFIG)),
            of_sightings(unknowns, sightings, owner, CONFIG),
        )
        return sum(np.sum(np.log1p(np.sum(part.errors**2, axis=1) / CONFIG.doubt**2)) for part in parts)

    least = cost(found)
    rng = np.random.default_rng(5)
    for _ in range(30):
        change = 1e-3 * rng.standard_normal(found.poses.size + found.lines.size)
        change[:3] = 0.0
        assert cost(found.plus(change)) > least


def test_two_poses_err_together_as_the_whole_information_says():
    _, drifted, motions, segments = drive()
    survey = second_looks(drifted[0], driven(motions), segments, [np.zeros((0, 2))] * len(drifted))
    dense = np.linalg.inv(survey.information.toarray())
    first, second = np.array([3, 10, 3]), np.array([40, 11, 59])
    for k, (a, b) in enumerate(zip(first, second, strict=True)):
        rows = np.concatenate([3 * a + np.arange(3), 3 * b + np.arange(3)])
        turn = np.eye(6)
        turn[:2, :2], turn[3:5, 3:5] = rotation(-survey.poses[a, 2]), rotation(-survey.poses[b, 2])
        expected = turn @ dense[np.ix_(rows, rows)] @ turn.T
        np.testing.assert_allclose(survey.pair_covs(first, second)[k], expected, rtol=1e-5, atol=1e-11)


@pytest.mark.parametrize("at_once", [2, 64])
def test_the_covariance_is_that_of_the_whole_information_and_the_floor(at_once, monkeypatch):
    monkeypatch.setattr("chainslam.slam.association.second_looks.walls.AT_ONCE", at_once)
    true, _, motions, sightings, owner = problem()
    links = [driven(motions).links(CONFIG.doubt, CONFIG)]
    found = solved(begun(true, sightings, owner), links, sightings, owner, CONFIG)
    information, _ = normal_equations(found, links, sightings, owner, CONFIG)
    walls, joint = surveyed(found, information, sightings, owner, CONFIG)
    rows = np.arange(found.poses.size - 3, found.poses.size + found.lines.size)
    dense = np.linalg.inv(information.toarray())[np.ix_(rows, rows)]
    half = 0.5 * np.diff(walls.extents, axis=1)[:, 0]
    floor = np.column_stack([(CONFIG.floor_m / half) ** 2, np.full(len(walls), CONFIG.floor_m**2)]).ravel()
    np.testing.assert_allclose(joint.cov, dense + np.diag([0.0, 0.0, 0.0, *floor]), rtol=1e-5, atol=1e-10)


def test_a_drive_without_a_wall_follows_its_motions():
    _, drifted, motions, segments = drive(5)
    nothing = [each.take(np.zeros(0, dtype=np.int64)) for each in segments]
    np.testing.assert_allclose(looked(drifted, motions, nothing), drifted, atol=1e-9)


@pytest.mark.parametrize(("beams", "degrees", "taken"), [(5, 1.0, 0), (6, 1.0, 2), (6, 2.9, 2), (6, 3.1, 0)])
def test_segments_of_few_beams_or_of_unclear_direction_are_left_out(beams, degrees, taken):
    rng = np.random.default_rng(0)
    seen = segments_at(drive(2)[0][0], rng, np.array([[[2, 1], [4, 1]], [[2, 3], [4, 3]]], float))
    cov = seen.cov.copy()
    cov[:, 0, 0] = np.deg2rad(degrees) ** 2
    assert len(firm(0, replace(seen, beam_counts=np.full(2, beams), cov=cov), CONFIG)) == taken


def test_of_two_lines_a_segment_is_of_the_nearer():
    true, _, _, _ = drive(4)
    rng = np.random.default_rng(0)
    near, far = np.array([[2, 1], [4, 1]], float), np.array([[2, 1.2], [4, 1.2]], float)
    shown = [np.array([far, near]), np.array([far, near]), np.array([far, near]), near[None] + [0.0, 0.04]]
    narrow = joined([firm(k, segments_at(true[k], rng, shown[k]), CONFIG) for k in range(4)])
    begun_at = associated(narrow, true, 0.1, CONFIG)
    np.testing.assert_array_equal(begun_at, [0, 1, 0, 1, 0, 1, 1])
    later = joined([firm(k, segments_at(true[k], rng, shown[k]), CONFIG) for k in (0, 3)])
    few = replace(CONFIG, least_sightings=1)
    np.testing.assert_array_equal(associated(later, true, 0.19, few), [0, 1, 1])


def test_one_sighting_is_no_surer_than_a_real_wall_is_straight():
    """Off by as much as real walls are, a sighting without any noise of its own is off by one standard deviation."""
    true, _, _, sightings, owner = problem()
    exact = replace(sightings, sigma_rad=np.zeros(len(sightings)), sigma_m=np.zeros(len(sightings)))
    start = begun(true, exact, owner)
    before = of_sightings(start, exact, owner, CONFIG).errors
    for column, floor in enumerate([CONFIG.floor_rad, CONFIG.floor_m]):
        lines = start.lines.copy()
        lines[:, column] -= floor
        errors = of_sightings(replace(start, lines=lines), exact, owner, CONFIG).errors
        np.testing.assert_allclose((errors - before)[:, column], 1.0, atol=1e-6)
