"""The map as a floor plan in SVG, one unit per metre, which `chainslam explore map.svg` reads as a world.

Dark shapes are walls: solid bands beside each chain, and solid blocks for closed islands, in the colour of the chain.
Light shapes are decoration: the grid, the path of the robot, the rings around open ends. Text is not a wall either.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import shapely
from jaxtyping import Float

from chainslam.explore.certificate import Certificate
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from . import palette

WALL_M = 0.1
MARGIN_M = 0.8
SCALE = 100
"""Scale of the printed plan, 1 to this."""
MITRE = 5.0
WAY, END, BAR = "#B9C3D6", "#FFB77A", "#B8B8B8"
"""Light enough to be read as decoration instead of a wall."""
WORDS = "#444444"
LETTERS_M = 0.22
"""Height of the letters on the plan; a shorter side has smaller ones, down to `SMALLEST_M`, else none."""
SMALLEST_M = 0.12
"""Smaller letters cannot be read in print: where the interval would need them, it is left to the tooltip."""
ACROSS = 1.5
"""Letters of height one that fit along a side of length one."""
BARS_M = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)
BAR_SHARE = 0.25
"""Largest share of the width that the scale bar takes."""


@dataclass(frozen=True)
class Dimension:
    """The length of a side of a closed chain, or the area of a room."""

    at_world: Float[np.ndarray, "2"]
    """Middle of the side or of the room's largest free disc."""
    along_world: Float[np.ndarray, "2"]
    """The side as a vector, m, with the free side on its left; for an area, a horizontal one as long as there is
    room."""
    words: str
    hint: str
    """Tooltip in a browser."""
    is_area: bool = False

    @property
    def shown(self) -> str:
        """The words for which there is room; nothing without room for any."""
        if self._fitting_m(len(self.words)) >= SMALLEST_M:
            return self.words
        value = self.words.partition(" ±")[0] + (" m²" if self.is_area else "")
        return value if self._fitting_m(len(value) + 2) >= SMALLEST_M else ""

    @property
    def letters_m(self) -> float:
        """Height of its letters."""
        return float(np.clip(self._fitting_m(len(self.words)), SMALLEST_M, LETTERS_M))

    def _fitting_m(self, letters: int) -> float:
        return ACROSS * float(np.hypot(*self.along_world)) / max(letters, 1)

    @property
    def beside_world(self) -> Float[np.ndarray, "2"]:
        """Middle of its text; the text of a length is on the free side of the wall."""
        if self.is_area:  # which may be as good as none
            return self.at_world
        along = self.along_world / float(np.hypot(*self.along_world))
        return self.at_world + 0.9 * self.letters_m * np.array([-along[1], along[0]])

    @property
    def clockwise_deg(self) -> float:
        """Rotation of its text: along the side, and upright."""
        turn = float(np.rad2deg(np.arctan2(-self.along_world[1], self.along_world[0])))
        return turn - 180.0 if turn > 90.0 else turn + 180.0 if turn <= -90.0 else turn


def floor_plan(
    walls: StochasticMap,
    chains: tuple[Chain, ...],
    certificate: Certificate,
    path_world: Float[np.ndarray, "s 3"],
    title: str,
    dimensions: Sequence[Dimension] = (),
) -> bytes:
    """Return the SVG file; its y axis points down, so its world is the map's moved to the view's lower left corner."""
    bands = [_band(chain, index, walls, certificate) for index, chain in enumerate(chains)]
    driven = np.isfinite(path_world[:, 0])
    corners = [path_world[driven, :2], *(np.reshape(shapely.bounds(band), (2, 2)) for band in bands)]
    x0, y0 = np.floor(np.min(np.concatenate(corners), axis=0) - MARGIN_M)
    x1, y1 = np.ceil(np.max(np.concatenate(corners), axis=0) + MARGIN_M)
    width, height = float(x1 - x0), float(y1 - y0)
    page = Element(
        "svg", xmlns="http://www.w3.org/2000/svg", viewBox=f"0 0 {width:g} {height:g}",
        width=f"{1000 / SCALE * width:g}mm", height=f"{1000 / SCALE * height:g}mm",
    )  # fmt: skip
    page.set("data-metres-per-unit", "1")
    SubElement(page, "title").text = title
    SubElement(
        page, "desc"
    ).text = f"1:{SCALE}, drawn in metres; the lower left corner is ({x0:g}, {y0:g}) of the map, whose y points up"
    plan = _Plan(page, np.array([x0, y1]))
    _grid(plan, width, height)
    for leg in np.split(path_world[driven, :2], np.flatnonzero(~driven) - np.arange(np.count_nonzero(~driven))):
        plan.line(leg, stroke=WAY, stroke_width="0.03")
    closed = 0
    for chain, band in zip(chains, bands, strict=True):
        colour = palette.CLOSED[closed % len(palette.CLOSED)] if chain.is_closed else palette.OPEN
        closed += chain.is_closed
        plan.area(band, fill=colour)
    for end in certificate.open_ends:
        ring = plan.circle(end.position_world, 0.2, fill="none", stroke=END, stroke_width="0.05")
        SubElement(ring, "title").text = f"open end of wall {end.wall}: {end.why}"
    for dimension in dimensions:
        plan.dimension(dimension)
    start = plan.circle(path_world[0, :2], 0.12, id="start", fill="none", stroke=BAR, stroke_width="0.03")
    start.set("data-heading-deg", f"{np.rad2deg(path_world[0, 2]):.3f}")
    plan.scale_bar(next((metres for metres in BARS_M if metres <= BAR_SHARE * width), 1.0), width, height)
    plan.footer(
        [f"{title}; grid 1 m", *(["lengths in m, areas in m², with 95 % intervals"] if dimensions else [])], height
    )
    indent(page)
    return tostring(page, encoding="utf-8", xml_declaration=True) + b"\n"


def _band(chain: Chain, index: int, walls: StochasticMap, certificate: Certificate) -> shapely.Geometry:
    """Return the solid side of a chain: a band beside it, or the whole of a closed island."""
    area = next((contour for contour in certificate.contours if contour.chain == index), None)
    if area is not None and area.is_island:
        return area.polygon
    if area is not None:
        return area.polygon.buffer(WALL_M, join_style="mitre", mitre_limit=MITRE).difference(area.polygon)
    ends = walls.ends_world[walls.belief.rows(chain.walls)]
    way = shapely.LineString(np.concatenate([ends[:1, 0], chain.corners_world, ends[-1:, 1]]))
    # On the right of the direction of travel: the free side is on its left.
    return shapely.make_valid(way.buffer(-WALL_M, single_sided=True, join_style="mitre", mitre_limit=MITRE))


def _grid(plan: "_Plan", width: float, height: float) -> None:
    for x in np.arange(0.0, width + 0.5):
        plan.straight((x, 0.0), (x, height))
    for y in np.arange(0.0, height + 0.5):
        plan.straight((0.0, y), (width, y))


class _Plan:
    """Draws in the map's metres onto a page whose y axis points down."""

    def __init__(self, page: Element, corner_world: Float[np.ndarray, "2"]) -> None:
        self._page, self._corner = page, corner_world

    def _on_page(self, points_world: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        return (points_world - self._corner) * [1.0, -1.0]

    def _path(self, points_world: Float[np.ndarray, "n 2"]) -> str:
        return "M" + " L".join(f"{x:.4f},{y:.4f}" for x, y in self._on_page(points_world))

    def _add(self, tag: str, **attributes: str) -> Element:
        return SubElement(self._page, tag, {key.replace("_", "-"): value for key, value in attributes.items()})

    def straight(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Draw a grid line, given on the page."""
        (x1, y1), (x2, y2) = start, end
        self._add(
            "line", x1=f"{x1:g}", y1=f"{y1:g}", x2=f"{x2:g}", y2=f"{y2:g}", stroke=palette.GRID, stroke_width="0.015"
        )

    def line(self, points_world: Float[np.ndarray, "n 2"], **attributes: str) -> None:
        """Draw a line through points."""
        self._add("path", d=self._path(points_world), fill="none", **attributes)

    def area(self, shape: shapely.Geometry, **attributes: str) -> None:
        """Fill polygons, with their holes left free."""
        parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon)]
        rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
        path = " ".join(f"{self._path(shapely.get_coordinates(ring)[:-1])} Z" for ring in rings)
        self._add("path", d=path, fill_rule="evenodd", **attributes)

    def dimension(self, told: Dimension) -> None:
        """Write a length beside its wall, on the free side and upright, or an area in the middle of its room."""
        if not told.shown:
            return
        x, y = self._on_page(told.beside_world[None])[0]
        placed = f"translate({x:.3f} {y:.3f}) rotate({told.clockwise_deg:.2f})"
        text = self._add(
            "text", transform=placed, fill=WORDS, text_anchor="middle",
            dominant_baseline="central", font_size=f"{told.letters_m:.3f}", font_family="sans-serif",
            font_weight="bold" if told.is_area else "normal",
        )  # fmt: skip
        text.text = told.shown
        SubElement(text, "title").text = told.hint

    def scale_bar(self, length_m: float, width_m: float, height_m: float) -> None:
        """Draw a bar of four parts above the footer, at the right edge of the page, its length beside it."""
        left, top, part = width_m - 0.2 - length_m, height_m - 0.72, length_m / 4.0
        for k in range(4):
            x, fill = left + k * part, BAR if k % 2 == 0 else palette.PAGE
            box = f"M{x:g},{top:g} h{part:g} v0.07 h{-part:g} Z"
            self._add("path", d=box, fill=fill, stroke=BAR, stroke_width="0.01")
        label = self._add(
            "text", x=f"{left - 0.1:g}", y=f"{top + 0.035:g}", fill="#6A6A6A", font_size="0.2", text_anchor="end",
            dominant_baseline="central", font_family="sans-serif",
        )  # fmt: skip
        label.text = f"{length_m:g} m"

    def footer(self, lines: Sequence[str], height_m: float) -> None:
        """Write lines of text at the lower edge of the page, the first at the top."""
        for k, words in enumerate(lines):
            y = height_m - 0.15 - 0.3 * (len(lines) - 1 - k)
            text = self._add("text", x="0.2", y=f"{y:g}", fill="#6A6A6A", font_size="0.26", font_family="sans-serif")
            text.text = words

    def circle(self, centre_world: Float[np.ndarray, "2"], radius_m: float, **attributes: str) -> Element:
        """Draw a circle and return it."""
        x, y = self._on_page(centre_world[None])[0]
        return self._add("circle", cx=f"{x:.4f}", cy=f"{y:.4f}", r=f"{radius_m:g}", **attributes)
