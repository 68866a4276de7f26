"""Scores of many runs by several back ends: gathered row by row, with the intervals of their means."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.experiments.terminal.console import plain_console

from .rows import Row, key_of, rows_of

Key = tuple[str, ...]
Scores = Sequence[float | None]
Task = TypeVar("Task", bound=Hashable)


def fill(
    path: Path,
    columns: tuple[tuple[str, ...], tuple[str, ...]],
    tasks: Mapping[Task, Sequence[Key]],
    run: Callable[[Task], Mapping[Key, Scores]],
    jobs: int,
) -> dict[Key, Float[np.ndarray, " c"]]:
    """Return the scores under every key that the tasks are to give; NaN for what could not be scored.

    `columns` names the parts of a key and the scores. Tasks run in `jobs` processes, those excepted whose rows the
    file at `path` has already. Raises UsageError for a file of something else.
    """
    names, scores = columns
    perform = partial(_rows, columns, run)
    found = rows_of(path, names, tasks.items(), perform, jobs)
    return {
        key_of(row, names): np.array([np.nan if row[name] is None else row[name] for name in scores], dtype=np.float64)
        for row in found
    }


def _rows(
    columns: tuple[tuple[str, ...], tuple[str, ...]], run: Callable[[Task], Mapping[Key, Scores]], task: Task
) -> list[Row]:
    names, scores = columns
    return [dict(zip((*names, *scores), (*key, *values), strict=True)) for key, values in run(task).items()]


def precision(
    estimated_world: Float[np.ndarray, "s 3"], covs: Float[np.ndarray, "s 3 3"], true_world: Float[np.ndarray, "s 3"]
) -> tuple[float, float]:
    """Return how far positions are off, rms over all steps, m, and how far the estimate says that they are."""
    off = estimated_world[:, :2] - true_world[:, :2]
    stated = np.trace(covs[:, :2, :2], axis1=1, axis2=2)
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1)))), float(np.sqrt(np.mean(stated)))


def interval_words(values: Float[np.ndarray, " n"], digits: int = 3, is_log: bool = False) -> str:
    """Return the 95 % interval of the mean over runs in brackets, of `is_log` values their exponentials'.

    Fewer than five runs have none.
    """
    ends = mean_interval(values)
    if ends is None:
        return f"({len(values)} runs: no interval)"
    low, high = np.exp(ends) if is_log else ends
    return f"({low:.{digits}f} to {high:.{digits}f})"


def show(title: str, runs: Mapping[str, Float[np.ndarray, "r c"]], scores: Sequence[str]) -> None:
    """Print for each back end the mean of each score over its runs, the 95 % interval of that mean, and the median."""
    table = Table("back end", *scores, "failed", title=title, caption="mean (95 % interval), median")
    for name, values in runs.items():
        sound = values[np.isfinite(values).all(axis=1)]
        cells = [_summary(column) for column in sound.T] if len(sound) else ["-"] * len(scores)
        table.add_row(name, *cells, str(len(values) - len(sound)))
    plain_console(width=max(plain_console().width, 140)).print(table)


def _summary(values: Float[np.ndarray, " n"]) -> str:
    return f"{values.mean():.3f} {interval_words(values)}, {np.median(values):.3f}"
