"""What is left to go by where a segment may be of either of two walls, and nothing else tells where the robot is.

One long wall that stands in the map twice, 0.1 m and half a degree apart, was enough to lose ten degrees beside it: no
observation could tell which of the two it was of, and odometry alone led on. Either of the two is a far better guide.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Joint, Observations
from ..estimation.models import lines_robot
from ..extraction.segments import Segments
from ..geometry.lines import normals
from .matching import Matches


@dataclass(frozen=True)
class AmbiguityConfig:
    """When two walls are so alike that taking the one for the other does little harm."""

    turn_rad: float = float(np.deg2rad(2.0))
    """Largest difference in direction: the wheels lose as much in 0.2 m."""
    across_m: float = 0.2
    """Largest distance between the two, at both ends of the segment."""


def observed_either_way(
    matches: Matches,
    segments: Segments,
    ids: Int[np.ndarray, " n"],
    joint: Joint,
    config: AmbiguityConfig = AmbiguityConfig(),
) -> tuple[Int[np.ndarray, " k"], Observations]:
    """Return the segments that may be of either of two walls, and observations of the likelier, with more noise.

    What is added is what lies between the two (a mixture of two Gaussians, taken for one). `joint` is that of the walls
    `ids`, ascending.
    """
    segment, likelier, rival = matches.ambiguous.T
    means = joint.mean[3:].reshape(-1, 2)
    one, other = (
        lines_robot(joint.mean[:3], joint.anchors[rows], means[rows])
        for rows in (np.searchsorted(ids, likelier), np.searchsorted(ids, rival))
    )
    turn = np.sin(other[:, 0] - one[:, 0])
    across = _across(segments.ends[segment], other) - _across(segments.ends[segment], one)
    alike = (np.abs(turn) <= config.turn_rad) & np.all(np.abs(across) <= config.across_m, axis=1)
    between = np.column_stack([turn, other[:, 1] - one[:, 1]])[alike]
    kept = segment[alike]
    spread = between[:, :, None] * between[:, None, :]
    return kept, Observations(likelier[alike], segments.lines[kept], segments.cov[kept] + spread)


def _across(ends: Float[np.ndarray, "t 2 2"], lines: Float[np.ndarray, "t 2"]) -> Float[np.ndarray, "t 2"]:
    """Return how far both ends of each segment lie beyond its line, robot frame, m."""
    return np.asarray(np.vecdot(ends, normals(lines[:, 0])[:, None]) - lines[:, 1:])
