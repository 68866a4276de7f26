"""What a person sees of a run while it goes on: a progress line, or lines in a file."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column

from chainslam.explore.step import Step
from chainslam.slam.extraction.curved_share import SCANS, curved_beams, few_straight, returns_of_scan

from .answers import is_quiet
from .console import plain_console, say

ALMOST = 0.95
"""A run that takes longer than expected stays at this share of its bar."""
MORE_STEPS = 50
"""What else is told may take longer than a step."""
EVERY_S = 10.0
"""In a file there is a line so often."""


@contextmanager
def progress(
    title: str, steps: float | None = None, more: Callable[[Step], str] = lambda step: ""
) -> Iterator[Callable[[Step], None]]:
    """Show steps on standard error while the block runs; quiet where that is not a terminal.

    `steps` is how many are expected; without it no time left is told. `more` says every 50 steps what is told in place
    of the robot's clock.
    """
    with bar_of(title, steps, TextColumn("{task.fields[words]}", table_column=Column(no_wrap=True))) as (bar, task):
        curved, returns, also = 0, 0, ""

        def watch(step: Step) -> None:
            nonlocal curved, returns, also
            done = step.index + 1
            if done <= SCANS:
                curved, returns = curved + curved_beams(step.scan, step.segments), returns + returns_of_scan(step.scan)
            if done == SCANS and (words := few_straight(curved, returns)):
                bar.console.print(words)
            open_ends = sum(len(chain.open_ends) for chain in step.chains)
            if not bar.disable and step.index % MORE_STEPS == 0:
                also = more(step)
            last = also or f"robot clock {timedelta(seconds=int(step.time_s))}"
            words = f"step {done}, {step.path_length_m:.0f} m, {open_ends} open ends, {last}"
            bar.update(task, completed=done, total=total_of(steps, done), words=words)

        yield watch


@contextmanager
def share_of(title: str) -> Iterator[Callable[[float], None]]:
    """Show on standard error which share of some work is done; where that is not a terminal, in lines."""
    in_file = in_lines(title)
    with bar_of(title, 1.0) as (bar, task):

        def watch(share: float) -> None:
            bar.update(task, completed=share)
            in_file(share)

        yield watch


def in_lines(title: str) -> Callable[[float], None]:
    """Return what tells in lines on standard error which share is done, unless that is a terminal."""
    began = last = time.monotonic()
    silent = is_quiet() or plain_console(stderr=True).is_terminal

    def tell(share: float) -> None:
        nonlocal last
        now = time.monotonic()
        if silent or now - last < EVERY_S or not 0.0 < share <= 1.0:
            return
        last = now
        left = duration((now - began) * (1.0 - share) / share)
        say(f"chainslam: {title}: {100.0 * share:.0f} % after {duration(now - began)}, {left} left", stderr=True)

    return tell


@contextmanager
def bar_of(title: str, total: float | None, *columns: ProgressColumn) -> Iterator[tuple[Progress, TaskID]]:
    """Yield a bar on standard error, and its task, with the computing time so far and what is left of it."""
    console = plain_console(stderr=True)
    left = (
        ()
        if total is None
        else (TextColumn("left"), TimeRemainingColumn(compact=True, table_column=Column(no_wrap=True, min_width=5)))
    )
    shown = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=8),
        *columns,
        TextColumn("computing"),
        TimeElapsedColumn(table_column=Column(no_wrap=True, min_width=7)),
        *left,
    )
    with Progress(*shown, console=console, disable=not console.is_terminal or is_quiet(), transient=True) as bar:
        yield bar, bar.add_task(title, total=total, words="")


def total_of(expected: float | None, done: int) -> float | None:
    """Return what counts as the whole of a run: what was expected, or a little more than is done already."""
    return None if expected is None else max(expected, done / ALMOST)


def duration(seconds: float) -> str:
    """Return a time in words of two units at most."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
