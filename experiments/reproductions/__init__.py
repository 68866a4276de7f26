"""The paper's figures: one file for each, and one line in the registry."""

from . import eq4, fig4, fig5, fig6, fig8, fig9, fig10, fig11, standing, table1
from .reproduction import Entry, Reproduction

_FIGURES = (
    (table1, "distances between the corners of figure 8, by hand and in the map"),
    (fig4, "a partial visibility graph, and a route of walls planned by it and driven"),
    (fig5, "how often each stretch is driven, nearest open end from the robot"),
    (fig6, "how often each stretch is driven, nearest open end from the start"),
    (fig8, "the map of the cyclic environment of 7 m x 7 m"),
    (fig9, "the map around a big obstacle, the loop closed, the farthest corners"),
    (fig10, "the pose's uncertainty below its initial value, duplicate walls"),
    (fig11, "the uncertainty on coming back to the start"),
    (eq4, "what the distance from the world's origin does to r"),
    (standing, "a robot that stands still and looks learns nothing of where it is (Julier and Uhlmann)"),
)
REPRODUCTIONS: dict[str, Entry] = {
    figure.__name__.rpartition(".")[2]: Entry(figure.reproduce, figure.numbers, figure.SAID, about)
    for figure, about in _FIGURES
}

__all__ = ["REPRODUCTIONS", "Entry", "Reproduction"]
