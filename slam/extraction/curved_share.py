"""How much of what a scanner sees is curved: a map of line segments says little of a world that is mostly so."""

import numpy as np

from ..estimation.shared import SharedConfig
from ..geometry.poses import wrap
from ..robot import Scan
from .segments import Segments

SHARED = SharedConfig()
BENT_RAD = float(np.deg2rad(60.0))
"""Pieces that turn by less into the next one are chords of a curve; corners of walls turn by more."""
MOSTLY = 0.45
"""Where more of the returns lies on such pieces, a world is mostly curved. In bundled worlds it is 0.0 to 0.2, in
apartments up to 0.4, in round rooms and among many pillars 0.5 to 0.9."""
GAP_BEAMS = 4
"""From the last beam of one piece to the first of the next: each may have left one at the joint to neither."""
SCANS = 10
"""So many scans from the start tell it."""


def curved_beams(scan: Scan, segments: Segments) -> int:
    """Return how many beams of a scan lie on segments that go on, with a slight turn, in the one before or after."""
    if len(segments) < 2:
        return 0
    after = np.roll(np.arange(len(segments)), -1)
    between = (segments.beams[after, 0] - segments.beams[:, 1]) % len(scan.ranges_m)
    apart_m = np.hypot(*(segments.ends[after, 0] - segments.ends[:, 1]).T)
    turn = np.abs(wrap(segments.lines[after, 0] - segments.lines[:, 0]))
    goes_on = (between <= GAP_BEAMS) & (apart_m <= SHARED.beyond_m)
    bends = goes_on & (turn > SHARED.straight_rad) & (turn < BENT_RAD)
    return int(segments.beam_counts[bends | np.roll(bends, 1)].sum())


def returns_of_scan(scan: Scan) -> int:
    """Return how many beams came back."""
    return int(np.count_nonzero(np.isfinite(scan.ranges_m)))


def few_straight(curved: int, returns: int) -> str:
    """Return what is to be said where too many returns lie on something curved; empty where they do not."""
    if curved <= MOSTLY * returns:
        return ""
    share = 100.0 * curved / returns
    return f"few straight walls: {share:.0f} % of the first returns lie on something curved"
