"""Where in the whole map a scan may have been taken, without any belief of where the robot is.

Two walls that are not parallel fix a pose. Each pair of the scan's longest segments, laid on each pair of the map's
walls that stand at the same angle, gives one; the pose that lays most of the scan along walls wins, unless another
place is nearly as good: buildings repeat themselves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..extraction.segments import Segments
from ..geometry.lines import directions, normals
from ..geometry.poses import wrap
from ..map.stochastic_map import StochasticMap


@dataclass(frozen=True)
class PlaceSearchConfig:
    """What a place must explain."""

    seeds: int = 4
    """So many of the longest segments begin the search."""
    turn_rad: float = float(np.deg2rad(4.0))
    """A segment lies along a wall if its direction differs by less, ..."""
    across_m: float = 0.15
    """... if both its ends lie nearer to the line, ..."""
    overlap: float = 0.5
    """... and if the wall covers so large a share of it."""
    explained: float = 0.7
    """Share of the length of all segments that a place must explain, ..."""
    least_segments: int = 4
    """... and how many of them."""
    rival: float = 0.8
    """No other place may explain more than this share of what the best one does, ..."""
    apart_m: float = 0.5
    """... where places further apart than this, or than ..."""
    apart_rad: float = float(np.deg2rad(10.0))
    """... this, are others."""


_AT_ONCE = 250_000
"""Pairs of pose and wall that are compared together: more would only take memory."""


def place_of(
    segments: Segments,
    walls: StochasticMap,
    config: PlaceSearchConfig = PlaceSearchConfig(),
    likely_world: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "3"] | None:
    """Return the pose, world frame, from which the map explains a scan; None where none does, or several do.

    A `likely_world` pose is taken where no other explains much more.
    """
    segments = segments.take(np.flatnonzero(~segments.is_tentative))
    if likely_world is not None:
        poses = np.concatenate([likely_world[None], _poses(segments, walls, config)])
    else:
        poses = _poses(segments, walls, config)
    if not len(poses):
        return None
    scores, counts = _scores(segments, walls, poses, config)
    best = int(np.argmax(scores))
    if likely_world is not None and scores[0] >= config.rival * scores[best]:
        return likely_world
    if scores[best] < config.explained * segments.lengths_m.sum() or counts[best] < config.least_segments:
        return None
    apart = np.hypot(*(poses[:, :2] - poses[best, :2]).T) > config.apart_m
    apart |= np.abs(wrap(poses[:, 2] - poses[best, 2])) > config.apart_rad
    if np.any(scores[apart] > config.rival * scores[best]):
        return None
    return np.asarray(poses[best])


def _scores(
    segments: Segments, walls: StochasticMap, poses: Float[np.ndarray, "h 3"], config: PlaceSearchConfig
) -> tuple[Float[np.ndarray, " h"], Int[np.ndarray, " h"]]:
    """Return how many metres of a scan lie along walls at each pose, and how many of its segments."""
    lies = _lies_along(segments, walls, poses, config)
    return lies @ segments.lengths_m, lies.sum(axis=1)


def _poses(segments: Segments, walls: StochasticMap, config: PlaceSearchConfig) -> Float[np.ndarray, "h 3"]:
    """Return the poses that lay two of the longest segments on two walls, from which the walls cover both."""
    longest = np.argsort(-segments.lengths_m, kind="stable")[: config.seeds]
    lines_world = walls.belief.lines_world
    found = [np.zeros((0, 3))]
    for k, i in enumerate(longest):
        for j in longest[k + 1 :]:
            if np.abs(np.sin(segments.lines[i, 0] - segments.lines[j, 0])) > 0.3:
                poses = _laid(segments.lines[[i, j]], lines_world, config)
                both = _lies_along(segments.take(np.array([i, j])), walls, poses, config).all(axis=1)
                found.append(poses[both])
    return np.concatenate(found)


def _laid(
    seen: Float[np.ndarray, "2 2"], lines_world: Float[np.ndarray, "n 2"], config: PlaceSearchConfig
) -> Float[np.ndarray, "h 3"]:
    """Return the poses at which two seen lines, robot frame, lie on two lines of the map that meet at their angle."""
    heading = wrap(lines_world[:, None, 0] - seen[:, 0])
    differ = wrap(heading[:, None, 0] - heading[None, :, 1])
    a, b = np.nonzero(np.abs(differ) < config.turn_rad)
    theta = heading[a, 0] - 0.5 * differ[a, b]
    n_a, n_b = normals(lines_world[a, 0]), normals(lines_world[b, 0])
    r_a, r_b = lines_world[a, 1] - seen[0, 1], lines_world[b, 1] - seen[1, 1]
    det = n_a[:, 0] * n_b[:, 1] - n_a[:, 1] * n_b[:, 0]
    x = (r_a * n_b[:, 1] - r_b * n_a[:, 1]) / det
    y = (r_b * n_a[:, 0] - r_a * n_b[:, 0]) / det
    return np.column_stack([x, y, wrap(theta)])


def _lies_along(
    segments: Segments, walls: StochasticMap, poses: Float[np.ndarray, "h 3"], config: PlaceSearchConfig
) -> Bool[np.ndarray, "h s"]:
    """Return which segments lie along some wall, seen from its free side, at each pose."""
    step = max(_AT_ONCE // max(len(walls), 1), 1)
    parts = [_lie_along(segments, walls, poses[at : at + step], config) for at in range(0, len(poses), step)]
    return np.concatenate([np.zeros((0, len(segments)), dtype=bool), *parts])


def _lie_along(
    segments: Segments, walls: StochasticMap, poses: Float[np.ndarray, "h 3"], config: PlaceSearchConfig
) -> Bool[np.ndarray, "h s"]:
    """Return the same of few enough poses to judge together."""
    belief = walls.belief
    n, t = normals(belief.means[:, 0]), directions(belief.means[:, 0])
    offsets = belief.means[:, 1] + np.vecdot(n, belief.anchors)
    from_anchor = np.vecdot(t, belief.anchors)
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    found = np.zeros((len(poses), len(segments)), dtype=bool)
    for k, (ends, line, length) in enumerate(zip(segments.ends, segments.lines, segments.lengths_m, strict=True)):
        x = cos[:, None] * ends[:, 0] - sin[:, None] * ends[:, 1] + poses[:, :1]
        y = sin[:, None] * ends[:, 0] + cos[:, None] * ends[:, 1] + poses[:, 1:2]
        row, wall = _near(line[0] + poses[:, 2], belief.means[:, 0], config.turn_rad)
        points = np.stack([x[row], y[row]], axis=-1)
        across = np.vecdot(points, n[wall][:, None]) - offsets[wall][:, None]
        along = np.vecdot(points, t[wall][:, None]) - from_anchor[wall][:, None]
        low = np.maximum(along.min(axis=1), walls.extents[wall, 0])
        high = np.minimum(along.max(axis=1), walls.extents[wall, 1])
        lies = (np.abs(across) < config.across_m).all(axis=1) & (high - low > config.overlap * length)
        found[row[lies], k] = True
    return found


def _near(
    alpha_world: Float[np.ndarray, " h"], alpha_walls: Float[np.ndarray, " n"], turn_rad: float
) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Return the pairs of pose and wall at which a segment is turned as the wall is."""
    pose, wall = np.nonzero(np.cos(alpha_world[:, None] - alpha_walls) > np.cos(turn_rad))
    return pose, wall
