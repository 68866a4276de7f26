"""What a run says of its scanner's ranges, and that it takes out of them what is wrong where it is asked to."""

import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.experiments.views.run_lines import range_errors_of, words_on_ranges
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig


def summary(steps=250, calibrate=False, **faults):
    robot = RobotConfig(lidar=LidarConfig(calibrate=calibrate), faults=FaultsConfig(**faults))
    return run_trial(TrialConfig("rooms", "full-ekf", max_steps=steps, robot=robot)).summary


def test_nothing_is_said_of_ranges_that_are_right():
    found = summary(120)
    assert words_on_ranges(range_errors_of(found)) == []
    assert found["own_beams"] == 0
    assert abs(found["range_bias_m"]) < 4.0 * found["range_bias_sigma_m"]
    assert abs(found["range_scale"] - 1.0) < 4.0 * found["range_scale_sigma"]


@pytest.mark.parametrize("bias_m", [0.015, 0.03])
def test_a_bias_is_told_within_a_fifth_and_taken_out_the_map_is_consistent(bias_m):
    only_told = summary(150, range_bias_m=bias_m)
    assert only_told["range_bias_m"] == pytest.approx(bias_m, rel=0.2)
    assert words_on_ranges(range_errors_of(only_told))[0].startswith(
        f"a bias of +{1e3 * only_told['range_bias_m']:.1f}"
    )
    found = summary(calibrate=True, range_bias_m=bias_m)
    assert found["range_bias_m"] == pytest.approx(bias_m, rel=0.2)
    assert found["pose_anees"] < 1.5
    assert found["pose_anees_from_start"] < 1.5
    assert found["map_anees"] < 1.5


def test_a_scale_that_is_taken_out_leaves_a_consistent_map():
    found = summary(calibrate=True, range_scale=1.01)
    assert abs(found["range_scale"] - 1.01) < 3.0 * found["range_scale_sigma"]
    assert found["pose_anees"] < 1.5
    assert found["map_anees"] < 1.5


def test_posts_of_the_robots_own_body_are_counted_and_hide_no_way():
    found = summary(120, posts=4)
    assert found["own_beams"] > 1000
    assert found["path_length_m"] > 3.0
    assert found["collisions"] == 0
