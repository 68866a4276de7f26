"""The ends that are believed: as far as beams stand close together, and hardly beyond the last of them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from tests.slam.extraction.test_extract import room_scan

CONFIG = ExtractionConfig(shared=SharedConfig(door_m=0.12, within_m=0.02))


def met(line, bearing):
    """Return where a beam meets a line."""
    return line[1] / np.cos(bearing - line[0]) * np.array([np.cos(bearing), np.sin(bearing)])


@given(seed=st.integers(0, 2**32))
@settings(max_examples=100, deadline=None)
def test_an_end_is_the_last_point_where_beams_stand_close_and_no_leap_beyond_the_last_beam(seed):
    scan = room_scan(seed)
    segments = extract(scan)
    believed = sure_pieces(segments, scan, CONFIG)

    def apart(line, point):
        """Return how far apart beams meet a line about a point, by two that are near to each other."""
        bearing, h = np.arctan2(point[1], point[0]), 1e-6
        return np.hypot(*(met(line, bearing + h) - met(line, bearing - h))) / (2 * h) * scan.step_rad

    for k, line in enumerate(segments.lines):
        ends = segments.ends[k].copy()
        for end in range(2):
            last = met(line, scan.bearings_rad[segments.beams[k, end]])
            if np.hypot(*(ends[end] - last)) > CONFIG.shared.within_m:
                ends[end] = last
        along = np.array([-np.sin(line[0]), np.cos(line[0])])
        is_beyond = (ends @ along).prod() > 0 and min(apart(line, end) for end in ends) > CONFIG.shared.door_m
        nearest = min(ends, key=lambda end: apart(line, end))
        for end in range(2):
            shown = believed.ends[k, end]
            if apart(line, ends[end]) <= CONFIG.shared.door_m:
                np.testing.assert_allclose(shown, ends[end], atol=1e-9)
            elif is_beyond:
                np.testing.assert_allclose(shown, nearest, atol=1e-9)
            elif apart(line, np.array([np.cos(line[0]), np.sin(line[0])])) <= CONFIG.shared.door_m:
                assert abs(apart(line, shown) - CONFIG.shared.door_m) < 1e-6
            same = np.allclose(shown, segments.ends[k, end], atol=1e-12)
            assert believed.at_corner[k, end] == (segments.at_corner[k, end] and same)
