"""`compare` as a function, and a campaign's folder as an object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chainslam.explore.following.wall_following import Following, Navigation

from ..artifacts.reading import read_json
from ..artifacts.settings import drawing_said, drawing_settings, settings_of
from ..campaign.cluster import on_dask
from ..campaign.comparison.tables import read_comparison, write_tables
from ..campaign.merge import union
from ..campaign.pages.lines import lines_of
from ..campaign.plan import check_campaign, check_parts, drawing_of, trials
from ..campaign.plugins import register_installed
from ..campaign.runner import on_cores, run_campaign
from ..campaign.store import opened, read_campaigns
from ..replays.paths.external import register
from ..replays.replay import Association
from ..scenario import P0, load_world
from .asked import CampaignName, asked_campaign
from .pages import report_at
from .runs import Home, Run, run_at, table_at

if TYPE_CHECKING:
    from typing import Literal

COMPARISON = "comparison.json"
REMEDY = "name a folder that compare left"


@dataclass(frozen=True)
class Comparison:
    """A campaign, over the files in its folder."""

    folder: Path
    """Folder of its files; if `out` was not given they are deleted together with this object."""
    _home: Home | None = field(default=None, repr=False, compare=False)

    @cached_property
    def trials(self) -> Any:
        """`trials.csv`, one row for each trial: a pandas DataFrame, or arrays by name without pandas."""
        return table_at(self.folder / "trials.csv")

    @cached_property
    def comparison(self) -> dict[str, Any]:
        """`comparison.json`: means, differences and their intervals."""
        return read_json(self.folder / COMPARISON, dict, REMEDY)

    @property
    def verdict(self) -> list[str]:
        """The findings, in words."""
        return list(lines_of(union(read_campaigns(self.folder)), read_comparison(self.folder)))

    def report(self) -> Path:
        """Write the page of `chainslam report` and return its path."""
        return report_at(self.folder)[1]

    def __repr__(self) -> str:
        campaign = read_campaigns(self.folder)[0]
        cells = f"{', '.join(campaign.worlds)} by {', '.join(campaign.backends)}"
        return f"Comparison({cells}, {campaign.trials} trials each, in {self.folder})"

    def _repr_html_(self) -> str:
        """Return the findings as HTML for a notebook."""
        return "".join(f"<p>{escape(line)}</p>" for line in (repr(self), *self.verdict))


def compare(
    *,
    preset: CampaignName | None = None,
    worlds: Sequence[str | Path] | None = None,
    backends: Sequence[str] | None = None,
    strategies: Sequence[str] | None = None,
    trials: int | None = None,
    first_seed: int = 1,
    modes: Sequence[Literal["closed", "replay"]] = ("closed", "replay"),
    association: Sequence[Association] = ("own", "true"),
    external: Mapping[str, str] | None = None,
    driver: str = "full-ekf",
    p0: P0 = "small",
    errorless: bool = False,
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
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
) -> Comparison:
    """Run many trials and return their comparison, as `chainslam compare` does.

    Without a `preset`, `worlds` and `backends` must be given; by default there are ten trials each, with the strategy
    nearest-robot. `external` are the commands of external programs that tell poses, by name
    (docs/howto/external.md). `scale` to `negate` are the command's options for drawings. Trials run in `jobs`
    processes, by default one for each core, or on the workers of the Dask scheduler at the address `dask`. The same
    call with the same `out` continues a campaign that was stopped. Raises UsageError for bad input.
    """
    register_installed()
    home: Home | None = None
    if out is None:
        home = Home()
        out = home.folder / "campaign"
    if preset is None:
        strategies, trials = strategies or ("nearest-robot",), 10 if trials is None else trials
    said: dict[str, Any] = {
        "navigation": navigation, "following": following, "errorless": errorless, "p0": p0, "max_steps": max_steps,
    }  # fmt: skip
    cells: dict[str, Any] = {"worlds": worlds and tuple(map(str, worlds)), "backends": backends and tuple(backends)}
    cells |= {"strategies": strategies and tuple(strategies), "trials": trials}
    drawing = drawing_said(
        scale=scale, layers=tuple(layers), ids=tuple(ids), without=tuple(without), level=level, threshold=threshold,
        negate=negate,
    )  # fmt: skip
    campaign = asked_campaign(
        cells,
        {name: value for name, value in said.items() if value != DEFAULTS[name]},
        drawing_settings(drawing),
        preset,
        None if robot is None else str(robot),
        None if config is None else Path(config),
        settings_of(settings or {}),
        modes=tuple(modes),
        association=tuple(association),
        driver=driver,
        first_seed=first_seed,
        external=register([f"{name}={command}" for name, command in (external or {}).items()], is_here=dask is None),
    )
    check_campaign(campaign)
    check_parts(campaign)
    for world in campaign.worlds:
        load_world(world, drawing=drawing_of(campaign))
    with opened(Path(out), campaign) as store:
        run_campaign(store, on_cores(jobs) if dask is None else on_dask(dask))
        write_tables(Path(out), campaign, _trials(campaign), store.record)
    return Comparison(Path(out), home)


_trials = trials
DEFAULTS = {name: each.default for name, each in signature(compare).parameters.items()}


def load(folder: str | Path) -> Run | Comparison:
    """Return the run or the comparison in a folder; raises UsageError if there is neither."""
    place = Path(folder)
    if not (place / COMPARISON).is_file():
        return run_at(place)
    found = Comparison(place)
    _ = found.comparison
    return found
