"""A run that goes on is held against what its log says of every step up to the last one."""

import re
from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.artifacts.saved import SavedRun
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from chainslam.explore.outcome import Outcome
from chainslam.sim.logs.recorded_robot import Recording


@pytest.fixture
def drive(world, scripted_mission):
    """The steps of a short drive, and what its log holds."""
    steps = []
    log = run_trial(TrialConfig("square", max_steps=4), steps.append, world, scripted_mission).log
    names = ("time_s", "bearings_rad", "ranges_m", "sigma_m", "range_max_m", "odometry", "odometry_cov")
    return steps, Recording(**{name: getattr(log, name) for name in names})


def told(steps, recording):
    """At which step a saved run is found to be another one, if at any."""
    log = recording.time_s, recording.ranges_m, recording.odometry
    saved = SavedRun(TrialConfig("square"), Outcome.STEP_LIMIT, None, *log)
    for step in steps:
        try:
            saved.check(step)
        except UsageError as error:
            return int(re.search(r"difference at step (\d+)", str(error))[1])
    return None


@pytest.mark.parametrize("name", ["ranges_m", "odometry"])
@pytest.mark.parametrize("at", [0, 1, 2, 3])
def test_whatever_differs_in_any_step_is_told(drive, name, at):
    steps, recording = drive
    assert len(steps) == len(recording) == 4
    assert told(steps, recording) is None
    changed = getattr(recording, name).copy()
    changed[at, 2] += 1e-9
    assert told(steps, replace(recording, **{name: changed})) == at


def test_a_beam_that_saw_nothing_both_times_is_the_same_and_what_comes_after_the_log_is_new(drive):
    steps, recording = drive
    ranges = recording.ranges_m.copy()
    ranges[1, 3] = np.nan
    scan = replace(steps[1].scan, ranges_m=ranges[1])
    blind = [steps[0], replace(steps[1], scan=scan), *steps[2:]]
    assert told(blind, replace(recording, ranges_m=ranges)) is None
    shorter = {name: getattr(recording, name)[:3] for name in ("time_s", "ranges_m", "odometry", "odometry_cov")}
    assert told(steps, replace(recording, **shorter)) is None
