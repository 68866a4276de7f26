"""Figure 4: one cycle with a dead end, its partial visibility graph, and a planned and driven route of walls."""

from dataclasses import replace
from functools import lru_cache
from itertools import groupby

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chainslam.explore.planning.visibility_graph import NEIGHBOUR, SIGHT
from chainslam.viz import palette
from chainslam.viz.figures.map_axes import scale_bar
from chainslam.viz.figures.panels import panels
from chainslam.viz.figures.visibility import GraphPicture, extent_of, paint_graph

from ..artifacts.maps.picture import map_picture
from ..artifacts.presets import preset_of
from ..artifacts.settings import trial_of
from ..scenario import TrialConfig
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.drives import PAPER, log_of
from .runs.route_drive import RouteDrive, drive_route

FROM, TO = "8", "16"
PLANNED = f"planned from wall {FROM} to wall {TO}"
LENGTH, WALLS = "walls of this route", "walls in the graph"
SAID: Said = {PLANNED: "8, 3, 12, 15, 16", LENGTH: 5, WALLS: 16}
PANEL_INCH = (6.1, 6.1)
BAR_BELOW = 0.05
"""The scale bar lies so far below a panel, as a share of its height."""
RADIUS_POINTS = 6.2


def numbers(seed: int) -> Numbers:
    """Return the results of one drive with noise."""
    return {PAPER: _numbers(_driven(seed, errorless=False))}


def reproduce(seed: int) -> Reproduction:
    """Explore the environment of figure 4 without noise, then plan from wall 8 to wall 16 on the graph and drive."""
    drive = _driven(seed, errorless=True)
    return Reproduction(
        "Figure 4: a partial visibility graph, and a route planned by it",
        SAID,
        {PAPER: _numbers(drive)},
        _figure(drive),
        (
            "Walls have the numbers of the paper's figure. The robot explores by --preset paper-method, errorless. Then"
            f" it is told to go to wall {FROM}, and from there to wall {TO}, wall after wall of the route. The graph is"
            " of what it saw on its way; the paper shows a part of its own.",
        ),
    )


@lru_cache(maxsize=8)
def _driven(seed: int, errorless: bool) -> RouteDrive:
    config: TrialConfig = trial_of(preset_of("paper-method") | {"world": "paper-fig4"})
    return drive_route(replace(config, seed=seed, errorless=errorless), (FROM, TO))


def _numbers(drive: RouteDrive) -> dict[str, Value]:
    summary, last, log = drive.made.summary, drive.made.last, log_of(drive.made)
    assert last is not None
    kinds = [edge["kind"] for *_, edge in last.graph.edges(data=True)]
    _, first, end = drive.steps
    return {
        WALLS: len(last.graph),
        "pairs of neighbours": kinds.count(NEIGHBOUR) // 2,
        "sights": kinds.count(SIGHT),
        PLANNED: _words(drive, drive.plan) or None,
        LENGTH: len(drive.plan) or None,
        f"wall {TO} was reached": drive.has_arrived,
        "walls nearest to the robot on this way": _words(drive, drive.followed) or None,
        "driven from wall to wall, m": float(log.path_length_m[end] - log.path_length_m[first]) if drive.plan else None,
        "contours closed": f"{summary['contours_closed']} of {summary['contours_reachable']}",
        "explored in, m": float(log.path_length_m[drive.steps[0]]),
    }


def _words(drive: RouteDrive, walls: tuple[int, ...]) -> str:
    """Return walls by their numbers in the paper, or by their own in brackets if they have none there."""
    return ", ".join(name for name, _ in groupby(drive.names.get(wall, f"({wall})") for wall in walls))


def _figure(drive: RouteDrive) -> Figure:
    last = drive.made.last
    assert last is not None
    shown = map_picture(drive.made)
    picture = GraphPicture(
        last.map, last.chains, last.graph, "", names=drive.names, route=drive.plan, true_floor=shown.true_floor
    )
    title = f"Figure 4: from wall {FROM} to wall {TO} along walls {_words(drive, drive.plan) or 'that nobody knows'}"
    figure, (place, graph) = panels(title, 1, 2, PANEL_INCH)
    low, high = extent_of(picture)
    inch_per_m = (PANEL_INCH[0] - 0.2) / float((high - low).max())
    handles = paint_graph(graph, picture, low, high, inch_per_m, RADIUS_POINTS)
    graph.legend(handles=handles, frameon=False, fontsize=8, loc="lower left")
    graph.set_title("(b) its partial visibility graph, and the route planned by it", fontsize=9, loc="left")
    _paint_place(place, drive, picture)
    place.set_xlim(low[0], high[0])
    place.set_ylim(low[1], high[1])
    metres = log_of(drive.made).path_length_m[drive.steps[0]]
    for axes in (place, graph):
        scale_bar(axes, float((high - low)[0]), BAR_BELOW)
    place.set_title(f"(a) the environment, explored in {metres:.1f} m", fontsize=9, loc="left")
    return figure


def _paint_place(axes: Axes, drive: RouteDrive, picture: GraphPicture) -> None:
    """Draw the environment with its walls, the path of the exploration, and the path from wall to wall."""
    for index, ring in enumerate(picture.true_floor):
        axes.fill(*ring.T, facecolor=palette.SOLID if index else palette.FLOOR, edgecolor=palette.SOLID, linewidth=5.0)
    axes.plot(*picture.map.ends_world.transpose(2, 1, 0), color=palette.INK, linewidth=1.8, solid_capstyle="round")
    path, (explored, first, end) = log_of(drive.made).estimated_world[:, :2], drive.steps
    axes.plot(*path[: explored + 1].T, color=palette.PATH_ESTIMATED, linewidth=1.2, label="exploration")
    axes.plot(
        *path[explored : first + 1].T, color=palette.PATH_ESTIMATED, linewidth=0.9, linestyle=(0, (2, 2)),
        label=f"to wall {FROM}",
    )  # fmt: skip
    axes.plot(*path[first : end + 1].T, color=palette.ALARM, linewidth=2.6, label=f"from wall {FROM} to wall {TO}")
    axes.plot(*path[end], "o", color=palette.ALARM, markersize=6)
    axes.plot(*path[0], "o", markersize=9, color=palette.PAGE, markeredgecolor=palette.INK, mew=1.2)
    axes.plot(*path[0], "+", markersize=8, color=palette.INK, mew=1.2, label="start")
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.legend(frameon=False, fontsize=8, loc="lower left")
