"""Every setting of the extraction is used: each, set far off, changes what some scan shows."""

from dataclasses import fields, replace

import numpy as np
import pytest

from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from tests.slam.extraction.test_extract import CLOSED, PLACES, loop, room_scan, scan_of

FAR_OFF = {
    "shared": SharedConfig(noise_sigmas=1.5),
    "gap_beams": 1,
    "grazing_rad": 0.5,
    "scales": (3,),
    "candidate_gain": 1e6,
    "sure_gain": 1e6,
    "segment_cost": 1e4,
    "least_beams": 9,
    "sure_beams": 20,
    "doubt_sigmas": 0.0,
    "end_share": 0.01,
}


def shown(scan, config):
    return vars(sure_pieces(extract(scan, config), scan, config)).values()


@pytest.mark.parametrize("name", [each.name for each in fields(ExtractionConfig)])
def test_a_setting_far_off_changes_what_some_scan_shows(name):
    config = ExtractionConfig()
    other = replace(config, **{name: FAR_OFF[name]})
    rng, turn = np.random.default_rng(3), np.deg2rad(3.0)
    bend = loop((-3, 0), (0, 0), (3 * np.cos(turn), 3 * np.sin(turn)), (3, 4), (-3, 4))
    bent = [scan_of(bend, rng.uniform((-1.5, 0.4, -3.0), (1.5, 1.5, 3.0)), rng) for _ in range(12)]
    gappy = room_scan(3)
    gappy.ranges_m[::7] = np.inf
    for scan in (*bent, gappy, scan_of(CLOSED, [*PLACES[0] - 1.0, 0.3]), *map(room_scan, range(8))):
        if any(not np.array_equal(one, two) for one, two in zip(shown(scan, config), shown(scan, other), strict=True)):
            return
    pytest.fail(f"{name} changed nothing")
