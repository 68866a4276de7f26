"""A campaign as one recording for Rerun's viewer."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..replay import ReplayOptions, read_run
from ..scenario import UsageError
from ..timelines import record_comparison
from .plan import Campaign


def record_campaign(folder: Path, campaign: Campaign, rrd: Path) -> list[str]:
    """Record the tables in a campaign's folder and the first of its logs through all back ends, side by side.

    Returns, in words, what could not be written; raises UsageError for a folder without its tables.
    """
    logs = sorted((folder / "recordings").rglob("log.npz"))
    run = read_run(logs[0]) if logs else None
    title = f"campaign: {', '.join(campaign.worlds)}; {campaign.trials} trials a cell"
    if run is not None:
        title += f"; side by side: {run.trial.world}, seed {run.trial.seed}"
    trials, steps = (_rows(folder / f"{name}.parquet") for name in ("trials", "steps"))
    return record_comparison(rrd, title, trials, steps, run, campaign.backends, ReplayOptions())


def record_summary(folder: Path, title: str, rrd: Path) -> list[str]:
    """Record only the tables in a campaign's folder; raises UsageError where it has none."""
    trials, steps = (_rows(folder / f"{name}.parquet") for name in ("trials", "steps"))
    return record_comparison(rrd, title, trials, steps, None, (), ReplayOptions())


def _rows(table: Path) -> list[dict[str, Any]]:
    try:
        rows: list[dict[str, Any]] = pq.read_table(table).to_pylist()
    except (OSError, pa.ArrowInvalid) as error:
        raise UsageError(
            f"expected a table of the campaign, found no {table}: the same `compare` again writes it"
        ) from error
    return rows
