"""How reliable the directions of segments are, and how far short walls may be off the lines that stand for them."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..extraction.straightness import StraightnessConfig, cov_of_faces
from ..geometry.quantities import Angle, Distance
from .kernels import reliability_kernels
from .kernels.reliability_kernels import add_lengths, keep_longest
from .records import Merger, Records


@dataclass(frozen=True)
class ReliabilityConfig:
    """When the direction of a segment is reliable, and how large the lack of fit of a wall is.

    Walls have less of it than single segments, since few lines over two faces stay in the map: with `edge_m` the short
    walls alone have a map ANEES near 1 (`python -m studies.exploration.map_causes`).
    """

    shared: SharedConfig = of_shared()
    heading_rad: Angle = 0.15
    """Standard deviation of the direction below which a segment is reliable; that of tentative segments is inflated by
    as much."""
    straightness: StraightnessConfig = field(default_factory=StraightnessConfig)
    """It inflates the covariance of an observation."""
    edge_m: Distance = 0.002
    """Standard deviation of the lack of fit of the shortest walls in the map; longer ones have less."""


def are_clear(segments: Segments, config: ReliabilityConfig = ReliabilityConfig()) -> Bool[np.ndarray, " s"]:
    """Return which segments have enough beams and a clear direction."""
    turn = segments.cov[:, 0, 0] + cov_of_faces(segments, config.straightness)[:, 0, 0]
    return ~segments.is_tentative & (turn < config.heading_rad**2)


def as_told(
    cov: Float[np.ndarray, "m 2 2"], segments: Segments, config: ReliabilityConfig = ReliabilityConfig()
) -> Float[np.ndarray, "m 2 2"]:
    """Return the covariances of (alpha, r) of observations that together move the estimate.

    Beside a clear observation one of few beams says where the robot stands, not how it is turned: such a line over the
    corner of two faces of one wall passes every gate. It may be turned about the point at which what is known of its
    place does not depend on its direction; there r changes by cov(alpha, r) / var(alpha) for every radian.
    """
    cov = cov + cov_of_faces(segments, config.straightness)
    return reliability_kernels.as_told(cov, segments.is_tentative, float(config.heading_rad))


class Reliability:
    """Sums over the observations of each wall."""

    def __init__(self, config: ReliabilityConfig = ReliabilityConfig(), records: Records | None = None) -> None:
        self._config = config
        self._records = Records() if records is None else records
        self._records.declare(
            self._merge,
            # The two longest pieces that scans saw of it, m.
            longest=np.zeros(2),
        )

    def see(self, segments: Segments, rows: Int[np.ndarray, " s"]) -> None:
        """Add one scan; `rows` holds the row of each segment's wall, -1 for none."""
        add_lengths(rows, segments.cov, segments.ends, self._records.columns["longest"])

    def _merge(self, merger: Merger) -> None:
        """Add what was seen of the dropped wall to the kept one's."""
        longest = self._records.columns["longest"]
        for length in longest[merger.drop].tolist():
            keep_longest(longest[merger.keep], length)

    def off_line_cov(
        self, extents: Float[np.ndarray, "n 2"], broken: Float[np.ndarray, "n 5"]
    ) -> tuple[Bool[np.ndarray, " n"], Float[np.ndarray, "n 2 2"]]:
        """Return which walls stand for two faces, and how far all may be from their lines, of (alpha rad, d m).

        Walls have such extents, m along their lines, and such likeliest breaks (`Profiles`).
        What one scan alone shows of a wall, longer than any other, may be of two faces: a short one and another behind
        it. So a wall counts as long as two scans saw it.
        """
        edges = float(self._config.edge_m), float(self._config.shared.face_m)
        return reliability_kernels.off_lines(extents, self._records.columns["longest"], broken, *edges)
