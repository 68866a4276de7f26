"""The paper's figures, one file each, and one line in the registry."""

from . import eq4, fig5, fig6, fig8, fig9, fig10, fig11, table1
from .reproduction import Entry, Reproduction

REPRODUCTIONS: dict[str, Entry] = {
    "table1": Entry(table1.reproduce, "distances between the corners of figure 8, by hand and in the map"),
    "fig5": Entry(fig5.reproduce, "how often each stretch is driven, nearest open end from the robot"),
    "fig6": Entry(fig6.reproduce, "how often each stretch is driven, nearest open end from the start"),
    "fig8": Entry(fig8.reproduce, "the map of the cyclic environment of 7 m x 7 m"),
    "fig9": Entry(fig9.reproduce, "the map around a big obstacle, the loop closed, the farthest corners"),
    "fig10": Entry(fig10.reproduce, "the pose's uncertainty below its initial value, walls entered twice"),
    "fig11": Entry(fig11.reproduce, "the uncertainty on coming back to the start"),
    "eq4": Entry(eq4.reproduce, "what the distance from the world's origin does to r"),
}

__all__ = ["REPRODUCTIONS", "Entry", "Reproduction"]
