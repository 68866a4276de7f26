"""What passes between a robot and this software: a scan and odometry come, a motion command goes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from .errors import RobotError

FEW_BEAMS, FEW_SHARE = 3, 0.1
"""More returns at exactly the maximum range than both of these are none."""
UNEVEN = 0.05
"""Beams are evenly spaced where each step is the mean one to within this share of it."""


@dataclass(frozen=True)
class Scan:
    """One revolution of the range finder with k beams, in its own frame; `RobotSpec` states where it is mounted.

    Raises RobotError for values that no scan can have. `Scan.ordered` takes beams in the order of a driver.
    """

    bearings_rad: Float[np.ndarray, " k"]
    """Strictly increasing, evenly spaced beam directions, counter-clockwise from straight ahead."""
    ranges_m: Float[np.ndarray, " k"]
    """Range of each beam, as in REP 117: +inf for no return, NaN for an invalid beam, such as one below the minimum
    range."""
    sigma_m: float | Float[np.ndarray, " k"]
    """Standard deviation of the range error, for all beams or for each."""
    range_max_m: float
    """Maximum range: returns beyond it are rejected, and a beam without a return is free up to it."""
    time_s: float
    """Time at which the scan was complete."""
    sigma_share: float = 0.0
    """Additional standard deviation as a share of the range; both add in quadrature."""
    start_s: float = np.nan
    """Time of the first beam; NaN if unknown."""
    resolution_m: float = 0.0
    """Ranges are rounded to multiples of this; 0 if they are not, or by far less than their noise."""

    def __post_init__(self) -> None:
        """Raise RobotError for bearings out of order and for returns that are none."""
        _check_bearings(self.bearings_rad, len(self.ranges_m))
        none = "give +inf for a beam without a return, NaN for one that tells nothing"
        if count := int(np.count_nonzero(self.ranges_m <= 0.0)):
            raise RobotError(f"expected ranges above 0 m, found {count} of {len(self.ranges_m)} at 0 or below: {none}")
        count = int(np.count_nonzero(self.ranges_m == self.range_max_m))
        if count > max(FEW_BEAMS, FEW_SHARE * len(self.ranges_m)):
            raise RobotError(
                f"expected returns, found {count} at exactly the maximum of {self.range_max_m:g} m: {none}"
            )
        if self.start_s > self.time_s:
            raise RobotError(
                f"expected a scan that ends after it began, found {self.start_s:g} s to {self.time_s:g} s:"
                " give both on one clock"
            )
        if not self.range_max_m > 0.0 or not (np.asarray(self.sigma_m) >= 0.0).all():
            raise RobotError(
                "expected a maximum range above 0 m and a noise of 0 m or more, found others: correct them"
            )

    @classmethod
    def ordered(
        cls,
        bearings_rad: Float[np.ndarray, " k"],
        ranges_m: Float[np.ndarray, " k"],
        sigma_m: float | Float[np.ndarray, " k"],
        range_max_m: float,
        time_s: float,
        sigma_share: float = 0.0,
        start_s: float = np.nan,
        range_min_m: float = 0.0,
        resolution_m: float = 0.0,
    ) -> "Scan":
        """Return a scan of evenly spaced beams in either order, from any first bearing; the last may repeat the first.

        Returns below the minimum range, and -inf, are invalid.
        """
        ranges_m = without_near(ranges_m, range_min_m)
        bearings = np.unwrap(bearings_rad)
        beams = np.arange(len(bearings))
        if len(bearings) > 1 and bearings[-1] < bearings[0]:
            beams = beams[::-1]
        if len(beams) > 2 and abs(bearings[-1] - bearings[0]) > 2 * np.pi - 0.5 * abs(bearings[1] - bearings[0]):
            beams = beams[:-1]
        sigma = sigma_m if isinstance(sigma_m, float) else sigma_m[beams]
        return cls(bearings[beams], ranges_m[beams], sigma, range_max_m, time_s, sigma_share, start_s, resolution_m)

    @cached_property
    def passed_m(self) -> Float[np.ndarray, " k"]:
        """How far each beam certainly passed, m: up to its return, or up to the maximum range; 0 if it is invalid.

        Scanners lose single returns, so a beam without one counts as free only if its neighbours have none either.
        """
        before, after = self._beside
        sure = (self.ranges_m == np.inf) & (before == np.inf) & (after == np.inf)
        return np.where(np.isfinite(self.ranges_m), self.ranges_m, np.where(sure, self.range_max_m, 0.0))

    @cached_property
    def shown_m(self) -> Float[np.ndarray, " k"]:
        """How far each beam shows free floor, m; a single missing return takes the nearer range of its neighbours.

        It is 0 for invalid beams.
        """
        before, after = self._beside
        lone = ~np.isfinite(self.ranges_m) & np.isfinite(np.maximum(before, after))
        free = np.where(self.ranges_m == np.inf, self.range_max_m, self.ranges_m)
        shown = np.where(lone, np.minimum(before, after), free)
        return np.where(np.isnan(shown), 0.0, shown)

    @cached_property
    def _beside(self) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Return the ranges of the beams before and after each; +inf beyond the ends of less than a full turn."""
        first, last = (self.ranges_m[0], self.ranges_m[-1]) if self.is_full_turn else (np.inf, np.inf)
        around = np.concatenate([[last], self.ranges_m, [first]])
        return around[:-2], around[2:]

    @cached_property
    def sigmas_m(self) -> Float[np.ndarray, " k"]:
        """Standard deviation of each beam's range error at its measured range, m."""
        sigmas = np.broadcast_to(np.asarray(self.sigma_m, dtype=np.float64), self.ranges_m.shape)
        if self.sigma_share > 0.0:
            sigmas = np.hypot(sigmas, self.sigma_share * np.where(np.isfinite(self.ranges_m), self.ranges_m, 0.0))
        return sigmas if self.resolution_m <= 0.0 else np.hypot(sigmas, self._rounding_m)

    @cached_property
    def _rounding_m(self) -> Float[np.ndarray, " k"]:
        """Return what rounding adds to the standard deviation of each beam, m.

        One error of up to half a step is even over the step. Neighbours that were rounded to one range have one error
        between them, so that each counts for its share of it.
        """
        starts = np.concatenate([[True], self.ranges_m[1:] != self.ranges_m[:-1]])
        run = np.cumsum(starts) - 1
        return self.resolution_m * np.sqrt(np.bincount(run)[run] / 12.0)

    def within(self, reach_m: float) -> "Scan":
        """Return the scan as of a scanner with this maximum range; returns beyond it become free beams.

        Beams without a return become invalid, since glass and black walls do not return any either.
        """
        reach_m = min(reach_m, self.range_max_m)
        ranges_m = np.where(self.ranges_m > reach_m, np.inf, self.ranges_m)
        return replace(self, ranges_m=np.where(np.isposinf(self.ranges_m), np.nan, ranges_m), range_max_m=reach_m)

    @cached_property
    def step_rad(self) -> float:
        """Angle between neighbouring beams."""
        return float((self.bearings_rad[-1] - self.bearings_rad[0]) / (len(self.bearings_rad) - 1))

    @cached_property
    def is_full_turn(self) -> bool:
        """Whether the first beam follows the last one (a 360 degree scanner)."""
        return bool(len(self.bearings_rad) * self.step_rad > 2 * np.pi - 0.5 * self.step_rad)


def without_near(ranges_m: Float[np.ndarray, " k"], range_min_m: float) -> Float[np.ndarray, " k"]:
    """Return ranges m, NaN for those below the scanner's minimum range and for -inf."""
    near = np.isneginf(ranges_m) | (ranges_m < range_min_m)
    return np.where(near, np.nan, ranges_m) if near.any() else ranges_m


def _check_bearings(bearings_rad: Float[np.ndarray, " k"], count: int) -> None:
    """Raise RobotError where beams are not evenly spaced in ascending order over at most one turn."""
    found, todo = "", "`Scan.ordered` puts them in order"
    if len(bearings_rad) != count or count < 2:
        found, todo = f"{len(bearings_rad)} bearings of {count} ranges", "give as many of both, two at least"
    elif not np.isfinite(bearings_rad).all():
        found, todo = "some that are no numbers", "correct them"
    else:
        steps = bearings_rad[1:] - bearings_rad[:-1]
        mean = float(steps.sum()) / (count - 1)
        if mean <= 0.0:
            found = "descending ones"
        elif np.abs(steps - mean).max() > UNEVEN * mean:
            found = f"steps of {np.rad2deg(steps.min()):.3g} to {np.rad2deg(steps.max()):.3g} degrees"
        elif mean * count > 2 * np.pi + 0.5 * mean:
            found = (
                f"{np.rad2deg(mean * (count - 1)):.5g} degrees from the first to the last: a beam stands there twice"
            )
    if found:
        raise RobotError(
            f"expected bearings in ascending order, evenly spaced over a turn at most, found {found}: {todo}"
        )


@dataclass(frozen=True)
class Odometry:
    """Motion since the previous step as the robot measured it, in the robot's frame before the motion.

    Raises RobotError for numbers that are not finite.
    """

    motion: Float[np.ndarray, "3"]
    """x m, y m, heading rad."""
    cov: Float[np.ndarray, "3 3"]
    """Covariance of the motion's error, in the same frame."""
    touched: bool = False
    """Whether a bumper was pressed on the way."""
    by_scans: bool = False
    """Whether scan matching confirmed the motion, so that no unmodelled one is looked for."""
    wheels: "Odometry | None" = None
    """What the wheels reported, if the motion is that of scan matching."""
    carried: bool = False
    """Whether the robot was carried there: between two sessions it is, and that is no path."""

    def __post_init__(self) -> None:
        """Raise RobotError for numbers that are not finite."""
        if not (np.isfinite(self.motion).all() and np.isfinite(self.cov).all()):
            raise RobotError("expected odometry of finite numbers, found others: correct what the wheels report")

    @property
    def reported(self) -> "Odometry":
        """What the wheels reported."""
        return self if self.wheels is None else self.wheels

    @property
    def path_m(self) -> float:
        """Length of the path, m; none where the robot was carried."""
        return 0.0 if self.carried else float(np.hypot(self.motion[0], self.motion[1]))

    @property
    def states_its_error(self) -> bool:
        """Whether a motion has any uncertainty; a rest may have none."""
        return bool((self.cov.diagonal() > 0.0).any()) or not self.motion.any()


@dataclass(frozen=True)
class MotionCommand:
    """One step of driving: an arc of this length, m, and turn, rad."""

    forward_m: float
    turn_rad: float


@runtime_checkable
class Robot(Protocol):
    """Anything that senses and drives step by step: a simulated robot, a recorded one, or real hardware."""

    def sense(self) -> Scan:
        """Return the scan at the present pose."""
        ...

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return its odometry."""
        ...
