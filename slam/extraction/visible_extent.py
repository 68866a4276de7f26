"""How far the ends of what one scan shows can be believed."""

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from ..robot import Scan
from .config import ExtractionConfig
from .kernels.extent_kernels import believed_ends
from .segments import Segments


def beams_of(runs: Int[np.ndarray, "n 2"], beams: int) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Return the beams of segments, each from its first to its last, in a scan of so many, and whose each is."""
    counts = np.mod(runs[:, 1] - runs[:, 0], beams) + 1
    of = np.repeat(np.arange(len(runs)), counts)
    return np.mod(np.arange(len(of)) + (runs[:, 0] - np.cumsum(counts) + counts)[of], beams), of


def owners_of_beams(segments: Segments, owners: Int[np.ndarray, " s"], beams: int) -> Int[np.ndarray, " k"]:
    """Return for each beam of a scan the id of the wall that its segment belongs to, -1 for none."""
    owner = np.full(beams, -1, dtype=np.int64)
    beam, of = beams_of(segments.beams, beams)
    owner[beam] = owners[of]
    return owner


def sure_pieces(segments: Segments, scan: Scan, config: ExtractionConfig) -> Segments:
    """Shorten each segment to where its beams stand close enough together that no door hides between them.

    A segment that lies beyond altogether keeps the end nearer to the foot of the perpendicular. Corners far beyond the
    last beam are not believed either.
    """
    ends, end_kinds = believed_ends(
        segments.lines,
        segments.ends,
        segments.end_kinds,
        scan.bearings_rad[segments.beams],
        scan.step_rad,
        float(config.shared.door_m),
        float(config.shared.within_m),
    )
    return replace(segments, ends=ends, end_kinds=end_kinds)


def beam_step(scan: Scan) -> float:
    """Return the angle between neighbouring beams, rad."""
    return scan.step_rad
