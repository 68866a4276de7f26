"""The pictures of a campaign's report."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float
from msgspec import defstruct

from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds import DrawingOptions
from chainslam.viz import palette
from chainslam.viz.figures.curves import Curve, Ratio, SmallMap, anees_figure, map_figure, ratio_figure
from chainslam.viz.figures.maps import png
from chainslam.viz.figures.plots import draw_coverage
from chainslam.viz.reports.report import PagePicture

from ...artifacts.reading import told
from ...artifacts.schema import fit, many
from ...scenario import load_world
from ...usage import UsageError
from ..comparison.comparison import BASELINE_BACKEND, BASELINE_STRATEGY
from ..comparison.tables import read_rows
from ..comparison.words import ARMS_SHORT
from ..plan import CLOSED, Campaign, Trial, drawing_of, trials, world_key
from ..store import Store

MARGIN_M = 0.5
RATIO_LABELS = {
    "pose_anees_from_start": "pose ANEES from the start over that of full-ekf",
    "wall_rmse_m": "error of walls over that of full-ekf",
}

_NAMES = ("world", "strategy", "backend", "mode", "association")
_CURVE = ("path_length_m", "pose_anees", "band_low", "band_high")
Row = defstruct("Row", [*((name, str) for name in _NAMES), *((name, float | None) for name in _CURVE)])


def curve_pictures(folder: Path, campaign: Campaign) -> tuple[PagePicture, ...]:
    """Return the ANEES along the way, a picture for each world and arm, by the baseline strategy."""
    rows = read_rows(folder / "steps.parquet", (*_NAMES, *_CURVE))
    with told(folder / "steps.parquet", "run the same `compare` to its end"):
        fit(many(Row), rows, "rows")
    arrays = {name: np.array([row[name] for row in rows]) for name in (*_NAMES, *_CURVE)}
    strategy = BASELINE_STRATEGY if BASELINE_STRATEGY in campaign.strategies else campaign.strategies[0]
    pictures = []
    for world in map(world_key, campaign.worlds):
        for arm in campaign.arms:
            mode, _, association = arm.partition("-")
            chosen = (arrays["world"] == world) & (arrays["strategy"] == strategy) & (arrays["mode"] == mode)
            chosen &= arrays["association"] == (association or "own")
            curves = [_curve(name, arrays, chosen & (arrays["backend"] == name)) for name in campaign.backends]
            curves = [curve for curve in curves if len(curve.path_m)]
            if curves:
                caption = f"{world} by {strategy}, {ARMS_SHORT[arm]}: ANEES of the pose over the trials"
                pictures.append(PagePicture(png(anees_figure(f"{world}, {ARMS_SHORT[arm]}", curves)), caption))
    return tuple(pictures)


def _curve(name: str, arrays: dict[str, np.ndarray], rows: np.ndarray) -> Curve:
    return Curve(name, *(arrays[column][rows].astype(np.float64) for column in _CURVE))


def ratio_pictures(said: dict[str, Any]) -> tuple[PagePicture, ...]:
    """Return the ratios to the full EKF with their intervals, a picture for each measure."""
    pictures = []
    for measure, label in RATIO_LABELS.items():
        rows = [row for row in said["backends"] if row["measure"] == measure and row["low"] is not None]
        rows.sort(key=lambda row: row["first"])
        ratios = [Ratio(row["first"], ARMS_SHORT[row["arm"]], row["value"], row["low"], row["high"]) for row in rows]
        if ratios:
            figure = ratio_figure(label, ratios, "ratio, 95 % interval by run")
            pictures.append(PagePicture(png(figure), f"{label}: right of the line the back end is worse"))
    return tuple(pictures)


def coverage_pictures(folder: Path, campaigns: Sequence[Campaign]) -> tuple[PagePicture, ...]:
    """Return how much was mapped along the way, a picture for each world: the mean over the trials of each strategy.

    A run that has ended keeps what it had, up to the longest run of the world.
    """
    pictures = []
    for campaign in campaigns:
        store = Store(folder, campaign)
        backend = BASELINE_BACKEND if BASELINE_BACKEND in campaign.backends else campaign.backends[0]
        for world in campaign.worlds:
            cell = [t for t in trials(campaign) if (t.world, t.backend, t.arm) == (world, backend, CLOSED)]
            runs = [(t.strategy, store.record(t).arrays) for t in cell]
            runs = [(strategy, arrays) for strategy, arrays in runs if "coverage" in arrays]
            if not runs:
                continue
            metres = np.linspace(0.0, max(float(arrays["coverage_path_m"][-1]) for _, arrays in runs), 101)
            shares: dict[str, list[np.ndarray]] = {}
            for strategy, arrays in runs:
                share = np.interp(metres, arrays["coverage_path_m"], arrays["coverage"])
                shares.setdefault(strategy, []).append(share)
            curves = {strategy: (metres, np.mean(found, axis=0)) for strategy, found in shares.items()}
            colours = {strategy: palette.of_rank(k) for k, strategy in enumerate(dict.fromkeys((*STRATEGIES, *curves)))}
            title = f"{world_key(world)}, {backend}: mean of {len(runs) // len(curves)} trials a strategy"
            caption = f"{world_key(world)}: share of the reachable contour mapped, against the way driven"
            pictures.append(PagePicture(png(draw_coverage(curves, colours, title)), caption))
    return tuple(pictures)


def map_arm(campaign: Campaign) -> str:
    """Return the arm whose maps are shown."""
    return CLOSED if CLOSED in campaign.arms else campaign.arms[0]


def map_pictures(folder: Path, campaigns: Sequence[Campaign]) -> tuple[PagePicture, ...]:
    """Return the map of every back end on one seed, a row for each world, all of a row at one scale."""
    pictures = []
    for campaign in campaigns:
        strategy = BASELINE_STRATEGY if BASELINE_STRATEGY in campaign.strategies else campaign.strategies[0]
        store, known = Store(folder, campaign), set(trials(campaign))
        for world in campaign.worlds:
            cell = [
                Trial(world, strategy, backend, map_arm(campaign), campaign.first_seed) for backend in campaign.backends
            ]
            floor = _floor(world, drawing_of(campaign))
            maps = [found for t in cell if t in known and (found := _map(store, t, floor)) is not None]
            if maps:
                points = np.concatenate([*(small.ends_world.reshape(-1, 2) for small in maps), *floor])
                low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
                pictures += [PagePicture(png(map_figure(small, low, high)), small.title) for small in maps]
    return tuple(pictures)


def _map(store: Store, trial: Trial, floor: tuple[Float[np.ndarray, "_ 2"], ...]) -> SmallMap | None:
    record = store.record(trial)
    if "map_ends" not in record.arrays or not len(record.arrays["map_ends"]):
        return None
    arrays = record.arrays
    title = f"{world_key(trial.world)}, {trial.backend}, seed {trial.seed}: {record.summary['status']}"
    return SmallMap(
        title, arrays["map_ends"], arrays["map_closed"], arrays["map_tentative"], arrays["path_estimated"], floor
    )


def _floor(world: str, drawing: DrawingOptions) -> tuple[Float[np.ndarray, "_ 2"], ...]:
    """Return the rings of a world's floor; none where its file has gone."""
    try:
        free = load_world(world, drawing=drawing).free
    except UsageError:
        return ()
    return tuple(shapely.get_coordinates(ring) for ring in (free.exterior, *free.interiors))
