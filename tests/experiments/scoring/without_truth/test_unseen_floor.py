"""How much floor is unseen at most: borders in drawn grids by hand, and the level of the bound by simulation."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from chainslam.experiments.scoring.without_truth.unseen_floor import (
    calibrated,
    calibration,
    frontier_of,
    unseen_floor,
    unseen_now,
)
from chainslam.explore.floor.free_space import FreeSpaceConfig
from chainslam.explore.mission import MissionConfig, explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper

CELL_M = 0.1


def grid_of(*rows):
    """A grid by characters: `.` free, `#` occupied, ` ` unknown; each stands for 5 x 5 cells."""
    cells = [[{".": 0, "#": 100, " ": -1}[each] for each in row] for row in rows]
    return np.kron(np.array(cells, dtype=np.int8), np.ones((5, 5), dtype=np.int8))


CLOSED = grid_of("######", "#....#", "#....#", "#....#", "######")
OPEN = grid_of("######", "#.... ", "#.... ", "#....#", "######")


def test_a_closed_room_has_no_border_and_its_floor_is_counted():
    assert frontier_of(CLOSED, CELL_M, (12, 12), 0.2) == (pytest.approx(12 * 0.25), 0.0)


def test_the_border_is_where_the_robot_can_drive_next_to_unknown_cells():
    area_m2, frontier_m = frontier_of(OPEN, CELL_M, (12, 12), 0.2)
    assert area_m2 == pytest.approx(12 * 0.25)
    # The opening is 1 m high; within the body's radius of the wall above it the robot cannot drive.
    assert 0.7 <= frontier_m <= 1.1


def test_what_lies_behind_a_gap_narrower_than_the_body_does_not_count():
    narrow = OPEN.copy()
    narrow[5:12, 24] = 100
    assert frontier_of(narrow, CELL_M, (12, 12), 0.2)[1] == 0.0
    assert frontier_of(OPEN, CELL_M, (12, 12), 0.65)[1] == 0.0


def test_cells_that_touch_at_a_corner_hang_together():
    rows, columns = np.indices((30, 30))
    slope = np.where(rows + columns < 30, 0, -1).astype(np.int8)
    assert frontier_of(slope, CELL_M, (5, 5), 0.05)[1] == pytest.approx(30 * 0.1 + 28 * 0.1 + 29 * 0.1)
    squares = np.full((20, 20), -1, dtype=np.int8)
    squares[:10, :10] = squares[10:, 10:] = 0
    assert frontier_of(squares, CELL_M, (2, 2), 0.05)[1] == pytest.approx(2 * 36 * 0.1)


def test_what_lies_beyond_the_fence_is_not_to_be_seen():
    world, told = load("paper-fig4"), []
    x, y = world.start[:2]
    for fence in (None, ((x - 0.5, y - 0.5), (x + 0.5, y - 0.5), (x + 0.5, y + 0.5), (x - 0.5, y + 0.5))):
        config = replace(MissionConfig(), free_space=FreeSpaceConfig(fence=fence))
        backend = BACKENDS["full-ekf"].make(np.array(world.start), np.diag([0.01, 0.01, 0.002]) ** 2)
        strategy = STRATEGIES["nearest-robot"].make()
        (step,) = islice(explore_mission(SimulatedRobot(world, 1), Mapper(backend), strategy, config), 1)
        told.append(unseen_now(step))
    assert told[0].frontier_m > 1.0
    assert told[1].frontier_m == 0.0


def test_the_edge_of_the_grid_is_unknown_and_few_cells_are_a_gap_between_beams():
    assert frontier_of(np.zeros((20, 20), dtype=np.int8), CELL_M, (10, 10), 0.2)[1] == pytest.approx(7.6)
    slit = CLOSED.copy()
    slit[12:15, 25:] = 0
    assert frontier_of(slit, CELL_M, (12, 12), 0.05)[1] == 0.0


def test_the_share_does_not_depend_on_the_unit_of_length():
    small, large = (unseen_floor(OPEN, cell, (12, 12), 2.0 * cell) for cell in (0.1, 0.2))
    assert large.reach == pytest.approx(small.reach)
    assert large.at_most_m2 == pytest.approx(4.0 * small.at_most_m2)


def test_a_robot_that_stands_on_no_free_floor_is_told():
    with pytest.raises(ValueError, match="free cells"):
        unseen_floor(CLOSED, CELL_M, (0, 0), 0.05)
    for cell, radius in ((0.0, 0.2), (0.1, -0.2), (np.nan, 0.2), (0.1, np.inf)):
        with pytest.raises(ValueError, match="positive size"):
            unseen_floor(CLOSED, cell, (12, 12), radius)


def test_the_stored_bound_grows_with_the_border_and_is_finite():
    bound = calibration()
    assert 0.0 < bound.closed < bound.open < np.inf
    assert bound.runs >= 80
    shares = bound.share(np.array([0.0, 1e-9, 0.25, 1.0]))
    assert shares.tolist() == [bound.closed, bound.closed, 0.5 * bound.open, bound.open]
    closed, opened = (unseen_floor(each, CELL_M, (12, 12), 0.2) for each in (CLOSED, OPEN))
    assert closed.at_most_m2 == pytest.approx(bound.closed * 3.0)
    assert opened.at_most_m2 == pytest.approx(bound.open * np.sqrt(opened.frontier_m / np.sqrt(3.0)) * 3.0)


@pytest.mark.parametrize("skew", [0.3, 1.5])
def test_a_bound_from_other_values_of_their_kind_holds_with_95_percent_or_more(skew):
    rng, held = np.random.default_rng(5), []

    def drawn(count):
        reach = np.maximum(rng.uniform(-0.5, 1.0, count), 0.0)
        return reach, (reach + 0.01) * rng.lognormal(-1.0, skew, count)

    for _ in range(200):
        bound = calibrated(*drawn(150), 150)
        reach, share = drawn(50)
        held.append(np.mean(share <= bound.share(reach)))
    assert 0.945 <= np.mean(held) <= 0.975


def test_too_few_values_have_no_bound():
    bound = calibrated(np.repeat([0.0, 0.5], 18), np.linspace(0.0, 1.0, 36), 36)
    assert (bound.closed, bound.open) == (np.inf, np.inf)
    assert np.isfinite(calibrated(np.repeat([0.0, 0.5], 19), np.linspace(0.0, 1.0, 38), 38).open)
