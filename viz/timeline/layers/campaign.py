"""A campaign's summary: every trial as a dot, consistency and error against steps, one table; under `/campaign`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import UInt32

from ... import palette
from ..colours import packed
from ..recording import RerunRecording, Timestamps
from .curves import curve_style
from .map_layers import style

Row = Mapping[str, Any]
CELL = ("world", "strategy", "mode", "association")
"""What the back ends of one combination have in common."""
CURVES = {
    "pose_anees": "log₁₀ of the pose's ANEES over the trials (0 is ideal), and the 95 % band of its mean",
    "pose_error_rms_m": "pose error, rms over the trials, m",
}
POWERS = ("pose_anees", "band_low", "band_high")
"""Curves drawn as powers of ten, since an overconfident filter would flatten all others."""
DOTS = {"pose_anees": "pose ANEES", "map_anees": "map ANEES"}
WIDTH, HEIGHT = 1.6, 1.5
"""Spacing of the back ends among the dots, and height of a power of ten."""


class Summary:
    """Plain tables in, a recording's entities and their layout out.

    `trials` has a row a trial (the keys of summary.json, mode, association), `steps` a row for each step of each back
    end in each cell (step, pose_anees, band_low, band_high, pose_error_rms_m over its trials).
    """

    def __init__(self, out: RerunRecording, trials: Sequence[Row], steps: Sequence[Row]) -> None:
        self._out = out
        self._cells = list(dict.fromkeys(_cell(row) for row in trials))
        self._counts: list[int] = []
        out.fixed("/campaign", rr.Transform3D(scale=[WIDTH, -HEIGHT, 1.0]))
        for k, cell in enumerate(self._cells):
            here = [row for row in trials if _cell(row) == cell]
            self._counts.append(len({row["backend"] for row in here}))
            self._dots(f"/campaign/{k}/dots", here)
            self._curves(f"/campaign/{k}/curves", [row for row in steps if _cell(row) == cell])
        out.fixed("/campaign/table", rr.TextDocument(_table(self._cells, trials), media_type="text/markdown"))

    def layout(self) -> rrb.Vertical:
        """Return the summary's layout: a tab for each cell, the table below."""
        tabs = [
            rrb.Horizontal(
                *(_dots_view(f"/campaign/{k}/dots/{name}", words, self._counts[k]) for name, words in DOTS.items()),
                rrb.Vertical(*(_curve_view(f"/campaign/{k}/curves/{name}", words) for name, words in CURVES.items())),
                column_shares=[1, 1, 2],
                name=", ".join(cell),
            )
            for k, cell in enumerate(self._cells)
        ]
        table = rrb.TextDocumentView(origin="/campaign/table", name="all cells")
        return rrb.Vertical(rrb.Tabs(*tabs), table, row_shares=[3, 1], name="campaign")

    def _dots(self, entity: str, trials: Sequence[Row]) -> None:
        """Draw every trial above its back end, by the power of ten of its ANEES."""
        names = list(dict.fromkeys(row["backend"] for row in trials))
        for name in DOTS:
            known = [row for row in trials if _is_number(row.get(name)) and row[name] > 0.0]
            x = [names.index(row["backend"]) + 0.3 * _spread(row.get("seed", 0)) for row in known]
            y = [float(np.log10(row[name])) for row in known]
            colours = _tints([row["backend"] for row in known])
            words = [f"seed {row.get('seed')}: {row[name]:.3g}, {row['status']}" for row in known]
            dots = rr.Points2D(
                np.column_stack([x, y]), radii=rr.Radius.ui_points(4.0), colors=colours, labels=words, show_labels=False
            )
            self._out.fixed(f"{entity}/{name}/trials", dots)
            feet = np.array([[k, -1.35] for k in range(len(names))])
            self._out.fixed(
                f"{entity}/{name}/feet", rr.Points2D(feet, radii=rr.Radius.ui_points(6.0), colors=_tints(names))
            )
            self._out.fixed(
                f"{entity}/{name}/names", rr.Points2D(feet - [0.0, 0.1], colors=packed(palette.PAGE), labels=names)
            )
            levels = np.arange(-1.0, 4.0)
            lines = [[[-0.6, level], [len(names) - 0.4, level]] for level in levels]
            strong = np.where(levels == 0.0, packed(palette.INK), packed(palette.GRID_STRONG)).astype(np.uint32)
            self._out.fixed(f"{entity}/{name}/levels", rr.LineStrips2D(lines, colors=strong), style(0.7, 1.0))
            # A label hangs below its point.
            marks = [[-0.8, level + 0.13] for level in levels]
            white = rr.Points2D(marks, colors=packed(palette.PAGE), labels=[f"{10.0**level:g}" for level in levels])
            self._out.fixed(f"{entity}/{name}/marks", white)

    def _curves(self, entity: str, steps: Sequence[Row]) -> None:
        for backend in dict.fromkeys(row["backend"] for row in steps):
            rows = [row for row in steps if row["backend"] == backend]
            for name in CURVES:
                self._out.fixed(f"{entity}/{name}/{backend}", curve_style(backend))
                self._curve(f"{entity}/{name}/{backend}", rows, name)
        longest = max(
            ([row for row in steps if row["backend"] == name] for name in {row["backend"] for row in steps}),
            key=len,
            default=[],
        )
        for level in ("band_low", "band_high"):
            line = rr.SeriesLines(colors=packed(palette.BAND), names=f"95 % {level.replace('_', ', ')}", widths=1.5)
            self._out.fixed(f"{entity}/pose_anees/{level}", line)
            self._curve(f"{entity}/pose_anees/{level}", longest, level)

    def _curve(self, entity: str, rows: Sequence[Row], name: str) -> None:
        known = [row for row in rows if _is_number(row.get(name))]
        step = np.array([row["step"] for row in known], dtype=np.int64)
        # The trials of a campaign have no common time; the time axis is the step.
        values = np.array([row[name] for row in known], dtype=np.float64)
        if name in POWERS:
            values = np.log10(np.maximum(values, 1e-3))
        self._out.values(entity, Timestamps(step, step.astype(np.float64)), values)


def _tints(backends: Sequence[str]) -> UInt32[np.ndarray, " k"]:
    return np.array([packed(palette.of_backend(backend)) for backend in backends], dtype=np.uint32)


def _cell(row: Row) -> tuple[str, ...]:
    return tuple(str(row[key]) for key in CELL if row.get(key))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))


def _spread(seed: int) -> float:
    """Return a number from -1 to 1 that separates neighbouring seeds."""
    return float(2.0 * (seed * 0.61803398875 % 1.0) - 1.0)


def _table(cells: Sequence[tuple[str, ...]], trials: Sequence[Row]) -> str:
    columns = ("pose_anees", "pose_nees_in_band", "map_anees", "pose_rmse_m", "coverage", "path_length_m")
    lines = [
        "Means over the trials; in a cell all back ends met the same worlds, starts and noise. "
        "ANEES: the squared error in units of the stated uncertainty; 1 is ideal, above it an estimator is surer of "
        "itself than its errors allow, below it too cautious.\n",
        "| cell | back end | trials | complete | " + " | ".join(name.replace("_", " ") for name in columns) + " |",
        "|" + "---|" * (4 + len(columns)),
    ]
    for cell in cells:
        here = [row for row in trials if _cell(row) == cell]
        for backend in dict.fromkeys(row["backend"] for row in here):
            rows = [row for row in here if row["backend"] == backend]
            complete = sum(row["status"] == "complete" for row in rows)
            means = []
            for name in columns:
                values = [row[name] for row in rows if _is_number(row.get(name))]
                means.append(f"{np.mean(values):.3g}" if values else "-")
            lines.append(f"| {', '.join(cell)} | {backend} | {len(rows)} | {complete} | {' | '.join(means)} |")
    return "\n".join(lines)


def _dots_view(entity: str, words: str, count: int) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin="/", contents=[f"{entity}/**"], name=f"{words}, a dot a trial; 1 is ideal",
        background=(255, 255, 255),
        visual_bounds=rrb.VisualBounds2D(x_range=(-2.0, WIDTH * (count - 0.2)), y_range=(-3.6 * HEIGHT, 1.8 * HEIGHT)),
    )  # fmt: skip


def _curve_view(entity: str, words: str) -> rrb.TimeSeriesView:
    is_power = entity.rpartition("/")[2] in POWERS
    return rrb.TimeSeriesView(
        origin=entity, name=words, background=rrb.archetypes.PlotBackground(color=(255, 255, 255), show_grid=False),
        axis_y=rrb.ScalarAxis(range=(-1.5, 4.5)) if is_power else None,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop if is_power else rrb.Corner2D.LeftTop),
    )  # fmt: skip
