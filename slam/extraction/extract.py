"""From a scan to straight segments, compiled (`kernels`).

The paper takes its extraction from elsewhere (section 2.1); here a line is linear in inverse range (`line_kernels`).
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ..geometry.compiled import plain
from ..geometry.numerics import LEAST_SIGMA
from ..robot import Scan
from .config import ExtractionConfig
from .kernels.returns_kernels import Rules
from .kernels.segment_kernels import segments_of
from .segments import Segments

DEFAULT = ExtractionConfig()
_FAR_M = 1e4
"""Farther returns are not used: in inverse range they are noise."""


def extract(scan: Scan, config: ExtractionConfig = DEFAULT) -> Segments:
    """Return the straight segments of `scan` in the robot frame, counter-clockwise; none where nothing is straight.

    An end is OPEN also where the wall stops in front of something farther.
    """
    found, is_good = segments_of(*beams_of_scan(scan), rules_of(config))
    segments = Segments(*found)
    return segments if is_good.all() else segments.take(is_good)


def beams_of_scan(
    scan: Scan,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], Float[np.ndarray, " k"], float, float, bool]:
    """Return a scan as the kernels take it.

    Bearings rad, ranges m, their standard deviations m, what of these grows as a share of the range, how far returns
    are used m, and whether the first beam follows the last.
    """
    farthest_m = float(min(scan.range_max_m, _FAR_M))
    sigmas_m = np.maximum(scan.sigmas_m, LEAST_SIGMA)
    bearings_rad, ranges_m = plain(scan.bearings_rad), plain(scan.ranges_m)
    return bearings_rad, ranges_m, sigmas_m, float(scan.sigma_share), farthest_m, scan.is_full_turn


@lru_cache(maxsize=16)
def rules_of(config: ExtractionConfig) -> Rules:
    """Return the numbers of the settings as the kernels take them."""
    return Rules(
        noise_sigmas=float(config.shared.noise_sigmas),
        gap_beams=config.gap_beams,
        grazing_rad=float(config.grazing_rad),
        scales=np.array(config.scales),
        candidate_gain=float(config.candidate_gain),
        sure_gain=float(config.sure_gain),
        segment_cost=float(config.segment_cost),
        least_beams=config.least_beams,
        sure_beams=config.sure_beams,
        outlier_sigmas=float(config.shared.outlier_sigmas),
        doubt_sigmas=float(config.doubt_sigmas),
        end_share=float(config.end_share),
    )
