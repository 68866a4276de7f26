"""Figure 5: the open end nearest to the robot, a depth-first search."""

from .reproduction import Numbers, Reproduction, Said
from .runs.drives import driven
from .runs.traversals import NEAREST_ROBOT, NOTES, noisy, traversal_figure, traversal_numbers

SAID: Said = {"passes by the start": 1}


def numbers(seed: int) -> Numbers:
    """Return the results of one drive with noise."""
    return traversal_numbers(noisy(NEAREST_ROBOT, seed))


def reproduce(_seed: int) -> Reproduction:
    """Explore the world of figure 5 by `nearest-robot`, without noise."""
    made = driven(NEAREST_ROBOT)
    length = made.summary["path_length_m"]
    return Reproduction(
        "Figure 5: next to actual position",
        SAID,
        traversal_numbers(NEAREST_ROBOT),
        traversal_figure(f"Figure 5: nearest-robot, errorless, {length:.0f} m", made),
        NOTES,
    )
