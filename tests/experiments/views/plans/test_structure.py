"""What is square, collinear or equally thick: probabilities that are frequencies, and maps with what is sure."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.affinity import affine_transform
from shapely.geometry.polygon import orient

from chainslam.experiments.scoring.maps.equal_values import classes, imposed
from chainslam.experiments.usage import UsageError
from chainslam.experiments.views.plans.structure import DIRECTIONS, Relation, structure_of, structured_at

from .buildings import drawn_from, mapped, two_rooms

WALLS = 40


def drawn_directions(chance, deviations, least_deg=0.03, most_deg=3.0):
    """Directions of a building with these deviations from square, and the covariance that they are drawn from."""
    sigmas = np.deg2rad(np.exp(chance.uniform(np.log(least_deg), np.log(most_deg), WALLS)))
    cov = np.diag(sigmas**2) + np.deg2rad(0.1) ** 2
    quarters = chance.integers(0, 4, WALLS) * 0.5 * np.pi
    return quarters + deviations + chance.multivariate_normal(np.zeros(WALLS), cov) + 0.3, cov


def test_a_probability_is_the_rate_at_which_the_relation_is_true():
    told, true = [], []
    for seed in range(50):
        chance = np.random.default_rng(seed)
        kind = chance.choice(3, WALLS, p=chance.dirichlet([6.0, 1.0, 1.0]))
        spread = np.array([chance.choice(DIRECTIONS.tolerances), 0.0, 0.0])[kind]
        spread = np.where(kind == 1, chance.choice(DIRECTIONS.askew, WALLS), spread)
        anywhere = chance.uniform(-0.25 * np.pi, 0.25 * np.pi, WALLS)
        values, cov = drawn_directions(chance, np.where(kind == 2, anywhere, spread * chance.standard_normal(WALLS)))
        found = classes(values, cov, DIRECTIONS)
        labels, counts = np.unique(found.nearest[found.nearest >= 0], return_counts=True)
        mine = np.flatnonzero(found.nearest == labels[counts.argmax()]) if len(labels) else []
        told += found.probability[mine].tolist()
        true += (kind[mine] == 0).tolist()
    probability, is_true = np.array(told), np.array(true)
    for low, high in ((0.0, 0.05), (0.8, 0.95), (0.95, 0.99), (0.99, 1.0)):
        those = (probability >= low) & (probability <= high)
        assert those.sum() > 40
        assert is_true[those].mean() == pytest.approx(probability[those].mean(), abs=0.035)
    assert is_true[probability >= 0.99].mean() > 0.99


def test_walls_that_are_all_askew_are_not_taken_for_square():
    """A wall that is off its class by less than 0.3 degrees is square within the largest tolerance."""
    false = total = 0
    for seed in range(20):
        chance = np.random.default_rng([seed, 1])
        deviations = np.deg2rad(chance.uniform(0.5, 3.0, WALLS) * chance.choice([-1.0, 1.0], WALLS))
        values, cov = drawn_directions(chance, deviations, most_deg=[0.1, 3.0][seed % 2])
        found = classes(values, cov, DIRECTIONS)
        for label in np.unique(found.of[found.of >= 0]):
            mine = deviations[found.of == label]
            false += int((np.abs(mine - np.median(mine)) > np.deg2rad(0.3)).sum())
        total += WALLS
    assert false / total < 0.01


def twelve_rooms():
    """Rooms of 3 x 3 m in three rows, with walls of 0.1 m and doors of 0.9 m between them."""
    at = [(3.1 * i, 3.1 * j) for i in range(4) for j in range(3)]
    rooms = [shapely.box(x, y, x + 3.0, y + 3.0) for x, y in at]
    rooms += [shapely.box(x + 2.9, y + 1.0, x + 3.2, y + 1.9) for x, y in at if x < 9.0]
    rooms += [shapely.box(x + 1.0, y + 2.9, x + 1.9, y + 3.2) for x, y in at if x < 1.0 and y < 6.0]
    return orient(shapely.union_all(rooms).simplify(1e-9), 1.0)


def test_a_sheared_building_has_parallels_and_no_right_angle():
    floor = affine_transform(twelve_rooms(), [1.0, np.tan(np.deg2rad(1.5)), 0.0, 1.0, 0.0, 0.0])
    for seed in range(2):
        found = structure_of(drawn_from(mapped(floor), np.random.default_rng([seed, 2])))
        used = [each.relation for each in found.hypotheses if each.is_used]
        assert Relation.RIGHT_ANGLE not in used
        assert used.count(Relation.PARALLEL) > 20


def test_a_wall_that_is_known_to_degrees_is_of_neither_of_two_near_directions():
    deviations = np.where(np.arange(WALLS) % 2, np.deg2rad(1.5), 0.0)
    for seed in range(6):
        chance = np.random.default_rng([seed, 5])
        sigmas = np.deg2rad(np.where(np.arange(WALLS) < 30, 0.03, chance.uniform(0.4, 1.5, WALLS)))
        values = deviations + sigmas * chance.standard_normal(WALLS)
        found = classes(values, np.diag(sigmas**2), DIRECTIONS)
        assert (found.of[:30] >= 0).sum() > 20
        for label in np.unique(found.of[found.of >= 0]):
            assert np.ptp(deviations[found.of == label]) == 0.0


def test_an_imposed_relation_is_a_measurement_of_it():
    chance = np.random.default_rng(1)
    root = chance.normal(size=(12, 15))
    cov, H, values = root @ root.T, chance.normal(size=(6, 12)), chance.normal(size=6)
    of, tolerance = np.array([0, 0, -1, 3, 0, 3]), 0.2
    correction, after = imposed(values, H, cov, of, tolerance**2 * np.eye(6))
    C = np.array([[-1, 1, 0, 0, 0, 0], [-1, 0, 0, 0, 1, 0], [0, 0, 0, -1, 0, 1]], dtype=float)
    J, weight = C @ H, np.linalg.inv(tolerance**2 * C @ C.T)
    dense = np.linalg.inv(np.linalg.inv(cov) + J.T @ weight @ J)
    np.testing.assert_allclose(after, dense, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(correction, -dense @ J.T @ weight @ C @ values, rtol=1e-8, atol=1e-9)
    assert np.linalg.eigvalsh(after).min() > 0.0


def test_the_directions_of_a_regular_building_become_twice_as_sure_and_stay_true():
    ratios, squared = [], []
    for seed in range(15):
        chance = np.random.default_rng([seed, 3])
        deviations = np.deg2rad([0.02, 0.05][seed % 2]) * chance.standard_normal(WALLS)
        values, cov = drawn_directions(chance, deviations, most_deg=1.0)
        found = classes(values, cov, DIRECTIONS)
        mine = found.of >= 0
        first = values[np.flatnonzero(mine)[0]]
        correction, after = imposed(
            first + DIRECTIONS.off(values - first), np.eye(WALLS), cov, found.of, found.tolerance**2 * np.eye(WALLS)
        )
        off = DIRECTIONS.off(values + correction - deviations - 0.3)
        squared.append(off @ np.linalg.solve(after, off) / WALLS)
        common = np.deg2rad(0.1) ** 2
        ratios.append(np.median(np.sqrt((np.diag(after)[mine] - common) / (np.diag(cov)[mine] - common))))
    assert np.median(ratios) < 0.5
    assert 0.7 < np.mean(squared) < 1.15


def test_collinear_and_equally_thick_walls_of_twelve_rooms():
    plan = mapped(twelve_rooms())
    found = structure_of(drawn_from(replace(plan, cov=0.3**2 * plan.cov), np.random.default_rng(4)))
    used = [each for each in found.hypotheses if each.is_used]
    collinear = [each.walls for each in used if each.relation is Relation.COLLINEAR]
    assert len(collinear) > 10
    for walls in collinear:
        first, second = plan.lines_world[list(walls)]
        np.testing.assert_allclose(first, second, atol=1e-9)
    assert sum(each.relation is Relation.THICKNESS for each in used) > 5
    moved = replace(plan, means=plan.means + np.outer(np.arange(len(plan)) == collinear[0][0], [0.0, 0.03]))
    other = structure_of(drawn_from(replace(moved, cov=0.3**2 * plan.cov), np.random.default_rng(4)))
    lines = moved.lines_world
    for each in other.hypotheses:
        if each.is_used and each.relation is Relation.COLLINEAR:
            np.testing.assert_allclose(*lines[list(each.walls)], atol=1e-9)


def test_a_map_without_walls_has_no_structure():
    plan = mapped(two_rooms())
    empty = replace(plan, ids=plan.ids[:0], means=plan.means[:0], anchors=plan.anchors[:0], extents=plan.extents[:0],
                    cov=plan.cov[:3, :3], chains=(), closed=())  # fmt: skip
    assert structure_of(empty).hypotheses == ()


@pytest.mark.parametrize(("tolerance_deg", "found"), [(0.0, "tolerance"), (0.51, "tolerance"), (0.5, "map.npz")])
def test_a_tolerance_that_would_take_askew_walls_for_square_is_refused(tmp_path, tolerance_deg, found):
    with pytest.raises(UsageError, match=found):
        structured_at(tmp_path, tolerance_deg)
