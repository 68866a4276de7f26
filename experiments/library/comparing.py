"""`compare` as a function, and a campaign's folder as an object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chainslam.explore.following.wall_following import Following
from chainslam.explore.planning.navigators import Navigation

from ..artifacts.reading import read_json
from ..artifacts.settings import drawing_said, options_of
from ..campaign.cluster import on_dask
from ..campaign.comparison.story import story_of
from ..campaign.comparison.tables import write_tables
from ..campaign.plan import check_campaign, check_parts, drawing_of, trials
from ..campaign.plugins import register_installed
from ..campaign.runner import on_cores, run_campaign
from ..campaign.store import opened, read_campaigns
from ..commands.compare import Compare
from ..replays.replay import Association
from ..scenario import P0, load_world
from .runs import Home, Run, run_at, table_at

if TYPE_CHECKING:
    from typing import Literal

COMPARISON = "comparison.json"
REMEDY = "name a folder that compare left"


@dataclass(frozen=True)
class Comparison:
    """What `compare` left in a folder."""

    folder: Path
    """Where its files are (docs/reference/files.md); without a folder of its own they go with this object."""
    _home: Home | None = field(default=None, repr=False, compare=False)

    @cached_property
    def trials(self) -> Any:
        """Return `trials.csv`, a row for each trial: a pandas DataFrame, or arrays by name where pandas is missing."""
        return table_at(self.folder / "trials.csv")

    @cached_property
    def comparison(self) -> dict[str, Any]:
        """Return `comparison.json`: means, differences and their intervals."""
        return read_json(self.folder / COMPARISON, dict, REMEDY)

    @property
    def verdict(self) -> list[str]:
        """Return in words what the campaign found."""
        return list(story_of(read_campaigns(self.folder)[0], self.comparison).verdict)

    def report(self) -> Path:
        """Write the page that `chainslam report` writes, and return its place."""
        from ..commands.report import REPORT, Report

        Report(self.folder).write()
        return self.folder / REPORT

    def __repr__(self) -> str:
        return f"Comparison({self.folder})"


def compare(
    *,
    worlds: Sequence[str | Path],
    backends: Sequence[str],
    strategies: Sequence[str] = ("nearest-robot",),
    trials: int = 10,
    first_seed: int = 1,
    modes: Sequence[Literal["closed", "replay"]] = ("closed", "replay"),
    association: Sequence[Association] = ("own", "true"),
    driver: str = "full-ekf",
    p0: P0 = "small",
    max_steps: int | None = None,
    navigation: Navigation = "floor",
    following: Following = "viewpoints",
    scale: float | None = None,
    layers: Sequence[str] = (),
    ids: Sequence[str] = (),
    without: Sequence[str] = (),
    level: str | None = None,
    threshold: float | None = None,
    negate: bool = False,
    robot: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
) -> Comparison:
    """Run many trials and return their comparison; `chainslam compare` as a function.

    `scale` to `negate` say what the worlds' files leave open. `jobs` processes run them, one a core by default, or
    the workers of the Dask scheduler at the address `dask`. The same call with the same `out` goes on where it was
    stopped.
    Raises UsageError, in one line, for bad input.
    """
    register_installed()
    home: Home | None = None
    if out is None:
        home = Home()
        out = home.folder / "campaign"
    command = Compare(
        out=Path(out), worlds=tuple(map(str, worlds)), backends=tuple(backends), strategies=tuple(strategies),
        trials=trials, first_seed=first_seed, modes=tuple(modes), association=tuple(association), driver=driver, p0=p0,
        max_steps=max_steps, navigation=navigation, following=following,
        drawing=drawing_said(
            scale=scale, layers=tuple(layers), ids=tuple(ids), without=tuple(without), level=level,
            threshold=threshold, negate=negate,
        ),
        robot=None if robot is None else str(robot),
        set=tuple(options_of((settings or {}).items())[1::2]), jobs=jobs,
    )  # fmt: skip
    campaign = command.campaign
    check_campaign(campaign)
    check_parts(campaign)
    for world in campaign.worlds:
        load_world(world, drawing=drawing_of(campaign))
    with opened(command.out, campaign) as store:
        run_campaign(store, on_cores(jobs) if dask is None else on_dask(dask))
        write_tables(command.out, campaign, _trials(campaign), store.record)
    return Comparison(command.out, home)


_trials = trials


def load(folder: str | Path) -> Run | Comparison:
    """Return the run or the comparison in a folder; raises UsageError, in one line, where there is neither."""
    place = Path(folder)
    if not (place / COMPARISON).is_file():
        return run_at(place)
    found = Comparison(place)
    _ = found.comparison
    return found
