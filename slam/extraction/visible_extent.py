"""How far the ends of what one scan shows can be believed."""

from ..robot import Scan
from .config import ExtractionConfig
from .kernels.extent_kernels import believed_ends
from .segments import Segments


def sure_pieces(segments: Segments, scan: Scan, config: ExtractionConfig) -> Segments:
    """Shorten each segment to where its beams stand close enough together that no door hides between them.

    A segment that lies beyond altogether keeps the end nearer to the foot of the perpendicular. Corners far beyond the
    last beam are not believed either.
    """
    ends, at_corner = believed_ends(
        segments.lines,
        segments.ends,
        segments.at_corner,
        scan.bearings_rad[segments.beams],
        scan.step_rad,
        float(config.shared.door_m),
        float(config.shared.within_m),
    )
    lines, cov, beams, counts = segments.lines, segments.cov, segments.beams, segments.beam_counts
    return Segments(lines, cov, ends, beams, counts, at_corner, segments.chi2, segments.is_tentative)
