"""The report of a folder: of a run, a campaign, or a comparison of two campaigns."""

from dataclasses import replace
from pathlib import Path

from chainslam.viz.reports.player import player
from chainslam.viz.reports.report import Page, html

from ..artifacts.files import write
from ..usage import UsageError

REPORT = "report.html"


def report_at(folder: Path, play: bool = False) -> tuple[Page, Path]:
    """Write the report of a folder into it, and return its content and its path; raises UsageError.

    With `play`, that of a run has a player in place of the picture of the NEES.
    """
    page, place = _page(folder), folder / REPORT
    if play:
        from ..views.player import film_of
        from ..views.run_page import homes_of

        page = replace(page, player=player([film_of(homes_of(folder))]))
    write(place, html(page))
    return page, place


def _page(folder: Path) -> Page:
    from ..campaign.contrast import CONTRAST
    from ..campaign.pages.campaign_page import campaign_page
    from ..campaign.pages.contrast_page import contrast_page
    from ..views.run_page import is_run, run_page

    if not folder.is_dir():
        raise UsageError(f"expected a folder of results, found no folder {folder}: name that of a run or a campaign")
    if (folder / CONTRAST).is_file():
        return contrast_page(folder)
    # A campaign keeps no summary.json; its recordings lie two folders further down.
    return run_page(folder) if is_run(folder) else campaign_page(folder)
