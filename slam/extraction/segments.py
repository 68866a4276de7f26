"""What extraction hands to matching: the straight pieces of one scan."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from ..geometry.lines import directions, normals
from ..geometry.poses import to_world
from ..robot import ScannerSpec


@dataclass(frozen=True)
class Segments:
    """The straight pieces of one scan, in the scanner's frame, ordered counter-clockwise."""

    lines: Float[np.ndarray, "n 2"]
    """(alpha rad, r m): n(alpha) points from the seen side into the wall, so r > 0 in the scanner's frame."""
    cov: Float[np.ndarray, "n 2 2"]
    """Covariance of (alpha, r), propagated from the radial noise."""
    ends: Float[np.ndarray, "n 2 2"]
    """First and last point m on the line; walking from first to last the free side is on the left."""
    beams: Int[np.ndarray, "n 2"]
    """First and last beam index; first > last where the segment crosses the scan's seam."""
    beam_counts: Int[np.ndarray, " n"]
    """Number of beams that the fit used."""
    at_corner: Bool[np.ndarray, "n 2"]
    """Whether the next segment of the same scan begins at an end: then it is where their lines cross."""
    chi2: Float[np.ndarray, " n"]
    """Squared residuals of the beams over the squared noise, summed: `beam_counts` - 2 degrees of freedom. With few
    beams up to twice as much: the last ones, which count less in the fit (`end_share`), lie farther off it."""
    is_tentative: Bool[np.ndarray, " n"]
    """Which have so few beams that their first-order covariance is not to be trusted."""

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def lengths_m(self) -> Float[np.ndarray, " n"]:
        """How long each seen piece is."""
        return np.hypot(*(self.ends[:, 1] - self.ends[:, 0]).T)

    def on_body(self, scanner: ScannerSpec) -> "Segments":
        """Return the segments in the frame of the body, whose origin may lie behind the line of one of them."""
        if scanner.is_at_axle:
            return self
        alpha, mount = self.lines[:, 0] + scanner.heading_rad, scanner.pose_robot
        r = self.lines[:, 1] + normals(alpha) @ mount[:2]
        G = np.tile(np.eye(2), (len(self), 1, 1))
        G[:, 1, 0] = directions(alpha) @ mount[:2]
        cov = G @ self.cov @ G.transpose(0, 2, 1)
        return replace(self, lines=np.stack([alpha, r], axis=-1), cov=cov, ends=to_world(self.ends, mount))

    def take(self, index: np.ndarray) -> "Segments":
        """Return the chosen segments (integer or boolean index), in the order asked for."""
        rows = index.nonzero()[0] if index.dtype == np.bool_ else index  # `take` is three times as fast as an index
        return Segments(
            self.lines.take(rows, 0),
            self.cov.take(rows, 0),
            self.ends.take(rows, 0),
            self.beams.take(rows, 0),
            self.beam_counts.take(rows),
            self.at_corner.take(rows, 0),
            self.chi2.take(rows),
            self.is_tentative.take(rows),
        )
