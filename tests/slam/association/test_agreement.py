"""Two maps laid on each other: against least squares with numerical derivatives, and by many pairs of noisy maps."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime, least_squares
from scipy.stats import chi2

from chainslam.slam.association.second_looks import agreement
from chainslam.slam.association.second_looks.agreement import Walls, about, agreed
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, inverse, to_world, wrap

PLACE = np.array([3.0, -2.0, 0.7])
VAGUE = np.diag([0.3, 0.3, 0.1]) ** 2
SURE = np.diag([0.02, 0.02, 0.01]) ** 2


def walls_of(anchors, alpha, d, half, cov=None):
    """Return walls that reach so far to both sides of their anchors."""
    lines = np.column_stack([alpha, d])
    cov = 1e-6 * np.eye(2 * len(lines)) if cov is None else cov
    return Walls(np.array(anchors, float), lines, np.column_stack([-np.array(half), half]), cov)


def seen_from(walls, place, anchors_off=0.0):
    """Return the same walls in the frame of a map at a place, about anchors of its own."""
    back = inverse(place)
    anchors = to_world(walls.anchors, back)
    alpha = wrap(walls.lines[:, 0] + back[2])
    shift = anchors_off * directions(alpha)
    ends = walls.extents - anchors_off
    return Walls(anchors + shift, np.column_stack([alpha, walls.lines[:, 1]]), ends, walls.cov)


def room(rng, count=6):
    """Return walls of a crooked room; their errors are correlated."""
    root = rng.normal(0.0, 0.004, (2 * count, 2 * count))
    return walls_of(
        rng.uniform(-4.0, 4.0, (count, 2)), rng.uniform(-np.pi, np.pi, count), rng.normal(0.0, 0.02, count),
        rng.uniform(0.6, 1.5, count), root @ root.T + 1e-6 * np.eye(2 * count),
    )  # fmt: skip


def noisy(walls, rng):
    """Return walls whose lines err by their covariance."""
    off = rng.multivariate_normal(np.zeros(2 * len(walls)), walls.cov).reshape(-1, 2)
    return Walls(walls.anchors, walls.lines + off, walls.extents, walls.cov)


def misfits(saved, own, place, at):
    """How far each wall of two maps in the same order is from its twin, angle and offset, at a point in between."""
    out = np.empty((len(saved), 2))
    for k in range(len(saved)):
        alpha, beta = saved.lines[k, 0], own.lines[k, 0] + place[2]
        anchor = to_world(own.anchors[k : k + 1], place)[0]
        mine = normals(beta) @ (at[k] - anchor) - own.lines[k, 1]
        theirs = normals(alpha) @ (at[k] - saved.anchors[k]) - saved.lines[k, 1]
        out[k] = wrap(beta - alpha), mine - theirs
    return out.ravel()


@pytest.mark.parametrize("seed", range(5))
def test_a_place_is_the_least_squares_one_and_its_covariance_that_of_it(seed):
    """All lines and the place are unknowns there; the derivatives are numerical."""
    rng = np.random.default_rng(seed)
    saved = room(rng)
    own = noisy(seen_from(saved, PLACE, 0.3), rng)
    saved, prior = noisy(saved, rng), PLACE + rng.multivariate_normal(np.zeros(3), SURE)
    found = agreed(saved, own, prior, VAGUE)
    assert found.pairs == len(saved)
    feet = saved.anchors + saved.lines[:, 1:] * normals(saved.lines[:, 0])
    t = directions(saved.lines[:, 0])
    along = np.sort(np.vecdot(t[:, None], to_world(own.ends, found.place) - saved.anchors[:, None]), axis=1)
    both = np.maximum(along[:, 0], saved.extents[:, 0]), np.minimum(along[:, 1], saved.extents[:, 1])
    middle = np.mean(both, axis=0)
    at = feet + middle[:, None] * t

    def moved(walls, off):
        return Walls(walls.anchors, walls.lines + off.reshape(-1, 2), walls.extents, walls.cov)

    def error(place):
        return misfits(saved, own, place, at)

    n = 2 * len(saved)
    J_saved = approx_fprime(np.zeros(n), lambda off: misfits(moved(saved, off), own, found.place, at), 1e-7)
    J_own = approx_fprime(np.zeros(n), lambda off: misfits(saved, moved(own, off), found.place, at), 1e-7)
    W = np.linalg.inv(np.linalg.cholesky(J_saved @ saved.cov @ J_saved.T + J_own @ own.cov @ J_own.T))
    V = np.linalg.inv(np.linalg.cholesky(VAGUE))
    best = least_squares(lambda x: np.concatenate([W @ error(x), V @ (x - prior)]), prior, xtol=1e-12, ftol=1e-12)
    np.testing.assert_allclose(found.place, best.x, atol=2e-4)
    np.testing.assert_allclose(found.cov, np.linalg.inv(best.jac.T @ best.jac), rtol=0.05, atol=1e-8)
    assert found.chi2 == pytest.approx(np.sum((W @ error(best.x)) ** 2), rel=0.05)


def test_over_many_pairs_of_maps_the_error_is_as_stated():
    rng, squares, chis = np.random.default_rng(3), [], []
    count = 300
    for _ in range(count):
        exact = room(rng)
        saved, own = noisy(exact, rng), noisy(seen_from(exact, PLACE, 0.2), rng)
        found = agreed(saved, own, PLACE + rng.multivariate_normal(np.zeros(3), VAGUE / 100.0), VAGUE)
        if found.pairs == len(exact):
            off = found.place - PLACE
            squares.append(off @ np.linalg.solve(found.cov, off))
            chis.append(found.chi2)
    assert len(squares) > 0.8 * count
    low, high = chi2.ppf([0.0005, 0.9995], 3 * len(squares)) / len(squares)
    assert low < np.mean(squares) < high
    # Those of all whose pairs passed the gate lose a little of the tail.
    assert 0.85 * (2 * len(exact) - 3) < np.mean(chis) < 1.05 * (2 * len(exact) - 3)


def pair(turn=0.0, aside=0.0, along=0.0, half=1.0):
    """A map of three walls, and one in which the first is another: turned, aside, farther along or shorter."""
    anchors = [[0.0, 0.0], [2.0, 2.0], [-2.0, 1.0]]
    saved = walls_of(anchors, [0.0, 0.5 * np.pi, 2.0], np.zeros(3), np.ones(3))
    other = walls_of([[aside, along], *anchors[1:]], [turn, 0.5 * np.pi, 2.0], np.zeros(3), [half, 1.0, 1.0])
    return saved, other


@pytest.mark.parametrize(
    ("change", "pairs"),
    [
        ({}, 3),
        ({"along": 1.6}, 3),
        ({"along": 1.8}, 2),
        ({"half": 0.16}, 3),
        ({"half": 0.14}, 2),
        ({"aside": 0.003}, 3),
        ({"aside": 0.3}, 2),
        ({"turn": np.pi}, 2),
    ],
)
def test_walls_are_one_that_overlap_and_agree(change, pairs):
    saved, own = pair(**change)
    assert agreed(saved, own, np.zeros(3), 1e-8 * np.eye(3)).pairs == pairs


@pytest.mark.parametrize(("turn_deg", "pairs"), [(4.8, 3), (5.2, 2)])
def test_walls_that_turn_by_more_than_five_degrees_are_two_however_vague(turn_deg, pairs):
    saved, own = pair(turn=np.deg2rad(turn_deg))
    vague = Walls(own.anchors, own.lines, own.extents, np.diag([1.0, 1.0, *[1e-6] * 4]))
    assert agreed(saved, vague, np.zeros(3), 1e-8 * np.eye(3)).pairs == pairs


@pytest.mark.parametrize(("sigmas", "pairs"), [(2.9, 3), (3.2, 2)])
def test_walls_are_two_beyond_the_gate(sigmas, pairs):
    """Of two degrees of freedom at 99 %: 3.03 standard deviations."""
    saved, own = pair(aside=sigmas * np.sqrt(2e-6))
    assert agreed(saved, own, np.zeros(3), 1e-14 * np.eye(3)).pairs == pairs


def test_a_wall_is_in_one_pair_and_in_the_likelier():
    saved, _ = pair()
    twice = walls_of(
        [[0.002, 0.0], [0.001, 0.0], [2.0, 2.0], [-2.0, 1.0]], [0.0, 0.0, 0.5 * np.pi, 2.0], np.zeros(4), np.ones(4)
    )
    for one, other, side in ((saved, twice, "own"), (twice, saved, "saved")):
        pairs = agreement._paired(one, other, np.zeros(3), 1e-8 * np.eye(3))
        assert len(pairs) == 3
        assert sorted(getattr(pairs, side).tolist()) == [1, 2, 3]


def test_of_maps_without_a_common_wall_the_place_is_as_it_was():
    saved, own = pair()
    found = agreed(saved, own, np.array([50.0, 0.0, 0.0]), SURE)
    assert (found.pairs, found.chi2) == (0, 0.0)
    np.testing.assert_array_equal(found.cov, SURE)


def test_what_a_pose_amid_the_map_is_known_to_moves_the_map_by_its_lever():
    rng, at = np.random.default_rng(1), np.array([5.0, 3.0])
    here = np.array([*at, 0.0])
    draws = compose(PLACE, here) + rng.multivariate_normal(np.zeros(3), SURE, 20_000)
    places = np.array([compose(each, inverse(here)) for each in draws])
    np.testing.assert_allclose(about(SURE, PLACE, at), np.cov(places.T), rtol=0.05, atol=2e-5)
