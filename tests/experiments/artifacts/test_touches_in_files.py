"""What the body touched is kept: in the log, in a replay of it, and in the steps."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.artifacts.results import log_arrays, steps_csv
from chainslam.experiments.replays.recordings import recorded
from chainslam.experiments.replays.replay import ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.sim.logs.recorded_robot import RecordedRobot, recording_of
from chainslam.slam.robot import MotionCommand

TOUCHED = np.array([False, False, True, True, False])


@pytest.fixture(scope="module")
def made():
    result = run_trial(TrialConfig("paper-fig4", max_steps=len(TOUCHED)))
    return replace(result, log=replace(result.log, touched=TOUCHED))


def test_the_steps_count_the_collisions_so_far(made):
    rows = list(csv.DictReader(io.StringIO(steps_csv(made.log).decode())))
    assert [int(row["collisions"]) for row in rows] == [0, 0, 1, 2, 2]


def test_a_recorded_robot_touches_where_it_did(made):
    arrays = log_arrays(made, made.log)
    robot = RecordedRobot(recording_of(arrays))
    assert [robot.drive(MotionCommand(0.0, 0.0)).touched for _ in TOUCHED[1:]] == TOUCHED[1:].tolist()
    older = RecordedRobot(recording_of({name: values for name, values in arrays.items() if name != "touched"}))
    assert not any(older.drive(MotionCommand(0.0, 0.0)).touched for _ in TOUCHED[1:])


def test_a_replay_counts_them_too(made):
    result = replay(recorded(made), "full-ekf", ReplayOptions())
    assert result.summary["collisions"] == 2
    np.testing.assert_array_equal(result.log.touched, TOUCHED)
