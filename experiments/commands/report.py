"""`chainslam report`: a campaign, two held against each other, or a run, as one page that a person reads."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.viz.reports.report import Page, html, latex

from ..artifacts.files import replacing, write
from ..campaign.contrast import CONTRAST
from ..campaign.pages.contrast_page import contrast_page
from ..campaign.pages.page import page_of
from ..terminal.answers import found
from ..usage import UsageError
from ..views.gif import gif_of
from ..views.run_page import is_run, run_page

REPORT, TABLES, GIF = "report.html", "tables.tex", "run.gif"


@dataclass(frozen=True)
class Report:
    """Write what a campaign or a run found as one HTML file that holds everything, for a screen, a phone or paper."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """The folder that `compare`, `explore` or `replay` left."""
    latex: bool = False
    """Write the tables as LaTeX, too."""
    gif: bool = False
    """Write a run as an animated GIF, too, run.gif; from its log, so that nothing is driven again."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for a folder without results."""
        replaced = replacing(self.folder / REPORT)
        page = self.write()
        found(report=str(self.folder / REPORT))
        print(f"report in {self.folder / REPORT}{replaced}")
        if self.latex:
            tables = [table for section in page.sections for table in section.tables]
            replaced = replacing(self.folder / TABLES)
            write(self.folder / TABLES, latex(tables))
            found(tables=str(self.folder / TABLES))
            print(f"tables in {self.folder / TABLES}{replaced}")
        if self.gif:
            replaced = replacing(self.folder / GIF)
            write(self.folder / GIF, gif_of(self.folder))
            found(animation=str(self.folder / GIF))
            print(f"animation in {self.folder / GIF}{replaced}")
        return 0

    def write(self) -> Page:
        """Write the page and return what stands on it; raises UsageError for a folder without results."""
        page = _page(self.folder)
        write(self.folder / REPORT, html(page))
        return page


def _page(folder: Path) -> Page:
    if not folder.is_dir():
        raise UsageError(f"expected a folder of results, found no folder {folder}: name what a command left")
    if (folder / CONTRAST).is_file():
        return contrast_page(folder)
    # A campaign keeps no summary.json; its recordings lie two folders further down.
    return run_page(folder) if is_run(folder) else page_of(folder)
