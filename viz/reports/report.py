"""One self-contained page in one HTML file: fixed captions of a template, numbers put in; and its tables as LaTeX."""

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from .. import palette
from ..text import NONE
from .drawing import PageDrawing

LONG_ROWS = 24
"""A table of more rows is folded on a screen; on paper it is all there."""


@dataclass(frozen=True)
class PageTable:
    """A table of words; numbers are words by now."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def filled(self) -> "PageTable":
        """Return the table without the columns in which no row has a value."""
        kept = [k for k in range(len(self.header)) if any(row[k] != NONE for row in self.rows)]
        rows = tuple(tuple(row[k] for k in kept) for row in self.rows)
        return replace(self, header=tuple(self.header[k] for k in kept), rows=rows)


def table(title: str, columns: Mapping[str, Callable[[Any], str]], rows: Sequence[Any], note: str = "") -> PageTable:
    """Return a table with a row for each of `rows`; `columns` say, by its name, what a cell of each column holds."""
    cells = tuple(tuple(cell(row) for cell in columns.values()) for row in rows)
    return PageTable(title, tuple(columns), cells, note).filled()


@dataclass(frozen=True)
class PagePicture:
    """A picture (PNG or SVG) with what it shows, in words."""

    content: bytes
    caption: str

    @property
    def source(self) -> str:
        """The picture itself as a data URI: nothing is fetched."""
        kind = "png" if self.content.startswith(b"\x89PNG") else "svg+xml"
        return f"data:image/{kind};base64,{b64encode(self.content).decode()}"


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it, in this order: words, tables, what was printed, pictures."""

    title: str
    words: tuple[str, ...] = ()
    tables: tuple[PageTable, ...] = ()
    pictures: tuple[PagePicture, ...] = ()
    printed: str = ""
    """What a command said, shown as it stands."""


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    lines: tuple[str, ...]
    """What was found, a sentence each, the most important one first."""
    command: str
    """What made the results."""
    made_with: tuple[tuple[str, str], ...]
    """Names and versions."""
    template: str = "report"
    """Whose captions it has: those of a campaign, of a run, or none but the sections'."""
    told: Mapping[str, Any] = field(default_factory=dict)
    """What the captions need."""
    tables: Mapping[str, PageTable] = field(default_factory=dict)
    pictures: Mapping[str, tuple[PagePicture, ...]] = field(default_factory=dict)
    drawings: tuple[PageDrawing, ...] = ()
    player: Markup | None = None
    """Shown in place of the picture of the NEES."""
    sections: tuple[Section, ...] = ()
    """What stands below all that the template places."""

    @property
    def all_tables(self) -> tuple[PageTable, ...]:
        """Every table that has a row."""
        every = (*self.tables.values(), *(each for section in self.sections for each in section.tables))
        return tuple(each for each in every if each.rows)


def html(page: Page) -> bytes:
    """Return the page as one HTML file that fetches nothing."""
    environment = Environment(
        loader=PackageLoader("chainslam.viz.reports", "."), autoescape=select_autoescape(default=True),
        trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined,
    )  # fmt: skip
    shown = environment.get_template(f"{page.template}.html.j2")
    return shown.render(page=page, long_rows=LONG_ROWS, colours=palette.backends()).encode()


def latex(tables: Sequence[PageTable]) -> bytes:
    """Return tables as LaTeX (package booktabs), ready for `input`."""
    return "\n".join(_latex(table) for table in tables).encode()


def _latex(table: PageTable) -> str:
    columns = "l" + "r" * (len(table.header) - 1)
    lines = [" & ".join(map(_escaped, row)) + r" \\" for row in table.rows]
    return "\n".join(
        (
            r"\begin{table}",
            rf"\caption{{{_escaped(table.title)}}}",
            rf"\begin{{tabular}}{{{columns}}}",
            r"\toprule",
            " & ".join(map(_escaped, table.header)) + r" \\",
            r"\midrule",
            *lines,
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
            "",
        )
    )


def _escaped(words: str) -> str:
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    special |= {letter: "\\" + letter for letter in "&%$#_{}"}
    return "".join(special.get(letter, letter) for letter in words)
