"""A bias of ranges, told from how it bows walls that are seen at a slant.

A beam that meets a straight wall at (alpha, r) under the bearing theta has the range p = r / cos(theta - alpha). A bias
b makes it p + b, which is no straight wall: towards the slanted beams it lies farther in than straight ahead. Least
squares over the beams of one piece, in the line and in b together, leaves two sums of b: its information I, what the
ones that stand for b have left once the line has taken its share, and its score g, so that b = g / I. They add up over
pieces and scans. The pieces of one wall err alike where it is not straight, so the spread between walls counts too.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from ...extraction.segments import Segments
from ...geometry.numerics import LEAST_SIGMA
from ...robot import Scan
from ..kernels.bow_kernels import bows
from .errors import DEFAULTS, RangesConfig


class RangeBias:
    """The bias as far as all scans tell it."""

    def __init__(self, config: RangesConfig = DEFAULTS) -> None:
        self._config = config
        self._sums: dict[int, tuple[float, float]] = {}
        """Of each wall, by its id: information and score."""
        self._prior = np.array([config.bias_m**-2, 0.0])
        self._total = self._prior.copy()
        self._scans = 0
        self.sigma_m = self._sigma_m()
        """Its standard deviation m: by the noise of the beams, or by how walls differ, whichever is larger."""

    @property
    def mean_m(self) -> float:
        """The likeliest bias m."""
        return float(self._total[1] / self._total[0])

    def _sigma_m(self) -> float:
        information, mean = float(self._total[0]), self.mean_m
        sums = np.array(list(self._sums.values())).reshape(-1, 2)
        spread = float(np.sqrt(np.sum((sums[:, 1] - mean * sums[:, 0]) ** 2))) / information
        return max(information**-0.5, spread)

    def seen(self, scan: Scan, segments: Segments, taken_m: float) -> Float[np.ndarray, "s 2"]:
        """Return information and score of each segment of a scan from whose ranges a bias has been taken already.

        Zero for a segment that alone tells too little.
        """
        sums = self._bows(scan, segments)[:, :2]
        sums[:, 1] += taken_m * sums[:, 0]
        sums[sums[:, 0] < self._config.bow_m**-2] = 0.0
        return sums

    def stated(self, scan: Scan, segments: Segments) -> Segments:
        """Return segments that state what the bias that is still unknown does to them beside moving them outwards.

        It errs alike in all scans up to now. So each states it as many times: else it would seem to average out.
        """
        turned = self._bows(scan, segments)[:, 2:] - np.array([0.0, 1.0])
        common = max(self._scans, 1) * self.sigma_m**2
        return replace(segments, cov=segments.cov + common * turned[:, :, None] * turned[:, None, :])

    def _bows(self, scan: Scan, segments: Segments) -> Float[np.ndarray, "s 4"]:
        return bows(
            scan.bearings_rad,
            scan.ranges_m,
            np.maximum(np.ascontiguousarray(scan.sigmas_m), LEAST_SIGMA),
            segments.lines,
            segments.beams,
            self._config.shared.noise_sigmas,
        )

    def with_scan(self, sums: Float[np.ndarray, "s 2"]) -> float:
        """Return the likeliest bias m if these sums of a scan counted, too."""
        information, score = self._total + sums.sum(axis=0)
        return float(score / information)

    def learn(self, sums: Float[np.ndarray, "s 2"], walls: Int[np.ndarray, " s"]) -> None:
        """Take in the sums of a scan's segments, each of the wall of this id."""
        for wall, (information, score) in zip(walls.tolist(), sums.tolist(), strict=True):
            if information > 0.0:
                before = self._sums.get(wall, (0.0, 0.0))
                self._sums[wall] = before[0] + information, before[1] + score
        self._total = self._total + sums.sum(axis=0)
        self._scans += 1
        self.sigma_m = self._sigma_m()
