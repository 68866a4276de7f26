"""Random SVG drawings of everything that decides what a viewer shows: order, clips, masks, copies, styles, paint.

A page of 10 x 8 units, a unit a metre. Dark strokes are as wide as the walls that they are read as, so that what a
renderer rasters can be held against what the reader takes for walls. No corner is so sharp that a stroke is cut off.
"""

from dataclasses import dataclass, field

import numpy as np

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 10 8" width="10"'
    ' height="8">'
)
NEVER_RENDERED = (
    *("defs", "symbol", "marker", "clipPath", "mask", "pattern", "linearGradient", "radialGradient", "filter"),
    *("title", "desc", "metadata", "unknown", "foreignObject"),
)
"""Elements whose content is not drawn where it stands."""
HIDDEN = (
    *('display="none"', 'style="display:none"', 'style="DISPLAY: none !important"', 'visibility="hidden"'),
    *('style="visibility:collapse"', 'opacity="0"', 'style="opacity:0%"', 'class="gone"', 'systemLanguage="xx"'),
    *('opacity="0.05"', 'clip-path="url(#nothing)"', 'requiredExtensions="urn:x"'),
)
"""Attributes of a group that hide it."""
DARK = ("black", "#000", "#123456", "rgb(10,20,30)", "rgb(0 0 0 / 90%)", "hsl(240,100%,20%)", "BLACK", "#00000FF0",
        "navy", "currentColor", "rgba(0,0,0,.8)", "url(#none) #111", "url(#dim)")  # fmt: skip
LIGHT = ("white", "#fff", "#FFFFFF", "rgb(250,250,250)", "ivory", "hsl(60,100%,95%)", "WHITE", "url(#bright)")
FAINT = ("none", "transparent", "rgba(0,0,0,0.05)", "#0000", "url(#none)", "hsla(0,0%,0%,5%)")
UNKNOWN = ("light-dark(#fff, #000)", "lab(100 0 0)", "oklch(1 0 0)", "color(display-p3 1 1 1)", "var(--white)",
           "var(--nowhere, white)", "hwb(0 100% 0%)", "device-cmyk(0 0 0 1)", "blak", "#12", "rgb(1,2)", "context-fill",
           "color-mix(in srgb, white, white)", "icc(1)", "'black'", "12", "")  # fmt: skip
"""Paint beside a fill="#fff": whether a viewer knows it or not, what it shows is light."""
STYLE = """<style>.gone{display:none} .hollow{fill:none;stroke:#000;stroke-width:.1} g.walls > rect{fill:none}
.ink{fill:black!important} g g .deep{fill:#111} rect[class~=ink]{stroke:none} @media print{rect{fill:black}}
:root{--white:#fff} .big{stroke-width:.1}</style>"""
DEFS = """<defs><clipPath id="nothing"/><clipPath id="left"><rect width="5" height="8"/></clipPath>
<clipPath id="ring"><path clip-rule="evenodd" d="M1 1H9V7H1Z M3 3H6V5H3Z"/></clipPath>
<clipPath id="share" clipPathUnits="objectBoundingBox"><rect width=".5" height="1"/></clipPath>
<mask id="right"><rect x="5" width="5" height="8" fill="white"/></mask>
<mask id="hole" maskUnits="userSpaceOnUse" x="0" y="0" width="10" height="8"><rect width="10" height="8" fill="#fff"/>
<circle cx="5" cy="4" r="1.5"/></mask>
<linearGradient id="dim"><stop stop-color="#000"/><stop offset="1" stop-color="#222"/></linearGradient>
<linearGradient id="bright"><stop stop-color="#fff"/><stop offset="1" stop-color="#eee"/></linearGradient>
<symbol id="sym" viewBox="0 0 2 2"><rect x=".5" y=".5" width="1" height="1"/></symbol>
<g id="block"><rect width="1" height="1.4"/></g></defs>"""
CLIPS = ('clip-path="url(#left)"', 'clip-path="url(#ring)"', 'style="clip-path:url(#left)"', 'mask="url(#right)"',
         'mask="url(#hole)"')  # fmt: skip
PLAIN = {
    "DISPLAY: none !important": "display:none",
    "hsla(0,0%,0%,5%)": "none",
    **{f'fill:{paint};stroke:none"': 'fill:#fff;stroke:none"' for paint in sorted(UNKNOWN, key=len, reverse=True)},
}
"""What CSS says and not every renderer knows, in plain words that mean the same."""


def plain(data: bytes) -> bytes:
    """Return a drawing in words that every renderer knows."""
    text = data.decode()
    for said, meant in PLAIN.items():
        text = text.replace(said, meant)
    return text.encode()


@dataclass
class _Pen:
    rng: np.random.Generator
    parts: list[str] = field(default_factory=list)

    def one(self, *of: str) -> str:
        return of[int(self.rng.integers(len(of)))]

    def at(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 2)


def drawn_svg(rng: np.random.Generator) -> bytes:
    """Return a drawing by chance."""
    pen = _Pen(rng)
    page = pen.one(
        "", "", '<rect width="10" height="8" fill="black"/><rect x="1" y="1" width="8" height="6" fill="white"/>'
    )
    frame = '<rect x="1" y="1" width="8" height="6" fill="none" stroke="black" stroke-width="0.1"/>'
    body = "".join(_piece(pen, 0) for _ in range(int(rng.integers(2, 9))))
    return f"{HEAD}{STYLE}{DEFS}{page}{frame}{body}</svg>".encode()


def _piece(pen: _Pen, depth: int) -> str:
    match int(pen.rng.integers(9 if depth < 3 else 4)):
        case 0 | 1 | 2 | 3:
            return _shape(pen)
        case 4:
            return f"<g {pen.one(*HIDDEN)}>{_pieces(pen, depth)}</g>"
        case 5:
            name = pen.one(*NEVER_RENDERED)
            return f"<{name}>{_pieces(pen, depth)}</{name}>"
        case 6:
            return f"<g {pen.one(*CLIPS)}>{_pieces(pen, depth)}</g>"
        case 7:
            moved = pen.one("translate(1 .5)", "rotate(20 5 4)", "scale(.8)", "matrix(1 .2 0 1 0 0)", "skewX(10)")
            return f'<g transform="{moved}" fill="{pen.one("black", "white", "none")}">{_pieces(pen, depth)}</g>'
        case _:
            return _copy(pen)


def _pieces(pen: _Pen, depth: int) -> str:
    return "".join(_piece(pen, depth + 1) for _ in range(int(pen.rng.integers(1, 4))))


def _copy(pen: _Pen) -> str:
    x, y, paint = pen.at(1, 7), pen.at(1, 5), pen.one(*DARK, *LIGHT)
    return pen.one(
        f'<use href="#block" x="{x}" y="{y}" fill="{paint}"/>',
        f'<use xlink:href="#sym" x="{x}" y="{y}" width="2" height="2" fill="{paint}"/>',
        f'<g clip-path="url(#share)"><circle cx="{x}" cy="{y}" r="1" fill="{paint}"/></g>',
        f'<svg x="{x}" y="{y}" width="2" height="1.5"><rect width="3" height="1" fill="{paint}"/></svg>',
        f'<switch><g systemLanguage="xx"><rect x="{x}" y="{y}" width="2" height="2"/></g><use href="#block" x="{x}"'
        f' y="{y}"/></switch>',
    )


def _shape(pen: _Pen) -> str:
    x, y, w, h = pen.at(1, 7), pen.at(1, 5), pen.at(0.5, 3), pen.at(0.5, 3)
    outline = pen.one(
        f'<rect x="{x}" y="{y}" width="{w}" height="{h}"',
        f'<circle cx="{x}" cy="{y}" r="{w / 2}"',
        f'<path d="M{x} {y}h{w}v{h}h{-w}z"',
        f'<polygon points="{x},{y} {x + w},{y} {x},{y + w}"',
    )
    fill, faint = pen.one(*DARK, *LIGHT), pen.one(*FAINT)
    wide = pen.at(0.2, 0.5)
    return outline + pen.one(
        f' fill="{fill}"/>',
        f' fill="{fill}"/>',
        f' style="fill:{fill}"/>',
        f' fill="{faint}" stroke="{pen.one("black", "#222", "navy")}" stroke-width="0.1"/>',
        f' fill="none" stroke="white" stroke-width="{wide}" stroke-linejoin="{pen.one("round", "bevel")}"/>',
        f' fill="white" stroke="black" stroke-width="0.1" opacity="{pen.one("1", "0.9", "100%")}"/>',
        f' fill="#fff" style="fill:{pen.one(*UNKNOWN)};stroke:none"/>',
        f' class="{pen.one("hollow", "ink", "deep", "gone", "ink hollow")}"/>',
        f' fill="black" fill-opacity="{pen.one("0.05", "0", "1", "90%")}"/>',
        ' STYLE="x" fill="none"/>',
    )
