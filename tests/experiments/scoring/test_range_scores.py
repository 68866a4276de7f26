"""What a summary says of a scanner's ranges, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from chainslam.experiments.scoring.summary import range_scores
from chainslam.slam.association.ranges.errors import RangeErrors

pytestmark = pytest.mark.usefixtures("_unchecked")


def test_errors_are_those_of_the_last_step_and_shares_those_of_the_first_scans():
    ranges = np.full((30, 8), 2.0)
    ranges[:, 0], ranges[:5, 1] = np.inf, np.nan
    curved = np.where(np.arange(30) < 10, 3, 100)
    log = SimpleNamespace(ranges_m=ranges, own_beams=np.arange(30), curved_beams=curved)
    found = range_scores(SimpleNamespace(range_errors=RangeErrors(0.01, 0.002, 1.02, 0.003)), log)
    assert found["range_bias_m"] == 0.01
    assert found["range_bias_sigma_m"] == 0.002
    assert found["range_scale"] == 1.02
    assert found["range_scale_sigma"] == 0.003
    assert found["own_beams"] == 29 * 15
    assert found["curved_share"] == pytest.approx(30 / (5 * 6 + 5 * 7))


def test_of_scans_without_a_return_no_share_is_told():
    log = SimpleNamespace(ranges_m=np.full((3, 4), np.inf), own_beams=np.zeros(3, int), curved_beams=np.zeros(3, int))
    assert range_scores(SimpleNamespace(range_errors=RangeErrors()), log)["curved_share"] is None
