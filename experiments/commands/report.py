"""`chainslam report`: the report of a run, a campaign, or a comparison of two campaigns."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.viz.reports.report import latex

from ..artifacts.files import replacing, write
from ..library.pages import REPORT, report_at
from ..terminal.answers import found
from ..views.gif import gif_of

TABLES, GIF = "tables.tex", "run.gif"


@dataclass(frozen=True)
class Report:
    """Write the report of a campaign or a run as one self-contained HTML file, for screen, phone and paper."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of `compare`, `explore` or `replay`."""
    latex: bool = False
    """Write the tables as LaTeX, too."""
    play: bool = False
    """Put a player of the run into the page in place of its NEES curve, from its log."""
    gif: bool = False
    """Write a run as an animated GIF, run.gif, too, from its log."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for a folder without results."""
        replaced = replacing(self.folder / REPORT)
        page, _ = report_at(self.folder, self.play)
        found(report=str(self.folder / REPORT))
        print(f"report in {self.folder / REPORT}{replaced}")
        if self.latex:
            replaced = replacing(self.folder / TABLES)
            write(self.folder / TABLES, latex(page.all_tables))
            found(tables=str(self.folder / TABLES))
            print(f"tables in {self.folder / TABLES}{replaced}")
        if self.gif:
            replaced = replacing(self.folder / GIF)
            write(self.folder / GIF, gif_of(self.folder))
            found(animation=str(self.folder / GIF))
            print(f"animation in {self.folder / GIF}{replaced}")
        return 0
