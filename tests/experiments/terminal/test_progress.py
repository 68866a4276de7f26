"""The bar of a run, and times in words."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from chainslam.experiments.terminal import progress
from chainslam.experiments.terminal.progress import EVERY_S, bar_of, duration, share_of, total_of
from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.04, "0.0 s"), (9.94, "9.9 s"), (59.4, "59 s"), (59.6, "1 min 0 s"), (3661.0, "1 h 1 min")],
)
def test_a_duration_has_two_units_at_most(seconds, words):
    assert duration(seconds) == words


def test_progress_tells_what_is_left_on_a_terminal_and_nothing_elsewhere(capsys, monkeypatch):
    with bar_of("trials", 4.0) as (bar, task):
        bar.advance(task)
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("FORCE_COLOR", "1")
    with bar_of("trials", 4.0) as (bar, task):
        bar.advance(task)
        bar.refresh()
    told = capsys.readouterr().err
    assert "computing" in told
    assert "left" in told
    with bar_of("figures", None):
        pass
    assert "left" not in capsys.readouterr().err


def test_what_takes_longer_than_a_step_is_asked_where_it_is_shown_and_every_fifty_steps(capsys, monkeypatch):
    world = load("paper-fig4")
    backend = BACKENDS["full-ekf"].make(np.array(world.start), np.diag([0.01, 0.01, 0.002]) ** 2)
    (first,) = islice(explore_mission(SimulatedRobot(world, 1), Mapper(backend), STRATEGIES["nearest-robot"].make()), 1)
    asked = []

    def more(step):
        asked.append(step.index)
        return "seventeen"

    for shown in (False, True):
        if shown:
            monkeypatch.setenv("FORCE_COLOR", "1")
        with progress.progress("a run", None, more) as watch:
            for index in range(101):
                watch(replace(first, index=index))
        assert asked == ([0, 50, 100] if shown else [])
    told = capsys.readouterr().err
    assert "seventeen" in told
    assert "robot clock" not in told
    with progress.progress("a run", None) as watch:
        watch(first)
    assert "robot clock 0:00:00" in capsys.readouterr().err


def test_a_run_longer_than_expected_never_fills_its_bar():
    assert [done / total_of(10.0, done) for done in (1, 9, 20)] == pytest.approx([0.1, 0.9, 0.95])
    assert total_of(None, 3) is None


def test_in_a_file_a_line_every_ten_seconds_tells_how_far_it_is_and_what_is_left(capsys, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with share_of("refining offline") as watch:
        for k in range(1, 41):
            now[0] += EVERY_S / 10.0
            watch(k / 80.0)
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 4
    assert said[1] == "chainslam: refining offline: 25 % after 20 s, 1 min 0 s left"
    monkeypatch.setenv("FORCE_COLOR", "1")
    with share_of("refining offline") as watch:
        now[0] += 20.0 * EVERY_S
        watch(0.5)
    assert "after" not in capsys.readouterr().err
