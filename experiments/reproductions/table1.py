"""Table 1: the distances between three corners of the world of figure 8."""

import numpy as np
from matplotlib.figure import Figure

from chainslam.viz.figures.panels import paint_intervals, panels

from ..scoring.maps.measurements import Z_95
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.drives import BESIDE, PAPER, drive_by_walls, driven, replayed

DRIVES = 5
BY_HAND = {"A-B": 6.50, "A-C": 8.35, "B-C": 7.60}
IN_ITS_MAP = {"A-B": 6.50, "A-C": 8.30, "B-C": 7.65}
SAID: Said = {f"{pair}, m": f"{IN_ITS_MAP[pair]:.2f} (by hand {BY_HAND[pair]:.2f})" for pair in BY_HAND} | {
    "worst error, mm": "50 (rounded to 50)"
}


def numbers(seed: int) -> Numbers:
    """Return each distance in the map of one drive, its error and its interval."""
    config = drive_by_walls("paper-fig8", seed=seed)
    ours: Numbers = {}
    for name in BESIDE:
        ours[name] = {}
        for pair, distance in replayed(config, name).summary["distances"].items():
            mapped, sigma = distance["mapped_m"], distance["sigma_m"]
            error = None if mapped is None else mapped - distance["true_m"]
            ours[name] |= {
                f"{pair}, m": mapped,
                f"{pair}, error, mm": None if error is None else 1e3 * error,
                f"{pair}, half of the 95 % interval, mm": None if sigma is None else 1e3 * Z_95 * sigma,
                f"{pair} in its interval": None if error is None or sigma is None else abs(error) <= Z_95 * sigma,
            }
    return ours


def reproduce(seed: int) -> Reproduction:
    """Measure the three distances in the maps of several drives, by each back end."""
    configs = [drive_by_walls("paper-fig8", seed=seed + k) for k in range(DRIVES)]
    found = {name: [replayed(config, name).summary["distances"] for config in configs] for name in BESIDE}
    true = {pair: distance["true_m"] for pair, distance in driven(configs[0]).summary["distances"].items()}
    pairs = tuple(true)
    values = {name: _table(runs, pairs, "mapped_m") for name, runs in found.items()}
    halves = {name: Z_95 * _table(runs, pairs, "sigma_m") for name, runs in found.items()}
    errors = {name: 1e3 * (table - np.array([[true[pair]] for pair in pairs])) for name, table in values.items()}
    ours: dict[str, dict[str, Value]] = {"true": {f"{pair}, m": true[pair] for pair in pairs}}
    for name in BESIDE:
        seen = np.isfinite(errors[name])
        held = np.abs(errors[name]) <= 1e3 * halves[name]
        ours[name] = {f"{pair}, m": _number(values[name][row, 0]) for row, pair in enumerate(pairs)}
        ours[name] |= {
            "worst error, mm": _number(np.abs(errors[name][seen]).max(initial=0.0)) if seen.any() else None,
            "intervals (95 %) that hold the truth": f"{held[seen].sum()} of {seen.sum()}",
            "not measured": int((~seen).sum()),
        }
    return Reproduction(
        "Table 1: distances between corners A, B and C of figure 8",
        SAID,
        ours,
        _figure(pairs, errors, {name: 1e3 * half for name, half in halves.items()}),
        (
            f"Distances of the first drive, seed {seed}; the rows below of {DRIVES} drives, seeds {seed} to"
            f" {seed + DRIVES - 1}: recorded by {PAPER}, replayed with each back end's own gate.",
        ),
    )


def _table(runs: list[dict[str, dict[str, float | None]]], pairs: tuple[str, ...], key: str) -> np.ndarray:
    """Return one row for each pair and one column for each drive, NaN for a missing corner."""
    return np.array([[run[pair][key] for run in runs] for pair in pairs], dtype=np.float64)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _figure(pairs: tuple[str, ...], errors: dict[str, np.ndarray], halves: dict[str, np.ndarray]) -> Figure:
    title = "Table 1: mapped less true distance, with 95 % intervals"
    figure, (beside, near) = panels(title, 1, 2, (4.6, 3.4))
    for axes in (beside, near):
        paint_intervals(axes, pairs, errors, halves)
        axes.set_ylabel("mm", fontsize=8)
    theirs = [1e3 * (IN_ITS_MAP[pair] - BY_HAND[pair]) for pair in pairs]
    beside.errorbar(
        range(len(pairs)), theirs, 50.0, fmt="kD", markersize=5, linewidth=1.0, capsize=3, label="the paper"
    )
    beside.legend(frameon=False, fontsize=7)
    beside.set_title("beside the paper's, both of whose values are rounded to 5 cm", fontsize=8, loc="left")
    legend = near.get_legend()
    if legend is not None:
        legend.remove()
    near.set_title(f"{DRIVES} drives, a dot each", fontsize=8, loc="left")
    return figure
