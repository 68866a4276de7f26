"""Open ends on something round are told from those of boxes, and cost a mission no hundreds of steps."""

import numpy as np
import pytest
import shapely
from shapely.geometry.polygon import orient

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.explore.survey.round_things import is_round
from chainslam.sim.worlds import World
from chainslam.slam.geometry.circles import RoundConfig
from chainslam.slam.map.chains import HEAD, OpenEnd

CONFIG = RoundConfig()
FARAWAY = [[(20.0, 0.0), (26.0, 0.0)], [(20.0, 5.0), (20.0, 0.0)]]


def chords(rng, radius_m, turns, off_m=0.003):
    """Return chords of a circle, free side on the left, so many radians apart, each a little beside its place."""
    middles = np.cumsum(turns) + rng.uniform(0.0, 2.0 * np.pi)
    half = 0.4 * np.min(turns)
    at = np.stack([middles + half, middles - half], axis=-1)
    points = radius_m * np.stack([np.cos(at), np.sin(at)], axis=-1)
    return points + rng.uniform(-1.0, 1.0, (len(turns), 1, 2)) * off_m + rng.uniform(-3.0, 3.0, 2)


def found(scene_with, faces, wall=0):
    walls = scene_with(np.concatenate([faces, FARAWAY]))
    return is_round(OpenEnd(wall, HEAD, walls.ends_world[wall, HEAD]), walls, CONFIG)


@pytest.mark.parametrize("seed", range(20))
def test_chords_of_a_pillar_are_round_wherever_it_stands_and_from_whichever_of_them(scene_with, seed):
    rng = np.random.default_rng(seed)
    faces = chords(rng, rng.uniform(0.1, 0.8), rng.uniform(0.35, 0.9, rng.integers(4, 7)))
    assert all(found(scene_with, faces, wall) for wall in range(len(faces)))


@pytest.mark.parametrize("seed", range(20))
def test_boxes_rooms_inside_and_three_chords_are_not_round(scene_with, seed):
    rng = np.random.default_rng(seed)
    turns = rng.uniform(0.35, 0.9, 5)
    round_thing = chords(rng, rng.uniform(0.15, 0.6), turns)
    assert not found(scene_with, round_thing[:3]), "three lines touch some circle wherever they lie"
    assert not found(scene_with, round_thing[:, ::-1]), "seen from inside"
    assert not found(scene_with, chords(rng, 3.0, turns)), "walls of a bow window"
    c, s = np.cos(rng.uniform(0.0, 6.0)), np.sin(rng.uniform(0.0, 6.0))
    sides = rng.uniform(0.1, 0.7, 2) * np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])
    box = sides @ np.array([[c, s], [-s, c]]) / np.hypot(c, s)
    assert not found(scene_with, np.stack([box[:-1], box[1:]], axis=1)), "a circle may touch all four faces of a box"


def test_a_wall_beside_the_round_thing_is_not_on_it(scene_with):
    rng = np.random.default_rng(1)
    faces = chords(rng, 0.3, np.full(5, 0.6))
    beside = faces[0] + np.array([0.15, 0.0])
    assert found(scene_with, faces)
    assert not found(scene_with, np.concatenate([faces, [beside]]), 5)


def test_a_round_pillar_costs_a_mission_few_steps():
    room, start = shapely.box(0, 0, 5, 4), np.array([0.8, 0.8, 0.3])
    pillar = shapely.Point(2.6, 2.1).buffer(0.3)
    world = World("round", orient(room.difference(pillar)), start, {})
    summary = run_trial(TrialConfig("round", max_steps=1000), world=world).summary
    assert (summary["status"], summary["collisions"]) == ("complete", 0)
    assert "on a curved obstacle" in {aside["why"] for aside in summary["set_aside"]}
    assert summary["coverage"] > 0.95
    assert summary["steps"] < 100
