"""One self-contained page: words, tables and pictures in one HTML file, and the tables as LaTeX."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from jinja2 import Environment, PackageLoader, select_autoescape

from .drawing import PageDrawing

LONG_ROWS = 24
"""A table of more rows is folded up on a screen; on paper it is all there."""


@dataclass(frozen=True)
class PageTable:
    """A table of words; numbers are words by now."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    is_wordy: bool = False
    """Whether its cells are sentences, which break into lines, rather than numbers."""


@dataclass(frozen=True)
class PagePicture:
    """A picture with what it shows, in words."""

    png: bytes
    caption: str

    @property
    def source(self) -> str:
        """The picture itself as a data URI: nothing is fetched."""
        return "data:image/png;base64," + b64encode(self.png).decode()


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it, in this order: words, drawings, tables, what was printed, pictures."""

    title: str
    words: tuple[str, ...] = ()
    tables: tuple[PageTable, ...] = ()
    pictures: tuple[PagePicture, ...] = field(default=())
    drawings: tuple[PageDrawing, ...] = ()
    printed: str = ""
    """What a command said, shown as it stands."""


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    question: str
    """What was asked, for a reader who knows nothing yet."""
    verdict: tuple[str, ...]
    """The answer, first on the page; a paragraph each."""
    command: str
    """What made the results."""
    made_with: tuple[tuple[str, str], ...]
    """Names and versions."""
    sections: tuple[Section, ...]


def filled(*sections: Section) -> tuple[Section, ...]:
    """Return the sections that have a row, a drawing or a picture to show, without tables that have no row."""
    shown = [replace(section, tables=tuple(table for table in section.tables if table.rows)) for section in sections]
    return tuple(section for section in shown if section.tables or section.pictures or section.drawings)


def html(page: Page) -> bytes:
    """Return the page as one HTML file that fetches nothing."""
    environment = Environment(
        loader=PackageLoader("chainslam.viz.reports", "."), autoescape=select_autoescape(default=True), trim_blocks=True
    )
    return environment.get_template("report.html.j2").render(page=page, long_rows=LONG_ROWS).encode()


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
