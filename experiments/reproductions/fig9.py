"""Figure 9: 12 m x 9 m around a big obstacle, in the order in which it was explored."""

import numpy as np

from explore.step import Step
from viz.figures.curves import SmallMap
from viz.figures.panels import map_panels

from ..scenario import TrialConfig
from ..trial import TrialResult, run_trial
from .reproduction import Numbers, Reproduction, Said
from .runs.drives import PAPER, drive_by_walls, last_map, log_of, small_map
from .runs.maps import compared, map_numbers, map_words, mark

STAGES_M = (4.0, 12.0)
"""Path driven at the pictures before the obstacle's chain is closed."""

SAID: Said = {
    "first chain closed after, m": "16 (around the obstacle)",
    "contours closed": "the obstacle's; open ends left elsewhere",
    "error of named corners' distances, worst, cm": "less than 20",
    "double entries": "1 visible",
}


def numbers(seed: int) -> Numbers:
    """Return what each back end makes of one drive."""
    return {name: map_numbers(result) for name, result in compared(drive_by_walls("paper-fig9", seed=seed)).items()}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 9, show the map as it grows, and map its scans with each back end."""
    config = drive_by_walls("paper-fig9", seed=seed)
    results = compared(config)
    maps = _stages(config, results[PAPER])
    maps += [last_map(result, f"{name}: {map_words(result)}") for name, result in results.items()]
    figure, axes = map_panels(f"Figure 9, seed {seed}: {PAPER} explores; its scans through four back ends", maps, 4)
    mark(axes[len(maps) - len(results)], results[PAPER])
    return Reproduction(
        "Figure 9: 12 m x 9 m around a big obstacle",
        SAID,
        numbers(seed),
        figure,
        (f"One drive by {PAPER}, nearest-robot; the others map its scans with their own gate.",),
    )


def _stages(config: TrialConfig, result: TrialResult) -> list[SmallMap]:
    """Return the map at some places of the path and where the first chain was closed; the drive is made once more."""
    log = log_of(result)
    closed = np.flatnonzero(log.closed_chains > 0)
    wanted = {int(np.searchsorted(log.path_length_m, at)) for at in STAGES_M if at < log.path_length_m[-1]}
    wanted |= set(closed[:1].tolist())
    maps = []

    def watch(step: Step) -> None:
        if step.index in wanted:
            words = ", the first chain is closed" if step.index in closed[:1] else ""
            title = f"{PAPER} after {step.path_length_m:.1f} m{words}"
            maps.append(small_map(result, title, step.map, step.chains, step.index + 1))

    run_trial(config, watch, result.scenario.world)
    return maps
