"""Figure 8: the cyclic environment of 7 m x 7 m, explored and mapped."""

from chainslam.viz.figures.panels import map_panels

from .reproduction import Numbers, Reproduction, Said
from .runs.drives import PAPER, drive_by_walls, last_map
from .runs.maps import compared, map_numbers, map_words, mark

SAID: Said = {
    "path, m": 33.0,
    "contours closed": "the cycle",
    "error of named corners' distances, worst, cm": "5 (Table 1, rounded to 5)",
}


def numbers(seed: int) -> Numbers:
    """Return the results of each back end for one drive."""
    return {name: map_numbers(result) for name, result in compared(drive_by_walls("paper-fig8", seed=seed)).items()}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 8 by the nearest open end, and map its scans with each back end."""
    results = compared(drive_by_walls("paper-fig8", seed=seed))
    maps = [last_map(result, f"{name}: {map_words(result)}") for name, result in results.items()]
    figure, axes = map_panels(f"Figure 8, seed {seed}: the same scans through four back ends", maps, 2)
    mark(axes[0], results[PAPER])
    return Reproduction(
        "Figure 8: the cyclic environment of 7 m x 7 m",
        SAID,
        numbers(seed),
        figure,
        (f"One drive by {PAPER}, nearest-robot; the others map its scans with their own gate.",),
    )
