"""The pictures of a campaign's report."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Float

from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds import DrawingOptions
from chainslam.viz import palette
from chainslam.viz.figures.maps import saved
from chainslam.viz.figures.panels import SmallMap, map_figures
from chainslam.viz.figures.plots import NeesCurve, draw_coverage, draw_nees
from chainslam.viz.reports.report import PagePicture

from ...scenario import load_world
from ...usage import UsageError
from ..comparison.comparison import BASELINE_BACKEND, BASELINE_STRATEGY
from ..comparison.curves import along_path
from ..plan import CLOSED, Campaign, Trial, drawing_of, trials, world_key
from ..scores.score import TrialScores
from ..store import Store
from .tables import ARMS

NEES = "pose_nees_from_start"
Arrays = dict[str, np.ndarray]


def nees_pictures(folder: Path, campaigns: Sequence[Campaign], arms: Sequence[str]) -> tuple[PagePicture, ...]:
    """Return the NEES along the path for each arm and world, as median over the runs of each estimator."""
    pictures = []
    for arm in arms:
        runs: dict[str, dict[str, list[tuple[np.ndarray, np.ndarray]]]] = {}
        for trial, record in _stored(folder, campaigns, arm):
            cell = runs.setdefault(world_key(trial.world), {}).setdefault(trial.backend, [])
            path = record.arrays.get("path_length_m", np.zeros(0))
            cell.append((path, record.arrays.get(NEES, np.full(len(path), np.nan))))
        for world, cells in runs.items():
            found = {name: along for name, cell in cells.items() if (along := along_path(cell)) is not None}
            curves = [NeesCurve(name, a.path_m, a.median, a.band, a.quartiles) for name, a in found.items()]
            if curves:
                caption = f"{world}, {ARMS[arm]}, {max(map(len, cells.values()))} runs"
                pictures.append(PagePicture(saved(draw_nees(curves), "svg"), caption))
    return tuple(pictures)


def coverage_pictures(folder: Path, campaigns: Sequence[Campaign]) -> tuple[PagePicture, ...]:
    """Return how much was mapped along the path, a picture for each world: the mean over the trials of each strategy.

    A run that has ended keeps what it had, up to the longest run of the world.
    """
    runs: dict[str, dict[str, list[Arrays]]] = {}
    for campaign in campaigns:
        backend = BASELINE_BACKEND if BASELINE_BACKEND in campaign.backends else campaign.backends[0]
        for strategy in campaign.strategies:
            for trial, record in _stored(folder, [campaign], CLOSED, strategy):
                if trial.backend == backend and "coverage" in record.arrays:
                    runs.setdefault(world_key(trial.world), {}).setdefault(strategy, []).append(record.arrays)
    pictures = []
    for world, cells in runs.items():
        end = max(float(arrays["coverage_path_m"][-1]) for cell in cells.values() for arrays in cell)
        metres = np.linspace(0.0, end, 101)
        curves = {
            name: (metres, np.mean([np.interp(metres, a["coverage_path_m"], a["coverage"]) for a in cell], axis=0))
            for name, cell in cells.items()
        }
        colours = {name: palette.of_rank(rank) for rank, name in enumerate(dict.fromkeys((*STRATEGIES, *curves)))}
        caption = f"{world}, mean over {max(map(len, cells.values()))} runs of a strategy"
        pictures.append(PagePicture(saved(draw_coverage(curves, colours), "svg"), caption))
    return tuple(pictures)


def map_pictures(folder: Path, campaigns: Sequence[Campaign], arm: str) -> dict[str, tuple[PagePicture, ...]]:
    """Return, by world, the map of each estimator on the first seed, all of a world at one scale."""
    found: dict[str, tuple[PagePicture, ...]] = {}
    for campaign in campaigns:
        for world in campaign.worlds:
            floor = _floor(world, drawing_of(campaign))
            maps = {
                f"{trial.backend}: {record.summary['status']}": _map(record.arrays, floor)
                for trial, record in _stored(folder, [campaign], arm, world=world, seed=campaign.first_seed)
                if len(record.arrays.get("map_ends", ()))
            }
            if maps:
                drawn = zip(maps, map_figures(list(maps.values())), strict=True)
                shown = (PagePicture(saved(figure, "svg"), caption) for caption, figure in drawn)
                found[world_key(world)] = (*found.get(world_key(world), ()), *shown)
    return found


def strategy_shown(campaign: Campaign) -> str:
    """Return the strategy whose runs are shown."""
    return BASELINE_STRATEGY if BASELINE_STRATEGY in campaign.strategies else campaign.strategies[0]


def _stored(
    folder: Path, campaigns: Sequence[Campaign], arm: str, strategy: str | None = None,
    world: str | None = None, seed: int | None = None,
) -> Iterator[tuple[Trial, TrialScores]]:  # fmt: skip
    """Yield what trials of one arm left, those of the strategy that is shown where none is named."""
    for campaign in campaigns:
        store, by = Store(folder, campaign), strategy or strategy_shown(campaign)
        for trial in trials(campaign):
            if (trial.arm, trial.strategy) == (arm, by) and world in (None, trial.world) and seed in (None, trial.seed):
                yield trial, store.record(trial)


def _map(arrays: Arrays, floor: tuple[Float[np.ndarray, "_ 2"], ...]) -> SmallMap:
    return SmallMap(
        "", arrays["map_ends"], arrays["map_closed"], arrays["map_tentative"], arrays["path_estimated"], floor
    )


def _floor(world: str, drawing: DrawingOptions) -> tuple[Float[np.ndarray, "_ 2"], ...]:
    """Return the rings of a world's floor; none if its file no longer exists."""
    try:
        free = load_world(world, drawing=drawing).free
    except UsageError:
        return ()
    return tuple(shapely.get_coordinates(ring) for ring in (free.exterior, *free.interiors))
