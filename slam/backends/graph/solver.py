"""Poses and lines on their way to the least-squares solution, step by step.

Here the first pose is the origin. What is entered is collected, and handed over when `settle` is called.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import chdtri

from ...geometry.poses import compose
from .ahead import Ahead
from .config import GraphConfig
from .factors import line_factor, line_key, odometry_factor, origin_factor
from .isam import Isam
from .kernels import guess, moved_lines
from .loose import Loose, wrapped
from .record import Record, as_seen


class DivergedError(RuntimeError):
    """A solution is not finite, or is where the prediction rules it out: the next one would be linearised nowhere."""


class Solver:
    """Poses, the lines shown (those whose estimates are asked for, in ascending order of ids) and iSAM2."""

    def __init__(
        self,
        config: GraphConfig,
        record: Record,
        poses: Float[np.ndarray, "p 3"],
        lines: Float[np.ndarray, "n 2"],
        anew: bool = True,
    ) -> None:
        """Make the graph of a record, linearised at `poses` and, in the order of the record, at `lines`.

        With `anew` the observations are linearised there too, else as the record has it.
        """
        self._config, self._record = config, record
        self._thresholds = np.array([config.relinearise_angle_rad, config.relinearise_place_m])
        self._linear = self._thresholds[[1, 1, 0]]
        """The same of a pose (x, y, heading)."""
        self._beyond = float(chdtri(3, config.diverged_chance))
        """A pose may depart by this much, in chi-square, from where it was expected."""
        self.isam = Isam(config)
        self._loose = Loose(config.loose, config.loose_sigmas)
        self._is_settled = False
        self._pose_cov = np.zeros((0, 0))
        self._keys: list[int] = []
        self.ids = np.zeros(0, dtype=np.int64)
        """The lines shown."""
        self.lines = np.zeros((0, 2))
        """Their (alpha, r)."""
        self._linearised_at = np.zeros((0, 2))
        self._astray = np.zeros(0)
        """How far each line is from where it is linearised, in thresholds."""
        self.pose = np.array(poses[0], dtype=np.float64)
        """The last pose entered: predicted until it is settled."""
        self.last = 0
        """Index of that pose."""
        self._settled_at = -1
        """Index of the last pose that is settled."""
        self._ahead = Ahead(self.pose)
        """Where the odometry alone leads from there."""
        self._expected_cov = np.zeros((0, 0))
        """Covariance of the last settled pose before the present solution, body frame; empty before the first."""

        self.isam.enter(origin_factor())
        self.isam.enter_pose(0, self.pose)
        for pose in poses[1:]:
            self.enter_pose(pose)
        for (line, known), (alpha, r) in zip(record.lines.items(), lines.tolist(), strict=True):
            self.isam.enter_line(line, alpha, r)
            for number in known.observations:
                epsilon = wrapped(record.seen[number][0] - alpha + float(poses[record.seen_from[number], 2]))
                self.enter_observation(line, number, epsilon if anew else record.epsilons[number], alpha)
        self._show(list(record.lines), lines)
        self.hide(np.flatnonzero([not known.shown for known in record.lines.values()]))

    # -- entering ---------------------------------------------------------------------------------------------------

    def enter_poses(self) -> None:
        """Make all motions of the record poses of the graph."""
        for motion in self._record.motions[self.last :]:
            self.enter_pose(compose(self.pose, motion))

    def enter_pose(self, pose: Float[np.ndarray, "3"]) -> None:
        """Enter the next motion of the record; it leads about to `pose`."""
        self.pose, self.last = np.array(pose, dtype=np.float64), self.last + 1
        self.isam.enter_pose(self.last, self.pose)
        motion, cov = self._record.motions[self.last - 1], self._record.motion_covs[self.last - 1]
        self.isam.enter(odometry_factor(self.last, motion, cov))
        self._ahead.move(motion, cov)
        self._is_settled = False

    def enter_scan(
        self, rows: Int[np.ndarray, " m"], seen: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"]
    ) -> None:
        """Enter observations of lines shown, from the last pose; a new pose is linearised where they put it."""
        if self.last and self.isam.is_new(self.last):
            motion, motion_cov = self._record.motions[self.last - 1], self._record.motion_covs[self.last - 1]
            self.pose = guess(self.pose, motion, motion_cov, self.lines[rows], seen, cov)
            self.isam.move_pose(self.last, self.pose)
        heading = float(self.pose[2])
        lines, alphas, plain = self.ids[rows].tolist(), self.lines[rows, 0].tolist(), as_seen(seen, cov)
        for k in np.lexsort((seen[:, 1], seen[:, 0], rows)).tolist():
            number = self._record.see(self.last, lines[k], plain[k])
            self.enter_observation(lines[k], number, wrapped(plain[k][0] - alphas[k] + heading), alphas[k])

    def enter_lines(
        self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"], seen: Float[np.ndarray, "m 2"],
        cov: Float[np.ndarray, "m 2 2"],
    ) -> None:  # fmt: skip
        """Enter new lines of the record, each with its first observation, from the last pose."""
        for line, (alpha, r), plain in zip(ids, lines.tolist(), as_seen(seen, cov), strict=True):
            self.isam.enter_line(line, alpha, r)
            self.enter_observation(line, self._record.see(self.last, line, plain), 0.0, alpha)
        self._show(ids, lines)

    def enter_observation(self, line: int, number: int, epsilon: float, alpha: float, again: bool = False) -> None:
        """Enter an observation that departs by `epsilon` from its line, which has the direction `alpha`.

        With `again` it replaces an earlier factor of the same observation.
        """
        seen = self._record.seen[number]
        most = self._config.most_turn_rad
        epsilon = self._record.epsilons[number] = min(max(epsilon, -most), most)
        self.isam.enter(line_factor(self._record.seen_from[number], line, seen, epsilon), number)
        self._loose.note(line, number, seen, alpha, again)
        self._is_settled = False

    def leave_observations(self, line: int, numbers: Sequence[int]) -> None:
        """Take the factors of a line's observations out; all must be settled. A line with none left drops out too."""
        for number in numbers:
            self.isam.leave(number)
            self._loose.leave(line, number)
        self._is_settled = False

    def hide(self, rows: Int[np.ndarray, " m"]) -> None:
        """No longer show the lines in these rows."""
        for line in self.ids[rows].tolist():
            self.isam.forget(line)
            self._loose.drop(line)
        kept = np.ones(len(self.ids), dtype=bool)
        kept[rows] = False
        self.ids, self.lines = self.ids[kept], self.lines[kept]
        self._linearised_at, self._astray = self._linearised_at[kept], self._astray[kept]
        self._keys = [line_key(line) for line in self.ids.tolist()]

    def _show(self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"]) -> None:
        self.ids = np.concatenate([self.ids, np.asarray(ids, dtype=np.int64)])
        self._keys += [line_key(line) for line in ids]
        self.lines = np.concatenate([self.lines, lines])
        self._linearised_at = np.concatenate([self._linearised_at, lines])
        self._astray = np.concatenate([self._astray, np.zeros(len(ids))])

    # -- solving ----------------------------------------------------------------------------------------------------

    def settle(self) -> None:
        """Solve for what was entered since the last time.

        Raises DivergedError for a solution that the prediction rules out, and what GTSAM raises: RuntimeError,
        ValueError or IndexError. The points of linearisation are then those of the last solution that held.
        """
        if self._is_settled:
            return
        self._expected_cov = self.pose_cov() if self._settled_at >= 0 else np.zeros((0, 0))
        self._tighten(self._astray > 1.0)
        self._push()
        for _ in range(self._config.passes):
            far = self._astray > self._config.closure
            if not self._tighten(far) and not np.any(far):
                break
            self._push()
        if self.isam.is_waiting:
            self._push()
        self._loose.calm()
        self._is_settled, self._settled_at, self._ahead = True, self.last, Ahead(self.pose)

    def _push(self) -> None:
        """Hand over what was collected, linearise anew what is astray, and estimate."""
        astray = np.flatnonzero(self._astray > 1.0)
        self.isam.push(self.last, relinearise=bool(len(astray)))
        self.pose = self.isam.pose(self.last)
        self._pose_cov = np.zeros((0, 0))  # Asked of iSAM2 when wanted.
        self._hold_pose()
        if not self._keys:
            return
        self._linearised_at[astray] = self.isam.lines([self._keys[row] for row in astray.tolist()])
        moved, most = self.isam.moved(self._keys), self._config.most_turn_rad
        lines, self._astray, farthest = moved_lines(self._linearised_at, moved, self._thresholds)
        if not farthest <= most:
            raise DivergedError(
                f"expected lines that turn by less than {most:g} rad at once, found one that turns further"
            )
        self.lines = lines

    def _hold_pose(self) -> None:
        """Hold the pose against its prediction; raises DivergedError where both cannot be.

        Within a few thresholds of linearisation any solution is as good as its factors, whatever was expected.
        """
        off = self.pose - self._ahead.pose
        off[2] = wrapped(float(off[2]))
        beyond = float(np.sum(np.square(off / self._linear)))
        if self._beyond < beyond < np.inf:
            if not len(self._expected_cov):  # The first solution of a graph made anew: nothing was expected.
                return
            cov = np.diag(self._linear**2) + self._ahead.pose_cov(self._expected_cov)
            beyond = float(off @ np.linalg.solve(cov, off))
        if not beyond <= self._beyond:
            raise DivergedError(
                f"expected a pose within chi-square {self._beyond:.0f} of its prediction, found {beyond:.3g}"
            )

    def _tighten(self, anew: Bool[np.ndarray, " n"]) -> int:
        """Collect anew the observations that their line's present direction puts wrong; return how many.

        Of the lines that are linearised `anew` these are all loose ones: where a line follows a turn and some of its
        observations do not, each solution undoes the one before it, in every step from then on.
        """
        count, again = 0, set(self.ids[anew].tolist())
        for line, numbers in self._loose.touched(again).items():
            alpha = float(self.lines[int(np.searchsorted(self.ids, line)), 0])
            for number in self._loose.suspects(line, numbers, alpha, line in again):
                if not self.isam.holds(number):  # It is on its way in, linearised at this direction.
                    continue
                index, seen = self._record.seen_from[number], self._record.seen[number]
                heading = float(self.pose[2] if index == self.last else self.isam.pose(index)[2])
                epsilon = wrapped(seen[0] - alpha + heading)
                off = abs(epsilon - self._record.epsilons[number])
                if off > (0.0 if line in again else self._loose.turn(seen)):
                    self.leave_observations(line, [number])
                    self.enter_observation(line, number, epsilon, alpha, again=True)
                    count += 1
        return count

    # -- asking -----------------------------------------------------------------------------------------------------

    def poses(self) -> Float[np.ndarray, "p 3"]:
        """Return the estimates of all poses when it was settled."""
        return self.isam.all().poses(self.last + 1)

    def all_lines(self) -> Float[np.ndarray, "n 2"]:
        """Return the estimates of all lines of the record, shown or not."""
        return self.isam.all().lines(list(self._record.lines))

    def start(self) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "n 2"]]:
        """Return where to begin anew: the points of linearisation of all that was entered, settled or not."""
        values = self.isam.linearisation()
        return values.poses(self.last + 1), values.lines(list(self._record.lines))

    def pose_cov(self) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of the last pose that is settled, body frame."""
        if not len(self._pose_cov):
            self._pose_cov = self.isam.pose_cov(self._settled_at)
        return self._pose_cov

    def joint_cov(self, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of the last pose (body frame) and the lines (alpha, r) in these rows, by one query."""
        if not len(rows):
            return self.pose_cov().copy()
        return self.isam.joint_cov(self.last, [self._keys[row] for row in rows.tolist()])
