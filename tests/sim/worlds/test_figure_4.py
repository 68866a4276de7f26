"""The environment of figure 4 against brute force: places and points every 5 cm."""

from functools import cache

import networkx as nx
import numpy as np
import shapely

from chainslam.sim.worlds import load

STAND_OFF_M, RANGE_M, PITCH_M, BODY_M = 0.35, 4.0, 0.05, 0.2


def _along(face, offset_m):
    along = face[1] - face[0]
    length = np.hypot(*along)
    share = (np.arange(int(np.ceil(length / PITCH_M))) + 0.5) / np.ceil(length / PITCH_M)
    left = np.array([-along[1], along[0]]) / length
    return face[0] + share[:, None] * along + offset_m * left


@cache
def _numbered():
    """Return the world and the index of the face that each number names."""
    world = load("paper-fig4")
    middles = world.faces.mean(axis=1)
    return world, {int(k): int(np.argmin(np.hypot(*(middles - at).T))) for k, at in world.labels.items()}


@cache
def _sees(viewer: int, wall: int) -> bool:
    world, face = _numbered()
    places = _along(world.faces[face[viewer]], STAND_OFF_M)
    room = world.free.buffer(-BODY_M)
    places = places[shapely.contains(room, shapely.points(places))]
    points = _along(world.faces[face[wall]], 1e-6)
    pairs = np.stack(np.broadcast_arrays(places[:, None], points[None]), axis=2).reshape(-1, 2, 2)
    pairs = pairs[np.hypot(*(pairs[:, 1] - pairs[:, 0]).T) <= RANGE_M]
    if not len(pairs):
        return False
    shapely.prepare(world.free)
    return bool(np.any(shapely.contains_properly(world.free, shapely.linestrings(pairs))))


def _neighbours(number: int) -> set[int]:
    world, face = _numbered()
    mine = world.faces[face[number]]
    return {
        k
        for k, i in face.items()
        if k != number and (np.allclose(world.faces[i, 0], mine[1]) or np.allclose(world.faces[i, 1], mine[0]))
    }


def test_sixteen_walls_are_numbered_once_each_and_at_their_middle():
    world, face = _numbered()
    assert sorted(face) == list(range(1, 17))
    assert len(set(face.values())) == 16 == len(world.faces)
    assert world.face_rings.max() == 1


def test_2_6_8_10_are_neighbours_in_a_chain():
    for a, b in [(2, 6), (6, 8), (8, 10), (3, 12)]:
        assert b in _neighbours(a)


def test_each_wall_of_the_plan_sees_the_next_and_none_beyond():
    for viewer, wall in [(8, 3), (12, 15), (15, 16)]:
        assert _sees(viewer, wall)
    for viewer, wall in [(8, 12), (8, 15), (8, 16), (3, 15), (3, 16), (12, 16)]:
        assert not _sees(viewer, wall)


def test_no_plan_from_8_to_16_is_shorter_than_the_papers():
    graph = nx.DiGraph()
    numbers = range(1, 17)
    graph.add_edges_from((a, b) for a in numbers for b in numbers if a != b and (b in _neighbours(a) or _sees(a, b)))
    plans = list(nx.all_shortest_paths(graph, 8, 16))
    assert [8, 3, 12, 15, 16] in plans
    assert min(plans) == [8, 3, 12, 15, 16]


def test_the_dead_end_is_left_the_way_one_came_in():
    world, _ = _numbered()
    mouth = shapely.box(7.0, 4.5, 7.2, 6.2)
    rest = [part for part in shapely.get_parts(world.free.difference(mouth)) if part.area > 1e-6]
    assert len(rest) == 2
    assert sorted(len(part.interiors) for part in rest) == [0, 1]
