"""Shared drives of the reproductions: recorded with the paper's filter, replayed with the others."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz import palette
from chainslam.viz.figures.panels import SmallMap

from ...artifacts.presets import METHODS, preset_of
from ...artifacts.settings import trial_of
from ...replays.recordings import recorded
from ...replays.replay import replay
from ...scenario import TrialConfig
from ...scoring.maps.coverage import alignment
from ...scoring.records import Log
from ...trial import TrialResult, run_trial
from ...views.timelines import true_rings

PAPER = METHODS["paper-method"].backend
"""The paper's estimator, which drives."""
BESIDE = (PAPER, "full-ekf", "invariant-ekf", "graph")
"""The estimators that are compared."""


@lru_cache(maxsize=16)
def driven(config: TrialConfig) -> TrialResult:
    """Return a trial, run once; raises UsageError for bad names."""
    return run_trial(config)


@lru_cache(maxsize=64)
def replayed(config: TrialConfig, backend: str) -> TrialResult:
    """Return the result of a back end with its own gate on the scans of a trial; raises UsageError likewise."""
    made = driven(config)
    return made if backend == config.backend else replay(recorded(made), backend, world=made.scenario.world)


MAX_STEPS = 6000
"""A drive is stopped after this many scans, since the paper's robot may not end among duplicate walls."""


def drive_by_walls(world: str, **settings: Any) -> TrialConfig:
    """Return a drive of the paper's robot: its estimator, matching, wall following and navigation (paper-method)."""
    return replace(trial_of(preset_of("paper-method")), world=world, max_steps=MAX_STEPS, **settings)


def there_and_back(seed: int) -> TrialConfig:
    """Return the drive of figures 10 and 11: the world of figure 9 from an uncertain start, and back to it."""
    config = drive_by_walls("paper-fig9", seed=seed, p0="large")
    return replace(config, mission=replace(config.mission, return_to_start=True))


def log_of(result: TrialResult) -> Log:
    """Return the steps of a trial; raises ValueError where there were none."""
    if result.log is None:
        raise ValueError(f"expected a run of at least one step, found none: {result.ending.reason}")
    return result.log


def to_true(result: TrialResult) -> Float[np.ndarray, "3"]:
    """Return the motion that undoes the initial pose error, which is unobservable."""
    return alignment(result.scenario.start_estimate, log_of(result).true_world[0])


def small_map(
    result: TrialResult, title: str, walls: StochasticMap, chains: tuple[Chain, ...], steps: int | None = None
) -> SmallMap:
    """Return the map after this many steps in the true frame, for a picture; after all without `steps`."""
    closed = {wall for chain in chains if chain.is_closed for wall in chain.walls}
    moved = to_true(result)
    path = log_of(result).estimated_world[:steps, :2]
    return SmallMap(
        title, to_world(walls.ends_world, moved), np.isin(walls.ids, sorted(closed)), walls.tentative.copy(),
        to_world(path, moved), true_rings(result.scenario.world),
    )  # fmt: skip


def last_map(result: TrialResult, title: str) -> SmallMap:
    """Return the map at the end of a trial, for a picture."""
    assert result.last is not None
    return small_map(result, title, result.last.map, result.last.chains)


def trace_over_start(result: TrialResult) -> Float[np.ndarray, " s"]:
    """Return the trace of the pose covariance (m^2 and rad^2 added, as the paper does) over that of the start."""
    start = result.scenario.start_cov
    return np.asarray(np.trace(log_of(result).estimated_cov, axis1=1, axis2=2) / np.trace(start))


def mark_double(axes: Axes, small: SmallMap, rows: Int[np.ndarray, " 2"], letter: str) -> None:
    """Name a wall and its duplicate, with a star, in a picture of a map, as in the paper's figure 10."""
    for row, name, colour in zip(rows, (letter, f"{letter}*"), (palette.ALARM, palette.REFUSED), strict=True):
        ends = small.ends_world[row]
        axes.plot(*ends.T, color=colour, linewidth=2.6, linestyle="-" if name == letter else (0, (1.5, 1.0)), zorder=5)
        offset = (-12, 6) if name == letter else (8, -10)
        axes.annotate(
            name, ends.mean(axis=0), xytext=offset, textcoords="offset points", size=10, weight="bold", color=colour
        )
