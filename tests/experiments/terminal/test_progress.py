"""The bar of a run, and times in words."""

import pytest

from chainslam.experiments.terminal.progress import bar_of, duration, total_of


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


def test_a_run_longer_than_expected_never_fills_its_bar():
    assert [done / total_of(10.0, done) for done in (1, 9, 20)] == pytest.approx([0.1, 0.9, 0.95])
    assert total_of(None, 3) is None
