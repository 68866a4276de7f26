"""Ways of a body with an outline over cells and headings: against shapely and networkx, and as properties."""

import networkx as nx
import numpy as np
import pytest
import shapely
from shapely import affinity

from chainslam.explore.planning.footprints import AHEAD, HEADINGS_RAD, footprints, heading_of, rooms_of
from chainslam.explore.planning.headings import BACK, TURN_M, Ground, Room, cheapest
from chainslam.slam.robot import RobotSpec

CELL_M = 0.05
LONG = RobotSpec(outline_m=((0.3, 0.12), (-0.3, 0.12), (-0.3, -0.12), (0.3, -0.12)))

SKEW = RobotSpec(outline_m=((0.3, 0.2), (-0.3, 0.12), (-0.25, -0.1), (0.15, -0.1)))
"""It is no mirror image of itself."""


def room_of(robot):
    return Room(robot, 0.0, 0.025, 20.0)


def ground_of(occupied):
    metre = np.where(occupied, -1.0, 1.0)
    return Ground(occupied, np.zeros(2, dtype=np.int64), metre, np.zeros_like(occupied), CELL_M)


def scattered(seed, size=34, share=0.01):
    occupied = np.random.default_rng(seed).random((size, size)) < share
    occupied[:3], occupied[-3:], occupied[:, :3], occupied[:, -3:] = True, True, True, True
    occupied[6:22, 4:24] = False
    return occupied


@pytest.mark.parametrize("beyond_m", [0.0, 0.03])
def test_a_body_fits_where_no_occupied_centre_lies_within_it(beyond_m):
    occupied = scattered(1)
    cells = np.argwhere(~occupied)
    fits = rooms_of(occupied, cells, SKEW, CELL_M, beyond_m)
    stones = shapely.points(CELL_M * np.argwhere(occupied)[:, ::-1])
    body = shapely.Polygon(SKEW.outline_m)
    for n in np.random.default_rng(2).choice(len(cells), 40, replace=False):
        for k, heading in enumerate(HEADINGS_RAD):
            here = affinity.translate(
                affinity.rotate(body, heading, (0, 0), use_radians=True), *CELL_M * cells[n, ::-1]
            )
            away = shapely.distance(here, stones) - shapely.distance(here.exterior, stones) * here.contains(stones)
            assert fits[n, k] == bool(away.min() >= beyond_m - 1e-4), (n, k)


def test_headings_lead_to_the_next_cell_and_the_nearest_is_found():
    assert len(HEADINGS_RAD) == 16
    assert np.all(np.diff(np.unwrap(HEADINGS_RAD)) > 0.3)
    for k, heading in enumerate(HEADINGS_RAD):
        assert heading_of(heading + 0.1) == heading_of(heading - 2 * np.pi) == k


def brute_force(occupied, robot, start, k0, goals):
    """The cost of the cheapest way by networkx, edge by edge."""
    room, graph = room_of(robot), nx.DiGraph()
    cells = np.argwhere(~occupied)
    fits = rooms_of(occupied, cells, robot, CELL_M, 0.0)
    roomy = rooms_of(occupied, cells, robot, CELL_M, room.margin_m)
    cost = {}
    for n, cell in enumerate(map(tuple, cells.tolist())):
        for k in range(16):
            if fits[n, k] or (cell == start and k == k0):
                cost[cell, k] = 1.0 + (0.0 if roomy[n, k] else room.squeeze_cost)
    for (cell, k), own in cost.items():
        onto = (cell[0] + AHEAD[k, 1], cell[1] + AHEAD[k, 0])
        if (onto, k) in cost:
            way = 0.5 * (own + cost[onto, k]) * np.hypot(*AHEAD[k])
            graph.add_edge((cell, k), (onto, k), weight=way)
            if robot.can_reverse:
                graph.add_edge((onto, k), (cell, k), weight=BACK * way)
        for beside in ((k + 1) % 16, (k - 1) % 16):
            if (cell, beside) in cost:
                graph.add_edge((cell, k), (cell, beside), weight=TURN_M / CELL_M)
    lengths = nx.single_source_dijkstra_path_length(graph, (start, k0)) if (start, k0) in graph else {}
    return min((lengths.get((tuple(g), k), np.inf) for g in goals.tolist() for k in range(16)), default=np.inf)


@pytest.mark.parametrize("can_reverse", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_the_way_is_the_cheapest_and_the_body_fits_on_all_of_it(seed, can_reverse):
    occupied, start = scattered(seed, share=0.006), np.array([14, 12])
    robot = RobotSpec(outline_m=LONG.outline_m, can_reverse=can_reverse)
    goals = np.array([[13, 9], [14, 8], [22, 14]])  # the first two lie behind
    found = cheapest(ground_of(occupied), room_of(robot), start, 0.1, goals)
    expected = brute_force(occupied, robot, (14, 12), heading_of(0.1), goals)
    assert found is not None
    way, headings, costs = found
    assert costs[14, 12, heading_of(0.1)] == pytest.approx(expected)
    assert way[0].tolist() == start.tolist()
    assert way[-1].tolist() in goals.tolist()
    np.testing.assert_allclose(costs[tuple(goals.T)].min(axis=1)[costs[tuple(goals.T)].min(axis=1) < np.inf], 0.0)
    assert np.all(np.diff([costs[r, c, heading_of(h)] for (r, c), h in zip(way, headings, strict=True)]) < 0.0)
    fits = rooms_of(occupied, way, robot, CELL_M, 0.0)
    assert all(fits[n, heading_of(h)] for n, h in enumerate(headings) if n)


def test_a_long_body_passes_a_door_along_itself_only():
    """The door is 0.35 m wide: wider than the body, and less than it is long."""
    occupied = np.zeros((60, 60), dtype=bool)
    occupied[:, 30] = True
    occupied[27:34, 30] = False
    ground, goal = ground_of(occupied), np.array([[30, 45]])
    way, headings, _ = cheapest(ground, room_of(LONG), np.array([15, 15]), 1.5, goal)
    across = np.abs(way[:, 1] - 30) < 4
    assert across.any()
    assert np.all(np.abs(np.sin(headings[across])) < 0.5)
    wide = RobotSpec(outline_m=((0.3, 0.21), (-0.3, 0.21), (-0.3, -0.21), (0.3, -0.21)))
    assert cheapest(ground, room_of(wide), np.array([15, 15]), 1.5, goal) is None


def test_a_body_too_near_to_something_goes_on_as_it_stands():
    occupied = np.zeros((40, 40), dtype=bool)
    occupied[22, 10:30] = True
    ground, goal = ground_of(occupied), np.array([[10, 20]])
    start = np.array([20, 20])
    assert cheapest(ground, room_of(LONG), start, np.pi / 2, goal) is None
    ground.escape[12:20, 20] = True
    way, headings, *_ = cheapest(ground, room_of(LONG), start, np.pi / 2, goal)
    assert way[-1].tolist() == [10, 20]
    np.testing.assert_allclose(headings[:4], np.pi / 2)


def test_footprints_of_all_headings_cover_about_the_same():
    cells, starts = footprints(LONG, CELL_M, 0.0)
    counts = np.diff(starts)
    assert len(cells) == starts[-1]
    assert counts.min() > 0.6 * 0.144 / CELL_M**2
    assert counts.max() < 1.3 * 0.144 / CELL_M**2
