"""Tables that studies fill: a row for each run as soon as it is done, found again by a later call."""

import csv
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from rich.progress import track
from rich.table import Table

from experiments.artifacts.files import csv_bytes, write
from experiments.terminal.console import plain_console
from experiments.usage import UsageError

Key = tuple[str, ...]
Rows = dict[Key, Sequence[Any]]
Task = TypeVar("Task")


def fill(
    path: Path,
    columns: tuple[tuple[str, ...], tuple[str, ...]],
    tasks: Mapping[Task, Sequence[Key]],
    run: Callable[[Task], Rows],
    jobs: int,
) -> dict[Key, Float[np.ndarray, " c"]]:
    """Return the scores under every key that the tasks are to give; NaN for an empty cell.

    `columns` names the parts of a key and the scores. Tasks run in `jobs` processes, those excepted whose rows the
    table at `path` has already; it is written anew whenever one is done. Raises UsageError for another table.
    """
    rows = _read(path, columns)
    missing = [task for task, keys in tasks.items() if any(key not in rows for key in keys)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs) as pool:
        done = pool.map(run, missing)
        for found in track(done, "running", len(missing), console=plain_console(stderr=True)):
            rows |= found
            cells = [(*key, *scores) for key, scores in sorted(rows.items())]
            write(path, csv_bytes((*columns[0], *columns[1]), cells))
    wanted = [key for keys in tasks.values() for key in keys]
    return {key: np.array([np.nan if v in ("", None) else float(v) for v in rows[key]]) for key in wanted}


def _read(path: Path, columns: tuple[tuple[str, ...], tuple[str, ...]]) -> Rows:
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        header, *rows = [*csv.reader(file)] or [[]]
    if tuple(header) != (*columns[0], *columns[1]):
        raise UsageError(f"expected a table of this study or none at {path}, found another: name another --out")
    width = len(columns[0])
    return {tuple(row[:width]): row[width:] for row in rows}


def bootstrap(values: Float[np.ndarray, " n"], draws: int = 2000, seed: int = 0) -> tuple[float, float]:
    """Return the 95 % interval of the mean, by resampling whole runs."""
    rng = np.random.default_rng(seed)
    means = rng.choice(values, (draws, len(values))).mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


def show(title: str, runs: Mapping[str, Float[np.ndarray, "r c"]], scores: Sequence[str]) -> None:
    """Print for each back end the mean of each score over its runs, the 95 % interval of that mean, and the median."""
    table = Table("back end", *scores, "failed", title=title, caption="mean (95 % interval), median")
    for name, values in runs.items():
        sound = values[np.isfinite(values).all(axis=1)]
        cells = [_summary(column) for column in sound.T] if len(sound) else ["-"] * len(scores)
        table.add_row(name, *cells, str(len(values) - len(sound)))
    plain_console(width=max(plain_console().width, 140)).print(table)


def _summary(values: Float[np.ndarray, " n"]) -> str:
    low, high = bootstrap(values)
    return f"{values.mean():.3f} ({low:.3f} to {high:.3f}), {np.median(values):.3f}"
