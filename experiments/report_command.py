"""`chainslam report`: a campaign as one page that a person reads."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from viz.report import html, latex

from .campaign.page import page_of
from .files import write

REPORT, TABLES = "report.html", "tables.tex"


@dataclass(frozen=True)
class Report:
    """Write what a campaign found as one HTML file that holds everything, for a screen, a phone or paper."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """The folder that `compare --out` made."""
    latex: bool = False
    """Write the tables as LaTeX, too."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for a folder without a campaign."""
        page = page_of(self.folder)
        write(self.folder / REPORT, html(page))
        print(f"report in {self.folder / REPORT}")
        if self.latex:
            tables = [table for section in page.sections for table in section.tables]
            write(self.folder / TABLES, latex(tables))
            print(f"tables in {self.folder / TABLES}")
        return 0
