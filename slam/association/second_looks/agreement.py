"""Two maps of one building laid on each other: which of their walls are one, and where that puts one on the other."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ...geometry.lines import directions, normals
from ...geometry.poses import J, to_world, turned, wrap
from ...map.kernels import wall_kernels

GATE = 9.21
"""Squared Mahalanobis distance up to which two walls may be one: 0.99 of chi-square with two degrees of freedom."""
TURN_RAD = float(np.deg2rad(5.0))
"""Largest angle between two walls that may be one."""
OVERLAP_M = 0.3
"""Smallest overlap of two walls that may be one."""
ROUNDS = 5
"""Walls are paired so often, each time from the place that the last pairs gave."""


@dataclass(frozen=True)
class Walls:
    """The walls of a map, n of them, world frame, with their covariance."""

    anchors: Float[np.ndarray, "n 2"]
    lines: Float[np.ndarray, "n 2"]
    """(alpha rad, d m) about the anchors."""
    extents: Float[np.ndarray, "n 2"]
    cov: Float[np.ndarray, "k k"]
    """Of all lines, k = 2 n."""

    def __len__(self) -> int:
        return len(self.lines)

    @cached_property
    def ends(self) -> Float[np.ndarray, "n 2 2"]:
        """Both ends of each."""
        return np.asarray(wall_kernels.ends_world(self.anchors, self.lines, self.extents))

    @property
    def lengths(self) -> Float[np.ndarray, " n"]:
        """The length of each, m."""
        return self.extents[:, 1] - self.extents[:, 0]


@dataclass(frozen=True)
class Agreement:
    """Where one map lies on another by the walls that both have."""

    place: Float[np.ndarray, "3"]
    """Of the one map's frame in the other one, m m rad."""
    cov: Float[np.ndarray, "3 3"]
    pairs: int = 0
    """So many walls are one."""
    chi2: float = 0.0
    """Squared error of all pairs together by the covariance of both maps, of twice their number less three degrees."""


@dataclass(frozen=True)
class _Pairs:
    """Walls of two maps, p pairs of them, each with a point where both should lie."""

    saved: Int[np.ndarray, " p"]
    own: Int[np.ndarray, " p"]
    at: Float[np.ndarray, "p 2"]

    def __len__(self) -> int:
        return len(self.saved)

    def take(self, rows: np.ndarray) -> "_Pairs":
        return _Pairs(self.saved[rows], self.own[rows], self.at[rows])


@dataclass(frozen=True)
class _Misfit:
    """How far the walls of p pairs are from each other, angle and offset, and the derivatives of that."""

    e: Float[np.ndarray, "p 2"]
    by_saved: Float[np.ndarray, "p 2 2"]
    by_own: Float[np.ndarray, "p 2 2"]
    by_place: Float[np.ndarray, "p 2 3"]


def agreed(saved: Walls, own: Walls, place: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> Agreement:
    """Return where a map lies on a saved one, from a place that a search found and the covariance of that.

    Walls are paired one to one by the covariance of both maps and of the place. Two maps err independently.
    """
    found = Agreement(place, cov)
    for _ in range(ROUNDS):
        pairs = _paired(saved, own, found.place, found.cov)
        if not len(pairs):
            break
        found = _solved(saved, own, pairs, found.place, place, cov)
    return found


def _paired(saved: Walls, own: Walls, place: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> _Pairs:
    """Return the walls that may be one, each in one pair at most: the most likely ones first."""
    turn = wrap(own.lines[:, 0] + place[2] - saved.lines[:, :1])
    i, j = np.nonzero(np.abs(turn) < TURN_RAD)
    t = directions(saved.lines[i, 0])
    along = np.sort(np.vecdot(t[:, None], to_world(own.ends[j], place) - saved.anchors[i, None]), axis=1)
    low, high = np.maximum(along[:, 0], saved.extents[i, 0]), np.minimum(along[:, 1], saved.extents[i, 1])
    feet = saved.anchors[i] + saved.lines[i, 1:] * normals(saved.lines[i, 0])
    pairs = _Pairs(i, j, feet + 0.5 * (low + high)[:, None] * t).take(high - low > OVERLAP_M)
    misfit = _misfit(saved, own, pairs, place)
    by = (misfit.by_saved, misfit.by_own, misfit.by_place)
    covs = (_blocks(saved.cov, pairs.saved), _blocks(own.cov, pairs.own), cov)
    S = sum(G @ P @ G.transpose(0, 2, 1) for G, P in zip(by, covs, strict=True))
    d2 = np.vecdot(misfit.e, np.linalg.solve(S, misfit.e[..., None])[..., 0])
    kept: list[int] = []
    taken_saved, taken_own = set[int](), set[int]()
    for row in np.argsort(d2):
        if d2[row] > GATE:
            break
        if pairs.saved[row] not in taken_saved and pairs.own[row] not in taken_own:
            taken_saved.add(int(pairs.saved[row]))
            taken_own.add(int(pairs.own[row]))
            kept.append(int(row))
    return pairs.take(np.array(kept, dtype=np.int64))


def _misfit(saved: Walls, own: Walls, pairs: _Pairs, place: Float[np.ndarray, "3"]) -> _Misfit:
    """Return how far walls are from each other: one direction from the other, and across, where they overlap."""
    line, mine = saved.lines[pairs.saved], own.lines[pairs.own]
    alpha, anchor = mine[:, 0] + place[2], to_world(own.anchors[pairs.own], place)
    n, t, ours, along = normals(line[:, 0]), directions(line[:, 0]), normals(alpha), directions(alpha)
    from_saved, from_own = pairs.at - saved.anchors[pairs.saved], pairs.at - anchor
    offset = np.vecdot(ours, from_own) - mine[:, 1] - np.vecdot(n, from_saved) + line[:, 1]
    by_saved, by_own, by_place = (np.zeros((len(pairs), 2, k)) for k in (2, 2, 3))
    by_saved[:, 0, 0], by_saved[:, 1, 0], by_saved[:, 1, 1] = -1.0, -np.vecdot(t, from_saved), 1.0
    by_own[:, 0, 0], by_own[:, 1, 0], by_own[:, 1, 1] = 1.0, np.vecdot(along, from_own), -1.0
    by_place[:, 0, 2], by_place[:, 1, :2] = 1.0, -ours
    by_place[:, 1, 2] = np.vecdot(along, pairs.at - place[:2])
    return _Misfit(np.column_stack([wrap(alpha - line[:, 0]), offset]), by_saved, by_own, by_place)


def _blocks(cov: Float[np.ndarray, "k k"], rows: Int[np.ndarray, " p"]) -> Float[np.ndarray, "p 2 2"]:
    at = 2 * rows[:, None] + np.arange(2)
    return np.asarray(cov[at[:, :, None], at[:, None, :]])


def _solved(
    saved: Walls,
    own: Walls,
    pairs: _Pairs,
    start: Float[np.ndarray, "3"],
    prior: Float[np.ndarray, "3"],
    prior_cov: Float[np.ndarray, "3 3"],
) -> Agreement:
    """Return the place at which pairs fit best, by the joint covariance of either map; linearised at a start."""
    misfit = _misfit(saved, own, pairs, start)
    S = _together(saved.cov, pairs.saved, misfit.by_saved) + _together(own.cov, pairs.own, misfit.by_own)
    e, H = misfit.e.ravel(), misfit.by_place.reshape(-1, 3)
    before = start - prior
    before[2] = wrap(before[2])
    told = np.linalg.solve(S, np.column_stack([H, e]))
    cov = np.linalg.inv(H.T @ told[:, :3] + np.linalg.inv(prior_cov))
    change = -cov @ (H.T @ told[:, 3] + np.linalg.solve(prior_cov, before))
    left = e + H @ change
    place = start + change
    place[2] = wrap(place[2])
    return Agreement(place, 0.5 * (cov + cov.T), len(pairs), float(left @ np.linalg.solve(S, left)))


def _together(
    cov: Float[np.ndarray, "k k"], rows: Int[np.ndarray, " p"], by: Float[np.ndarray, "p 2 2"]
) -> Float[np.ndarray, "q q"]:
    """Return the covariance of the misfits of all pairs by that of the lines of one map."""
    at = 2 * rows[:, None] + np.arange(2)
    blocks = cov[at[:, None, :, None], at[None, :, None, :]]
    found = by[:, None] @ blocks @ by[None].transpose(0, 1, 3, 2)
    return np.asarray(found.transpose(0, 2, 1, 3).reshape(2 * len(rows), 2 * len(rows)))


def about(cov: Float[np.ndarray, "3 3"], place: Float[np.ndarray, "3"], at: Float[np.ndarray, "2"]) -> np.ndarray:
    """Return the covariance of a map's place where `cov` is that of a pose at a point of the map, saved map's axes."""
    arm = turned(np.atleast_2d(at), np.array([place[2]]))[0]
    move = np.eye(3)
    move[:2, 2] = -(arm @ J.T)
    return np.asarray(move @ cov @ move.T)
