"""The open end of the best expected gain a metre, by the joint covariance (docs/concepts/exploration.md)."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import directions
from chainslam.slam.map.chains import HEAD, OpenEnd

from ..survey.viewpoints import ideal_places
from .expectation import OBSERVATION_SIGMAS, SIGHT_SHARE, Expectation, expect, walls_seen_from
from .strategy import Choice, Situation

LOOKING_M = 2.0
"""What looking at an end costs wherever it is: the way in front of it, past and round it."""
WEIGHED = 16
"""So many of the nearest ends are weighed."""


class Uncertainty:
    """Weighs how well a new wall at an end would be known, and what known walls there would gain, against the way."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the open end with the most nats a metre."""
        metres = situation.end_metres
        near = np.argsort(metres, kind="stable")[:WEIGHED]
        near = near[np.isfinite(metres[near])]
        if not len(near):
            return None
        gains = np.array([_gain(situation, situation.open_ends[row], float(metres[row])) for row in near])
        best = int(np.argmax(gains.sum(axis=1) / (metres[near] + LOOKING_M)))
        new, known = gains[best]
        reason = (
            f"of {len(metres)} open ends the most to learn a metre: {new:.1f} nats of a new wall and {known:.1f} of"
            f" known ones for {metres[near[best]]:.1f} m to drive"
        )
        return Choice(situation.open_ends[near[best]], reason)


def _gain(situation: Situation, end: OpenEnd, metres: float) -> tuple[float, float]:
    """Return the nats expected of the wall that goes on at an end, and of the walls known there."""
    place = ideal_places(end, situation.map, situation.following.viewpoints)[0]
    reach_m = SIGHT_SHARE * situation.around.scan.range_max_m
    seen = walls_seen_from(situation.map, situation.graph, end.wall, place, reach_m)
    expected = expect(situation.map, seen, place, metres, situation.following.robot.wheels)
    return new_wall_nats(situation, end, expected), expected.map_gain_nats


def unknown_wall(range_m: float) -> Float[np.ndarray, "2 2"]:
    """Return the covariance of a wall of which only the scanner's range is known: any direction, any distance to it."""
    return np.diag([np.pi**2, range_m**2]) / 12.0


def new_wall_nats(situation: Situation, end: OpenEnd, expected: Expectation) -> float:
    """Return how far the entropy of a wall falls that is entered at an end, at a right angle, from a pose so known."""
    row = situation.map.belief.rows([end.wall])
    ahead = directions(situation.map.belief.means[row, 0])[0] * (1.0 if end.side == HEAD else -1.0)
    G = np.array([[0.0, 0.0, 1.0], [ahead[0], ahead[1], 0.0]])
    entered = G @ expected.pose_cov @ G.T + np.diag(OBSERVATION_SIGMAS**2)
    return float(
        0.5 * (np.linalg.slogdet(unknown_wall(situation.around.scan.range_max_m))[1] - np.linalg.slogdet(entered)[1])
    )
