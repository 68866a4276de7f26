"""The stream that a run writes as it goes."""

import os

import numpy as np
import pytest

from chainslam.experiments.artifacts import running_log
from chainslam.experiments.artifacts.run_folder import FolderGoneError
from chainslam.experiments.artifacts.running_log import RunningLog, read_running
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError


def test_the_stream_holds_every_step_bit_for_bit_and_drops_what_was_cut_short(tmp_path):
    result = run_trial(TrialConfig("paper-fig4", seed=2, max_steps=4))
    log, steps = RunningLog(tmp_path, {"trial": 1}), []
    run_trial(TrialConfig("paper-fig4", seed=2, max_steps=4), lambda step: (log.add(step), steps.append(step)))
    log.close()
    kept = read_running(tmp_path)
    np.testing.assert_array_equal(kept.ranges_m, result.log.ranges_m)
    np.testing.assert_array_equal(kept.odometry, result.log.odometry)
    np.testing.assert_array_equal(kept.time_s, result.log.time_s)
    content = (tmp_path / "log.running").read_bytes()
    for cut in (1, 700, 1500):
        (tmp_path / "log.running").write_bytes(content[:-cut])
        short = read_running(tmp_path)
        assert len(short.time_s) == 3
        # Going on behind the whole ones, as if nothing had been cut.
        more = RunningLog(tmp_path, {"trial": 1}, short)
        for step in steps:
            more.add(step)
        more.close()
        assert (tmp_path / "log.running").read_bytes() == content
    # One bit of the last step is another, or it has a beam less than the others.
    (tmp_path / "log.running").write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert len(read_running(tmp_path).time_s) == 3
    odd = running_log._record(bytes(8 * (13 + kept.ranges_m.shape[1] - 1)))
    (tmp_path / "log.running").write_bytes(content + odd)
    assert len(read_running(tmp_path).time_s) == 4
    (tmp_path / "log.running").write_bytes(b"none of ours")
    with pytest.raises(UsageError, match=r"^expected the log of a run under way, found .*: .*$"):
        read_running(tmp_path)


def test_a_step_that_was_written_in_part_is_taken_back_and_ends_the_stream(tmp_path, monkeypatch):
    log, steps = RunningLog(tmp_path, {"trial": 1}), []
    run_trial(TrialConfig("paper-fig4", seed=2, max_steps=3), steps.append)
    log.add(steps[0])
    before, write = (tmp_path / "log.running").read_bytes(), os.write
    monkeypatch.setattr(running_log.os, "write", lambda descriptor, content: write(descriptor, content[:900]))
    log.add(steps[1])
    monkeypatch.undo()
    # There is room again, but behind a gap no step can be read.
    log.add(steps[2])
    assert (tmp_path / "log.running").read_bytes() == before
    assert len(read_running(tmp_path).time_s) == 1


def test_a_stream_that_was_taken_away_is_noticed_at_the_next_step(tmp_path):
    log = RunningLog(tmp_path, {"trial": 1})
    log.check()
    (tmp_path / "log.running").rename(tmp_path / "elsewhere")
    with pytest.raises(FolderGoneError):
        log.check()
