"""Figure 9: 12 m x 9 m around a big obstacle, in the order in which it was explored."""

import numpy as np

from chainslam.explore.step import Step
from chainslam.viz.figures.panels import SmallMap, map_panels

from ..scenario import TrialConfig
from .reproduction import Numbers, Reproduction, Said
from .runs.doubles import Double, first_double, watched
from .runs.drives import PAPER, drive_by_walls, last_map, log_of, mark_double, small_map
from .runs.maps import compared, map_numbers, map_words, mark

STAGES_M = (4.0, 12.0)
"""Path lengths of the pictures before the obstacle's chain is closed."""

TRIED = "seeds tried until there is a duplicate wall"
SAID: Said = {
    "first chain closed after, m": "16 (around the obstacle)",
    "contours closed": "the obstacle's; open ends left elsewhere",
    "error of named corners' distances, worst, cm": "less than 20",
    "duplicate walls": "1 visible",
}


def numbers(seed: int) -> Numbers:
    """Return the results of each back end for one drive."""
    return {name: map_numbers(result) for name, result in compared(drive_by_walls("paper-fig9", seed=seed)).items()}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 9 until there is a duplicate wall; show the growing map, and every back end's."""
    search = first_double(drive_by_walls("paper-fig9", seed=seed))
    config, double = search.config, search.double
    results = compared(config)
    stages = _stages(config, double)
    maps = [small for small, _ in stages]
    maps += [last_map(result, f"{name}: {map_words(result)}") for name, result in results.items()]
    title = f"Figure 9, seed {config.seed} ({search.tried} tried): {PAPER} explores; its scans through four back ends"
    figure, axes = map_panels(title, maps, 4)
    mark(axes[len(stages)], results[PAPER])
    for one, (small, step) in zip(axes, stages, strict=False):
        if double is not None and step.index == double.standing[-1]:
            mark_double(one, small, step.map.belief.rows(double.ids), "W")
    ours = {name: map_numbers(result) for name, result in results.items()}
    ours[PAPER][TRIED] = search.tried
    return Reproduction(
        "Figure 9: 12 m x 9 m around a big obstacle",
        SAID,
        ours,
        figure,
        (
            f"One drive by --preset paper-method, nearest-robot: {search.words}.",
            "The other back ends map its scans by the same mapper, each with its own gate.",
        ),
    )


def _stages(config: TrialConfig, double: Double | None) -> list[tuple[SmallMap, Step]]:
    """Return the map at some path lengths, at the first closed chain, and at a duplicate wall."""
    drive = watched(config)
    log = log_of(drive.made)
    wanted = {int(np.searchsorted(log.path_length_m, at)): "" for at in STAGES_M if at < log.path_length_m[-1]}
    wanted |= dict.fromkeys(np.flatnonzero(log.closed_chains > 0)[:1].tolist(), ", the first chain is closed")
    wanted |= {} if double is None else {double.standing[-1]: ", a duplicate of wall W"}
    found = []
    for index, words in sorted(wanted.items()):
        step = drive.steps[index]
        title = f"{PAPER} after {step.path_length_m:.1f} m{words}"
        found.append((small_map(drive.made, title, step.map, step.chains, index + 1), step))
    return found
