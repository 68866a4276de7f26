"""The search for places that the robot came back to, along the whole drive.

A submap of the last metres is laid onto old ones, as far around as the path may have drifted since: a share of it, or
after a long way what the covariance of the pose graph allows. A place is believed where two searches agree, after a
long way where three do. Where a scan does not fit those before it, the robot has slipped: all turns about that place
are tried then, from either side of it and whenever the robot comes by again.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ...geometry.poses import J, compose, inverse, turned, wrap
from ..place_search import Place, Window, apart, place_on
from .closures import Closure, Drive, settled
from .config import SecondLooksConfig
from .submaps import Returns

SLIP_M = 1e4
"""The way over a slip: longer than any other, so that the shortest way tells how many slips are on it."""
NEAR_M = 0.1
"""The way over a closure."""


@dataclass(frozen=True)
class Candidate:
    """An old scan to which the robot may have come back, and where to seek it."""

    old: int
    window: Window
    drift: Float[np.ndarray, "3 3"] | None = None
    """Covariance of the pose as seen from the old scan, world axes, if the way between them is long."""


class LoopSearch:
    """Follows a drive scan by scan, closes its loops, and keeps the poses that agree with them so far."""

    def __init__(
        self,
        start_world: Float[np.ndarray, "3"],
        drive: Drive,
        returns: Returns,
        config: SecondLooksConfig,
        goes_on: Callable[[float], bool] = lambda share: True,
    ) -> None:
        motions = drive.motions
        self.poses = np.tile(start_world, (len(motions) + 1, 1))
        self.closures: list[Closure] = []
        self._motions, self._driven = motions.copy(), drive
        self._returns, self._config = returns, config
        self._slipped: list[int] = []
        self._found: list[Closure] = []
        """What the searches found, believed or not."""
        self._asked_far = 0.0
        self._ways = np.append(0.0, np.cumsum(np.hypot(*motions[:, :2].T)))
        asked, searches = 0.0, True
        for k in range(1, len(self.poses)):
            self._go_to(k)
            if searches and self._ways[k] - asked >= config.closures.every_m:
                asked = self._ways[k]
                self._look(k)
                searches = goes_on(k / len(self.poses))

    @property
    def drive(self) -> Drive:
        """The motions, those of slips as closures tell them."""
        return replace(self._driven, motions=self._motions, slipped=self._slipped)

    @property
    def _breaks(self) -> list[int]:
        """The scans that do not go on from the one before: after slips, and where the robot was carried."""
        return sorted([*self._slipped, *self._driven.carried])

    def _go_to(self, scan: int) -> None:
        c = self._config.closures
        self.poses[scan] = compose(self.poses[scan - 1], self._motions[scan - 1])
        before = range(self._since(scan, scan - c.fit_scans), scan)
        if self._returns.fit(scan, before, self.poses) < c.slip_fit:
            self._slipped.append(scan)

    def _since(self, scan: int, first: int) -> int:
        """Return the first of the scans from one on that go on up to another without a break."""
        return max([first, 0, *(k for k in self._breaks if k <= scan)])

    def _look(self, new: int) -> None:
        """Seek the place of a scan among old ones; take it in if it agrees with one found before."""
        place = self._place(new)
        if place is None:
            return
        found, candidate = place
        # What is sought far around has more places to be mistaken for.
        needed = 1 if candidate.drift is None else self._config.closures.far_agree - 1
        partners = [each for each in reversed(self._found) if self._agree(each, found)][:needed]
        self._found.append(found)
        if len(partners) == needed and (self._is_known(found) or self._is_alone(found, candidate)):
            self.closures += [each for each in (*partners, found) if each not in self.closures]
            self._settle(found)

    def _query(self, new: int) -> Float[np.ndarray, "n 2"]:
        """Return the latest returns up to a scan, in its frame."""
        first = int(np.searchsorted(self._ways, self._ways[new] - self._config.closures.query_m))
        return self._returns.seen_from(range(self._since(new, first), new + 1), self.poses, new)

    def _place(self, new: int) -> tuple[Closure, Candidate] | None:
        """Return where a scan was taken, as seen from the old scans on which it lies best, and how it was sought.

        None if there are rivals.
        """
        c, points = self._config.closures, self._query(new)
        if len(points) < c.least_points:
            return None
        found: list[tuple[Place, Candidate]] = []
        for each in self._candidates(new):
            around = self._around(each, new)
            place = place_on(self._returns.surface(around, self.poses), points, each.window, c.place)
            if place is not None:
                found.append((place, each))
        if not found:
            return None
        best, at = max(found, key=lambda each: each[0].score)
        others = [each.score for each, _ in found if apart(each.pose[None], best.pose, c.place)[0]]
        if not replace(best, rival=max([best.rival, *others])).is_right(c.place):
            return None
        if at.drift is not None and not self._allows(at.drift, best.pose - at.window.guess):
            return None
        around = self._around(at, new)
        old = around[int(np.argmin(np.hypot(*(self.poses[around, :2] - best.pose[:2]).T)))]
        return Closure(old, new, compose(inverse(self.poses[old]), best.pose)), at

    def _is_known(self, closure: Closure) -> bool:
        """Return whether a closure is what the poses say already."""
        c = self._config.closures
        off = compose(inverse(self.poses[closure.new]), compose(self.poses[closure.old], closure.motion))
        return bool(np.hypot(*off[:2]) < 0.5 * c.agree_m and abs(off[2]) < 0.5 * c.agree_rad)

    def _is_alone(self, closure: Closure, candidate: Candidate) -> bool:
        """Return whether no other place is nearly as good twice as far around: a bare corridor fits itself anywhere."""
        c, window = self._config.closures, candidate.window
        wide = replace(candidate, window=replace(window, half_m=2.0 * window.half_m))
        surface = self._returns.surface(self._around(wide, closure.new), self.poses)
        place = place_on(surface, self._query(closure.new), wide.window, c.place)
        put = compose(self.poses[closure.old], closure.motion)
        return place is not None and place.is_right(c.place) and not apart(place.pose[None], put, c.place)[0]

    def _allows(self, drift: Float[np.ndarray, "3 3"], off: Float[np.ndarray, "3"]) -> bool:
        """Return whether a pose may be off by so much: a closure there raises chi-square by no more than it may."""
        c = self._config.closures
        floor = np.diag(np.square([c.radius_m, c.radius_m, c.turn_rad]) / c.far_sigmas**2)
        off = np.array([*off[:2], wrap(off[2])])
        return bool(off @ np.linalg.solve(drift + floor, off) < c.far_sigmas**2)

    def _around(self, candidate: Candidate, new: int) -> range:
        """Return the scans about an old one that may have seen the place, up to the next slip on either side."""
        c, old = self._config.closures, candidate.old
        beside_m = max(c.beside_m, candidate.window.half_m)
        first, last = np.searchsorted(self._ways, self._ways[old] + np.array([-beside_m, beside_m]))
        low = self._since(old, int(first))
        high = min([int(last), new - c.recent // 2, *(k for k in self._breaks if k > old)])
        return range(low, max(high, old + 1))

    def _candidates(self, new: int) -> list[Candidate]:
        """Return the old scans to which this one may have come back, and where to seek it."""
        c = self._config.closures
        ways, before = self._shortest_ways(new)
        slips, ways = np.divmod(ways, SLIP_M)
        scans = np.arange(new)
        radius = c.radius_m + c.radius_share * ways
        turn = np.where(slips > 0, np.pi, np.minimum(c.turn_rad + c.turn_a_metre * ways, c.most_rad))
        lever = 0.0
        for count, slip in enumerate(reversed(self._slipped), 1):
            # Each slip turns all that came after it about where it happened.
            lever = 2.0 * lever + 2.0 * float(np.hypot(*(self.poses[new] - self.poses[slip])[:2]))
            radius[(slips == count) & (scans < slip)] += lever
        away = np.hypot(*(self.poses[new, :2] - self.poses[:new, :2]).T)
        may = (scans < new - c.recent) & (ways > c.way_m) | (slips > 0)
        far = radius > c.far_m
        may &= ~far | (slips == 0) & (self._ways[new] - self._asked_far >= 2.0 * c.every_m)
        drift = self._drift(new, before) if np.any(may & far) else np.zeros((new, 3, 3))
        radius[far] = c.radius_m + c.far_sigmas * np.sqrt(np.linalg.eigvalsh(drift[far, :2, :2])[:, 1])
        turn[far] = np.minimum(c.turn_rad + c.far_sigmas * np.sqrt(drift[far, 2, 2]), np.pi)
        rows = np.flatnonzero(may & (away < radius + c.radius_m))
        stretches = np.split(rows, np.flatnonzero(np.diff(self._ways[rows]) > c.beside_m) + 1)
        nearest = sorted((int(s[np.argmin(away[s])]) for s in stretches if len(s)), key=lambda row: away[row])
        nearest = nearest[: c.places]
        if far[nearest].any():
            self._asked_far = self._ways[new]
        return [
            Candidate(
                k,
                Window(self.poses[new].copy(), float(radius[k]), float(turn[k])),
                drift[k] if far[k] else None,
            )
            for k in nearest
        ]

    def _shortest_ways(self, new: int) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
        """Return the way from each earlier scan to one, over motions and closures, and the next scan on it."""
        lengths = np.maximum(np.diff(self._ways[: new + 1]), 1e-6)
        lengths[np.array(self._slipped, dtype=np.int64) - 1] += SLIP_M
        closed = np.array([(each.old, each.new) for each in self.closures], dtype=np.int64).reshape(-1, 2)
        rows, columns = (np.concatenate([np.arange(new) + k, closed[:, k]]) for k in range(2))
        values = np.concatenate([lengths, np.full(len(closed), NEAR_M)])
        graph = coo_array((values, (rows, columns)), shape=(new + 1, new + 1)).tocsr()
        ways, nexts = dijkstra(graph, directed=False, indices=np.array([new]), return_predecessors=True)
        return ways[0, :new], nexts[0, :new].astype(np.int64)

    def _drift(self, new: int, nexts: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 3 3"]:
        """Return the covariance of a pose as seen from each earlier one, world axes; `nexts` leads from one to it."""
        c, scans = self._config, np.arange(new)
        covs = np.tile(np.diag(np.square([c.closures.sigma_m, c.closures.sigma_m, c.closures.sigma_rad])), (new, 1, 1))
        driven = np.abs(nexts - scans) == 1
        motions = np.minimum(nexts, scans)[driven]
        back = np.tile(np.eye(3), (len(motions), 1, 1))
        back[:, :2, :2] = turned(back[:, :2, :2], self.poses[motions, 2])
        covs[driven] = back.transpose(0, 2, 1) @ self._driven.believed(c)[motions] @ back
        # An error of the heading there moves the pose by its lever.
        move = np.tile(np.eye(3), (new, 1, 1))
        move[:, :2, 2] = (self.poses[new, :2] - self.poses[:new, :2]) @ J.T
        found = np.concatenate([move @ covs @ move.transpose(0, 2, 1), np.zeros((1, 3, 3))])
        # Sums along all ways at once: each round doubles how far ahead of it a scan has added up.
        ahead = np.append(nexts, new)
        while np.any(ahead != new):
            found, ahead = found + found[ahead], ahead[ahead]
        return found[:new]

    def _agree(self, one: Closure, other: Closure) -> bool:
        """Return whether two closures put the robot at the same place, by its motion between them."""
        c = self._config.closures
        low, high = 2.0 * c.every_m, c.query_m
        if not low <= self._ways[other.new] - self._ways[one.new] <= high:
            return False
        if any(one.new < k <= other.new for k in self._breaks):
            return False
        between = compose(inverse(self.poses[one.new]), self.poses[other.new])
        off = compose(compose(self.poses[one.old], one.motion), between)
        off -= compose(self.poses[other.old], other.motion)
        return bool(np.hypot(*off[:2]) < c.agree_m and abs(wrap(off[2])) < c.agree_rad)

    def _settle(self, last: Closure) -> None:
        """Bring the poses so far into agreement with all closures, if the last one is not what they say already."""
        new, put = last.new, compose(self.poses[last.old], last.motion)
        if self._is_known(last):
            return
        between = [k for k in self._slipped if last.old < k <= new]
        if between:
            slip, moved = between[-1], compose(put, inverse(self.poses[new]))
            self.poses[slip : new + 1] = [compose(moved, pose) for pose in self.poses[slip : new + 1]]
            self._motions[slip - 1] = compose(inverse(self.poses[slip - 1]), self.poses[slip])
        carried = [k for k in self._driven.carried if k <= new]
        so_far = Drive(self._motions[:new], self._driven.covs[:new], self._slipped, carried)
        self.poses[: new + 1] = settled(self.poses[: new + 1], so_far, self.closures, self._config)
