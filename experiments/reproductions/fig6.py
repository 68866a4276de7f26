"""Figure 6: the open end nearest to the start, which makes the robot swing about it like a pendulum."""

from ..scenario import TrialConfig
from .reproduction import Numbers, Reproduction, Said
from .runs.drives import driven
from .runs.traversals import NEAREST_ROBOT, NEAREST_START, NOTES, noisy, traversal_figure, traversal_numbers

RATIO = "path over that of figure 5"
SAID: Said = {RATIO: "about 3", "passes by the start": "regularly"}


def numbers(seed: int) -> Numbers:
    """Return the results of one drive with noise, and of figure 5's with the same seed."""
    return _numbers(noisy(NEAREST_START, seed), noisy(NEAREST_ROBOT, seed))


def _numbers(config: TrialConfig, other: TrialConfig) -> Numbers:
    times = driven(config).summary["path_length_m"] / driven(other).summary["path_length_m"]
    return {name: {RATIO: times, **values} for name, values in traversal_numbers(config).items()}


def reproduce(_seed: int) -> Reproduction:
    """Explore the world of figure 5 by `nearest-start`, without noise, and compare the path lengths."""
    made = driven(NEAREST_START)
    ours = _numbers(NEAREST_START, NEAREST_ROBOT)
    length, times = made.summary["path_length_m"], next(iter(ours.values()))[RATIO]
    return Reproduction(
        "Figure 6: next to start position",
        SAID,
        ours,
        traversal_figure(f"Figure 6: nearest-start, errorless, {length:.0f} m, {times:.2f} times figure 5", made),
        NOTES,
    )
