"""Layout of a recording in the viewer: one run, several back ends side by side, a campaign's summary."""

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb
from jaxtyping import Float

from .layers.curves import CHAINS, CLOSED, ENDS, LINES, LOG_NEES, NEES, NIS, PATH, POSE_BAND, STEP_MS, TRACE
from .layers.map_layers import style
from .layers.model_layer import TIMES
from .layers.robot_layers import POSE_TIMES
from .layers.sights import UNITS_PER_M
from .layers.wheels import WHEELS
from .recording import SIM_TIME, STEP

WHITE = (255, 255, 255)
STEP_MS_NAME, STEP_MS_SPAN = "computing time of a step, ms (cut at 200)", (0.0, 200.0)
NIS_NAME, NIS_SPAN = "NIS of each scan over its dof, 1 is ideal (cut at 5)", (0.0, 5.0)
TRACE_NAME = "trace of the pose covariance, m² + rad²"


Bounds = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of a view along x and y, y down."""


def one_run(
    backend: str, seen_world: Float[np.ndarray, "n 2"], plane: Bounds, knows_truth: bool = True
) -> rrb.Horizontal:
    """Return the layout of one run: a large map, the state of the estimator beside it, the reasons below."""
    below = rrb.Horizontal(_decisions(backend), _legend(), column_shares=[1.2, 1])
    left = rrb.Vertical(map_view(backend, seen_world, knows_truth), below, row_shares=[2.1, 1])
    right = rrb.Vertical(
        rrb.Horizontal(model_view(backend, plane), graph_view(backend, seen_world)),
        nees_view(legend=True) if knows_truth else curve_view(NIS, NIS_NAME, NIS_SPAN),
        rrb.Horizontal(curve_view(TRACE, TRACE_NAME), curve_view(STEP_MS, STEP_MS_NAME, STEP_MS_SPAN)),
        rrb.Horizontal(
            curve_view(ENDS, "open ends"),
            curve_view(LINES, "walls"),
            curve_view((CHAINS, CLOSED), "chains"),
            curve_view(PATH, "path, m"),
            *([curve_view(NIS, NIS_NAME, NIS_SPAN)] if knows_truth else []),
        ),
        row_shares=[2.2, 1.4, 1, 1],
    )
    return rrb.Horizontal(left, right, column_shares=[1.25, 1], name="run")


def comparison(
    backends: Sequence[str], seen_world: Float[np.ndarray, "n 2"], plane: Bounds, knows_truth: bool = True
) -> rrb.Vertical:
    """Return the layout of several back ends side by side, with their curves in common plots."""
    columns = rrb.Horizontal(
        *(
            rrb.Vertical(
                map_view(backend, seen_world, knows_truth),
                rrb.Tabs(model_view(backend, plane), graph_view(backend, seen_world)),
                row_shares=[1.6, 1],
            )
            for backend in backends
        )
    )
    of_the_error = [
        curve_view(LOG_NEES, "log₁₀ of the pose's NEES, its 95 % band in grey", (-1.5, 6.5), legend=True),
        nees_view(legend=True),
    ]
    curves = rrb.Horizontal(
        rrb.Tabs(*of_the_error) if knows_truth else curve_view(NIS, NIS_NAME, NIS_SPAN, legend=True),
        curve_view(TRACE, TRACE_NAME),
        rrb.Tabs(
            curve_view(LINES, "walls"), curve_view(ENDS, "open ends"), curve_view((CHAINS, CLOSED), "chains"),
            curve_view(PATH, "path, m"), curve_view(STEP_MS, STEP_MS_NAME, STEP_MS_SPAN),
            curve_view(NIS, NIS_NAME, NIS_SPAN),
        ),
        _legend(),
        column_shares=[1.4, 1.2, 1, 0.8],
    )  # fmt: skip
    return rrb.Vertical(columns, curves, row_shares=[2.4, 1], name="side by side")


def map_view(backend: str, seen_world: Float[np.ndarray, "n 2"], knows_truth: bool = True) -> rrb.Spatial2DView:
    """Return the map of one back end, over the truth if it is known."""
    over = " over the truth" if knows_truth else ""
    start, end = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    so_far = rrb.VisibleTimeRanges([rrb.VisibleTimeRange(line, start=start, end=end) for line in (STEP, SIM_TIME)])
    return rrb.Spatial2DView(
        origin="/", contents=["/world/truth/**", f"{WHEELS}/**", f"/world/{backend}/**"],
        visual_bounds=_bounds(seen_world, 0.6),
        name=f"{backend}: map{over}  (robot's 3σ ×{POSE_TIMES:.0f})", background=WHITE,
        defaults=[style(2.6, 24.0)],
        overrides=dict.fromkeys(("/world/truth/path", WHEELS, f"/world/{backend}/path"), so_far),
    )  # fmt: skip


def model_view(backend: str, plane: Bounds) -> rrb.Spatial2DView:
    """Return the model space of one back end."""
    return rrb.Spatial2DView(
        origin="/", contents=["/model/axes/**", f"/model/{backend}/**"], background=WHITE,
        defaults=[style(1.2, 24.0)], name=f"{backend}: model space (α, r)  (3σ ellipses ×{TIMES:.0f})",
        visual_bounds=rrb.VisualBounds2D(x_range=plane[0], y_range=plane[1]),
    )  # fmt: skip


def graph_view(backend: str, seen_world: Float[np.ndarray, "n 2"]) -> rrb.GraphView:
    """Return the visibility graph of one back end."""
    bounds = _bounds(UNITS_PER_M * seen_world, UNITS_PER_M)
    return rrb.GraphView(
        origin=f"/graph/{backend}", name=f"{backend}: visibility graph",
        force_link=rrb.archetypes.ForceLink(enabled=False),
        force_many_body=rrb.archetypes.ForceManyBody(enabled=False),
        visual_bounds=bounds,
    )  # fmt: skip


def nees_view(legend: bool = False) -> rrb.TimeSeriesView:
    """Return the pose's NEES with its band; values beyond the scale are inconsistent in any case."""
    high = 2.5 * POSE_BAND[1]
    return curve_view(NEES, f"NEES of the pose, its 95 % band in grey (cut at {high:.0f})", (-1.0, high), legend)


def curve_view(
    plots: str | tuple[str, ...], name: str, span: tuple[float, float] | None = None, legend: bool = False
) -> rrb.TimeSeriesView:
    """Return one plot of some quantities, with a curve for each back end."""
    contents = [f"/plots/{plot}/**" for plot in ((plots,) if isinstance(plots, str) else plots)]
    return rrb.TimeSeriesView(
        origin="/plots", contents=contents, name=name,
        background=rrb.archetypes.PlotBackground(color=WHITE, show_grid=False),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=legend),
    )  # fmt: skip


def _bounds(seen: Float[np.ndarray, "n 2"], margin: float) -> rrb.VisualBounds2D | None:
    """Return the part of the plane that contains all points, y up; None without points."""
    if not len(seen):
        return None
    low, high = seen.min(axis=0) - margin, seen.max(axis=0) + margin
    return rrb.VisualBounds2D(x_range=(low[0], high[0]), y_range=(-high[1], -low[1]))


def _legend() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin="/legend", name="what is shown")


def _decisions(backend: str) -> rrb.TextLogView:
    # The lines start with their step, because the viewer's column for times is too narrow.
    hidden = [rrb.encodings.TimelineColumn(timeline, visible=False) for timeline in (STEP, SIM_TIME)]
    return rrb.TextLogView(
        origin=f"/decisions/{backend}", name="decisions and their reasons",
        columns=rrb.TextLogColumns(text_log_columns=["Body"], timeline_columns=hidden),
    )  # fmt: skip


def blueprint(*uses: rrb.Horizontal | rrb.Vertical) -> rrb.Blueprint:
    """Return the whole layout: a single view, or a tab for each, without side panels."""
    return rrb.Blueprint(
        uses[0] if len(uses) == 1 else rrb.Tabs(*uses), rrb.TimePanel(state="collapsed", timeline="step"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )  # fmt: skip
