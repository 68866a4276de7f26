"""What stands between a robot's scans and the map: the robot's own body, and errors of ranges that are found out."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Backend, Belief
from ...extraction.segments import Segments
from ...robot import Odometry, RobotSpec, Scan
from .bias import RangeBias
from .calibrated_backend import CalibratedBackend, Taken
from .errors import RangeErrors, RangesConfig
from .own_body import OwnBody
from .scale import RangeScale

Pieces = Callable[[Scan], Segments]
"""Finds the straight pieces of a scan."""


@dataclass(frozen=True)
class Heard:
    """A scan as the map takes it in."""

    scan: Scan
    sensed: Scan
    """The same with its ranges as they came; the robot's own body is in neither."""
    own_beams: int
    """So many of its beams ended on the robot itself, and tell nothing."""
    bias_m: float
    """What was taken from its ranges; they were shortened by a scale, too, where one is taken out."""


class Ranges:
    """Watches a scanner's ranges, and takes out of them what is wrong where the robot says so (`LidarSpec`)."""

    def __init__(self, backend: Backend, robot: RobotSpec, config: RangesConfig, pieces: Pieces) -> None:
        self._backend = backend if isinstance(backend, CalibratedBackend) else None
        self._taken = Taken() if self._backend is None else self._backend.taken
        self._config, self._pieces, self._body = config, pieces, OwnBody(robot, config.shared.noise_sigmas)
        self._bias = RangeBias(config)
        self._scale = RangeScale(config)

    @property
    def errors(self) -> RangeErrors:
        """What is wrong with the ranges, as far as it is known."""
        return RangeErrors(self._bias.mean_m, self._bias.sigma_m, self._scale.mean, self._scale.sigma)

    def hear(self, scan: Scan) -> Heard:
        """Return a scan without the robot's own body, and without what is wrong with its ranges where that goes."""
        scan, own_beams = self._body.without(scan)
        if self._backend is None:
            return Heard(scan, scan, own_beams, 0.0)
        # The first scans tell of the bias before they are taken in: they would be cut where it bows walls.
        errors = self.errors
        begun = _without(scan, errors)
        bias_m = self._bias.with_scan(self._bias.seen(begun, self._pieces(begun), errors.bias_m))
        self._taken.errors = replace(errors, bias_m=bias_m)
        return Heard(_without(scan, self._taken.errors), scan, own_beams, bias_m)

    def move(self, odometry: Odometry, belief: Belief) -> None:
        """Take note of a motion of the scanner from where it is believed to be."""
        if self._backend is not None:
            belief = self._backend.inner.belief
        self._scale.see(belief.pose_world, belief.pose_cov, self._taken.errors.scale)
        self._scale.move(odometry, float(belief.pose_world[2]))
        if self._backend is not None:
            self._taken.errors = replace(self.errors, bias_m=self._taken.errors.bias_m)

    def learn(self, heard: Heard, segments: Segments, walls: Int[np.ndarray, " s"]) -> None:
        """Take in what the segments of a scan, each of the wall of this id, tell of the bias."""
        scan, taken_m = heard.scan, heard.bias_m
        if self._backend is None and self.errors.is_biased(self._config):
            # A wall that is bowed was cut into pieces, and they tell less: straight ones tell what is left.
            taken_m = self._bias.mean_m
            scan = _without(scan, RangeErrors(bias_m=taken_m))
            owners = _of_beams(len(scan.ranges_m), segments, walls)
            segments = self._pieces(scan)
            walls = owners[(segments.beams[:, 0] + segments.beam_counts // 2) % len(owners)]
        self._bias.learn(self._bias.seen(scan, segments, taken_m), walls)

    def stated(self, scan: Scan, segments: Segments) -> Segments:
        """Return the segments of a scan with what the bias leaves unknown of them, where it is taken out."""
        return segments if self._backend is None else self._bias.stated(scan, segments)

    def told(self, belief: Belief) -> Belief:
        """Return a belief about the scanner that states what the scale leaves unknown."""
        return belief if self._backend is None else self._backend.unsure(belief)


def _without(scan: Scan, errors: RangeErrors) -> Scan:
    """Return a scan without a bias and a scale; what they leave of no length tells nothing."""
    ranges_m: Float[np.ndarray, " k"] = (scan.ranges_m - errors.bias_m) / errors.scale
    return replace(scan, ranges_m=np.where(ranges_m > 0.0, ranges_m, np.nan))


def _of_beams(count: int, segments: Segments, walls: Int[np.ndarray, " s"]) -> Int[np.ndarray, " k"]:
    """Return for each of a scan's beams the wall of its segment; -1 for none."""
    owners = np.full(count, -1, dtype=np.int64)
    for (first, last), wall in zip(segments.beams.tolist(), walls.tolist(), strict=True):
        owners[np.arange(first, first + (last - first) % count + 1) % count] = wall
    return owners
