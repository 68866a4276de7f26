"""Poses by the wheels over time, asked for any time in between."""

from bisect import bisect_left, bisect_right, insort

import numpy as np
from jaxtyping import Float

from ...geometry.poses import compose, inverse, wrap

HELD_S = 120.0
"""Poses so much older than the newest are forgotten."""
SPARE = 1000
"""As many of them are forgotten at once."""


class OdometryBuffer:
    """Keeps poses by their own times, in whatever order they come."""

    def __init__(self, held_s: float = HELD_S) -> None:
        self._held_s = held_s
        self._times: list[float] = []
        self._poses: dict[float, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self._times)

    @property
    def newest_s(self) -> float:
        """The time up to which the odometry is known; -inf without any."""
        return self._times[-1] if self._times else -np.inf

    def add(self, time_s: float, pose: Float[np.ndarray, "3"]) -> None:
        """Take in a pose; a second one of the same time replaces the first."""
        if time_s not in self._poses:
            insort(self._times, time_s)
        self._poses[time_s] = pose
        old = bisect_left(self._times, self.newest_s - self._held_s)
        if old > SPARE:
            for time in self._times[:old]:
                del self._poses[time]
            del self._times[:old]

    def pose(self, time_s: float) -> Float[np.ndarray, "3"]:
        """Return the pose at a time, the motion being even between two; outside, the nearest. Raises IndexError."""
        after = min(max(bisect_right(self._times, time_s), 1), len(self._times) - 1)
        before_s, after_s = self._times[max(after - 1, 0)], self._times[after]
        first, last = self._poses[before_s], self._poses[after_s]
        share = min(max((time_s - before_s) / (after_s - before_s), 0.0), 1.0) if after_s > before_s else 1.0
        motion = compose(inverse(first), last)
        return compose(first, np.append(share * motion[:2], share * wrap(motion[2])))

    def motion(self, from_s: float, to_s: float) -> Float[np.ndarray, "3"]:
        """Return the motion between two times, in the robot's frame at the first."""
        return compose(inverse(self.pose(from_s)), self.pose(to_s))

    def poses(self, from_s: float, to_s: float) -> Float[np.ndarray, "n 3"]:
        """Return the poses from one time to another: at both, and at all times between that are known."""
        low, high = bisect_right(self._times, from_s), bisect_left(self._times, to_s)
        between = [self._poses[time] for time in self._times[low:high]]
        return np.array([self.pose(from_s), *between, self.pose(to_s)])
