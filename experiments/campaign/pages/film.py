"""A campaign as one recording for Rerun's viewer."""

from pathlib import Path

from chainslam.slam.backends import BACKENDS

from ...replays.replay import ReplayOptions, read_run
from ...views.timelines import record_comparison
from ..comparison.tables import read_rows
from ..plan import Campaign


def record_campaign(folder: Path, campaign: Campaign, rrd: Path) -> list[str]:
    """Record the tables in a campaign's folder and the first of its logs through all back ends, side by side.

    Returns, in words, what could not be written; raises UsageError for a folder without its tables.
    """
    logs = sorted((folder / "recordings").rglob("log.npz"))
    run = read_run(logs[0]) if logs else None
    title = f"campaign: {', '.join(campaign.worlds)}; {campaign.trials} trials a cell"
    if run is not None:
        title += f"; side by side: {run.trial.world}, seed {run.trial.seed}"
    trials, steps = (read_rows(folder / f"{name}.parquet") for name in ("trials", "steps"))
    estimators = [name for name in campaign.backends if name in BACKENDS]
    return record_comparison(rrd, title, trials, steps, run, estimators, ReplayOptions())
