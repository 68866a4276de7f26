"""Figure 6: the open end nearest to the start, a pendulum about it."""

from .reproduction import Reproduction, Value
from .runs.drives import driven
from .runs.traversals import NEAREST_ROBOT, NEAREST_START, NOTES, traversal_figure, traversal_numbers

RATIO = "path over that of figure 5"


def reproduce(_seed: int) -> Reproduction:
    """Explore the world of figure 5 by `nearest-start`, without errors, and compare the way driven."""
    made = driven(NEAREST_START)
    length = made.summary["path_length_m"]
    times = length / driven(NEAREST_ROBOT).summary["path_length_m"]
    ratio: dict[str, Value] = {RATIO: times}
    ours = {name: ratio | values for name, values in traversal_numbers(NEAREST_START).items()}
    return Reproduction(
        "Figure 6: next to start position",
        {RATIO: "about 3", "passes by the start": "regularly"},
        ours,
        traversal_figure(f"Figure 6: nearest-start, errorless, {length:.0f} m, {times:.2f} times figure 5", made),
        NOTES,
    )
