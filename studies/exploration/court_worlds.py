"""Buildings whose rooms surround a court too wide for the range finder: from its middle a robot sees no wall."""

from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

COURT_M = ((20.0, 24.0), (16.0, 20.0))
"""Length and width of the court, each from and to."""
DEPTH_M = (3.0, 5.0)
"""How far the rooms reach back from the court."""
ROOM_M = (4.0, 7.0)
"""Length of a room along the court, from and to."""
DOOR_M = (0.8, 1.4)
JAMB_M = 0.4
"""Least length of wall left beside a door."""
SECOND_DOOR = 0.4
"""Probability of a door between two rooms side by side."""
OFF_MIDDLE_M = 0.5
"""The robot starts within this of the middle in both directions."""


def court(seed: int) -> dict[str, Any]:
    """Return the plan (`chainslam.sim.worlds.readers.plan_json`) of a building.

    Every room has a door to the court, some have one to the next room. It is turned by any angle; it starts at the
    origin.
    """
    chance = np.random.default_rng(seed)
    half = 0.5 * np.array([chance.uniform(*span) for span in COURT_M])
    depth_m = chance.uniform(*DEPTH_M)
    walls = []
    for turn in range(4):
        # The court's side of half length a stands at the distance b; the corner rooms belong to the long sides.
        a, b = half if turn % 2 == 0 else half[::-1]
        quarter = np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), turn)
        walls += [wall @ quarter for wall in _side(a, b, depth_m, turn % 2 == 0, chance)]
    angle, start = chance.uniform(0.0, 2.0 * np.pi), chance.uniform(-OFF_MIDDLE_M, OFF_MIDDLE_M, size=2)
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = (np.array(walls) - start) @ rotation
    heading = chance.uniform(-np.pi, np.pi)
    return {"walls": np.round(turned, 4).reshape(-1, 4).tolist(), "start": [0.0, 0.0, round(heading, 4)]}


def _side(
    a: float, b: float, depth_m: float, with_corners: bool, chance: np.random.Generator
) -> list[Float[np.ndarray, "2 2"]]:
    """Return the walls of the rooms on one side of the court: those along it from -a to a at the height b."""
    rooms = round(2.0 * a / chance.uniform(*ROOM_M))
    cuts = np.linspace(-a, a, rooms + 1)
    cuts[1:-1] += chance.uniform(-0.5, 0.5, size=rooms - 1)
    walls = []
    for x in cuts[1:-1]:
        if chance.uniform() < SECOND_DOOR:
            walls += _with_door(np.array([x, b]), np.array([x, b + depth_m]), chance)
        else:
            walls.append(np.array([[x, b], [x, b + depth_m]]))
    out = a + depth_m if with_corners else a
    walls.append(np.array([[-out, b + depth_m], [out, b + depth_m]]))
    if with_corners:
        # Each ends a corner room, and the row of the short side beside it.
        walls += [np.array([[side * a, b], [side * out, b]]) for side in (-1.0, 1.0)]
        walls += [np.array([[side * out, b], [side * out, b + depth_m]]) for side in (-1.0, 1.0)]
    for low, high in pairwise(cuts.tolist()):
        walls += _with_door(np.array([low, b]), np.array([high, b]), chance)
    return walls


def _with_door(
    tail: Float[np.ndarray, "2"], head: Float[np.ndarray, "2"], chance: np.random.Generator
) -> list[Float[np.ndarray, "2 2"]]:
    """Return the two pieces of a wall beside a door somewhere in it."""
    length_m, door_m = float(np.hypot(*(head - tail))), chance.uniform(*DOOR_M)
    at = chance.uniform(JAMB_M, length_m - JAMB_M - door_m)
    along = (head - tail) / length_m
    return [np.array([tail, tail + at * along]), np.array([tail + (at + door_m) * along, head])]
