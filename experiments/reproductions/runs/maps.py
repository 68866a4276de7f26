"""Shared parts of figures 8 and 9: one building mapped by each back end from the same scans."""

import numpy as np
from matplotlib.axes import Axes

from chainslam.viz import palette
from chainslam.viz.text import literal

from ...scenario import TrialConfig
from ...trial import TrialResult
from ..reproduction import Value
from .drives import BESIDE, log_of, replayed, trace_over_start


def compared(config: TrialConfig) -> dict[str, TrialResult]:
    """Return the results of each back end for one drive."""
    return {name: replayed(config, name) for name in BESIDE}


def map_numbers(result: TrialResult) -> dict[str, Value]:
    """Return the quantities of any of these maps."""
    summary, log = result.summary, log_of(result)
    closed = np.flatnonzero(log.closed_chains > 0)
    errors = [
        abs(distance["mapped_m"] - distance["true_m"])
        for distance in summary["distances"].values()
        if distance["mapped_m"] is not None
    ]
    return {
        "path, m": summary["path_length_m"],
        "first chain closed after, m": float(log.path_length_m[closed[0]]) if len(closed) else None,
        "contours closed": f"{summary['contours_closed']} of {summary['contours_reachable']}",
        "error of named corners' distances, worst, cm": 100.0 * max(errors) if errors else None,
        "coverage, %": 100.0 * summary["coverage"],
        "duplicate walls": summary["duplicate_lines"],
        "pose error rms, cm": 100.0 * summary["pose_rmse_m"],
        "odometry alone, worst, m": summary["odometry_max_m"],
        "pose ANEES (1 is ideal)": summary["pose_anees"],
        "map ANEES (1 is ideal)": summary["map_anees"],
        "least trace of the pose covariance over the start's": float(trace_over_start(result).min()),
    }


def map_words(result: TrialResult) -> str:
    """Return the title of a map."""
    summary = result.summary
    closed = f"{summary['contours_closed']} of {summary['contours_reachable']} contours"
    return f"{closed}, pose ANEES {summary['pose_anees']:.3g}"


def mark(axes: Axes, result: TrialResult) -> None:
    """Label the corners that the paper names."""
    for name, at in result.scenario.world.labels.items():
        axes.plot(*at, "o", markersize=6, color="none", markeredgecolor=palette.ALARM, mew=1.2)
        axes.annotate(
            literal(name), at, xytext=(4, 4), textcoords="offset points", size=9, weight="bold", color=palette.ALARM
        )
