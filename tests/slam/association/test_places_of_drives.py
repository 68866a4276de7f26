"""Place search over generated buildings: loops are closed where they are, and no niche is taken for its like."""

from functools import cache

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from chainslam.slam.association.second_looks.closures import closure_links, settled
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.landmarks import NO_SIGHTINGS
from chainslam.slam.association.second_looks.loop_search import LoopSearch
from chainslam.slam.association.second_looks.solve import normal_equations, without_lines
from chainslam.slam.association.second_looks.submaps import Returns
from chainslam.slam.geometry.poses import compose, inverse, wrap
from tests.slam.association.drives import STATED, along, driven, followed, motions_of, off_m, returns_at

CONFIG = SecondLooksConfig()
PLACES = CONFIG.closures
SIGMAS = np.array([PLACES.sigma_m, PLACES.sigma_m, PLACES.sigma_rad])
SEEDS = range(5)
LEAST_TOOTH_M = 2.0


def a_ring(seed):
    """A corridor around a block, both of random size, with eight niches of random place and size, and the way round."""
    rng = np.random.default_rng([8, seed])
    wide, width, height = rng.uniform(1.4, 2.4), rng.uniform(7, 13), rng.uniform(6, 9)
    building = shapely.box(0, 0, width, height).difference(shapely.box(wide, wide, width - wide, height - wide))
    for side in [0, 1, 2, 3] * 2:
        deep, long, at = rng.uniform(0.3, 1.0), rng.uniform(0.5, 1.5), rng.uniform(0.2, 0.8)
        x, y = [(at * width, -deep), (width, at * height), (at * width, height), (-deep, at * height)][side]
        across, upwards = (deep, long) if side % 2 else (long, deep)
        building = building.union(shapely.box(x, y, x + across, y + upwards))
    m = 0.5 * wide
    return building, shapely.LinearRing([(m, m), (width - m, m), (width - m, height - m), (m, height - m)])


def a_comb(seed):
    """A straight corridor of 20 m with niches that are all alike and evenly spaced, and the way there and back."""
    rng = np.random.default_rng([9, seed])
    wide, tooth = rng.uniform(1.2, 2.0), rng.uniform(LEAST_TOOTH_M, 3.2)
    deep, long, count = rng.uniform(0.5, 1.0), rng.uniform(0.6, 1.2), int(20.0 / tooth)
    niches = [shapely.box(k * tooth + 0.4, wide, k * tooth + 0.4 + long, wide + deep) for k in range(count)]
    building = shapely.box(0, 0, count * tooth, wide).union(shapely.union_all(niches))
    y, end = 0.5 * wide, count * tooth - 1.0
    return building, shapely.LinearRing([(1.0, y), (end, y), (end, y + 0.1), (1.0, y + 0.1)])


def as_stated(true, seed):
    """Motions off by noise as large as second looks take it to be."""
    rng = np.random.default_rng([10, seed])
    motions = motions_of(true)
    return motions + rng.normal(0.0, STATED / np.sqrt(CONFIG.understated), motions.shape)


def searched(true, motions, building, seed):
    return LoopSearch(true[0], driven(motions), Returns(returns_at(true, seed, building=building), PLACES), CONFIG)


def errors_of(closures, true):
    off = [each.motion - compose(inverse(true[each.old]), true[each.new]) for each in closures]
    return np.array([[*each[:2], wrap(each[2])] for each in off]).reshape(-1, 3)


@cache
def round_a_ring(seed):
    building, way = a_ring(seed)
    true = along(way, 0.4, 1.3 * way.length)
    return true, searched(true, as_stated(true, seed), building, seed)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_ring_is_closed_where_it_closes(seed):
    true, search = round_a_ring(seed)
    assert len(search.closures) >= 2
    errors = errors_of(search.closures, true) / SIGMAS
    assert np.abs(errors).max() < 3.5
    assert search.drive.slipped == []


def test_closures_are_as_good_as_stated():
    rings = [round_a_ring(seed) for seed in SEEDS]
    errors = np.concatenate([errors_of(search.closures, true) for true, search in rings]) / SIGMAS
    squares = np.mean(errors**2, axis=0)
    assert np.all(squares > 0.1)
    assert np.all(squares < 1.2)


def test_the_ends_of_rings_are_no_farther_off_than_the_information_says():
    squared = []
    for seed in SEEDS:
        true, search = round_a_ring(seed)
        found = settled(search.poses, search.drive, search.closures, CONFIG)
        links = [search.drive.links(1e9, CONFIG), closure_links(search.closures, 1e9, PLACES)]
        information, _ = normal_equations(without_lines(true), links, NO_SIGHTINGS, np.zeros(0, dtype=np.int64), CONFIG)
        cov = np.linalg.inv(information.toarray())[-3:, -3:]
        error = found[-1] - true[-1]
        error[2] = wrap(error[2])
        squared.append(error @ np.linalg.solve(cov, error))
    low, high = chi2.interval(0.998, 3 * len(SEEDS))
    assert low < np.sum(squared) < high


@pytest.mark.parametrize("seed", SEEDS)
def test_in_a_corridor_of_equal_niches_none_is_taken_for_the_next(seed):
    """On its way back the robot believes to be up to two niches from where it is."""
    building, way = a_comb(seed)
    true = along(way, 0.4, 0.95 * way.length)
    motions = as_stated(true, seed)
    back = np.linspace(-0.12, 0.12, len(SEEDS))[seed]
    motions[len(motions) // 2 :, 0] *= 1.0 + back
    search = searched(true, motions, building, seed)
    errors = errors_of(search.closures, true)
    assert np.hypot(*errors[:, :2].T).max(initial=0.0) < 0.5 * LEAST_TOOTH_M
    assert off_m(search.poses, true).max() < off_m(followed(true[0], motions), true).max() + 0.2
