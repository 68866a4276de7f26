"""The documentation site: it builds without a warning, and asks nothing of the network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs" / "_ext"))


def test_the_help_of_a_command_loses_its_boxes_and_no_word():
    import command_help

    found = command_help.help_of(["measure"])
    assert "interval; without corners, list all." in " ".join(found.split())
    assert not re.search("[│╭╰\x1b]", found)


@pytest.mark.long
def test_the_site_builds_without_a_warning_and_needs_no_network(tmp_path):
    words = ["-m", "sphinx", "-q", "-E", "-W", "--keep-going", "-d", str(tmp_path / "doctrees")]
    done = subprocess.run(
        [sys.executable, *words, str(ROOT / "docs"), str(tmp_path / "site")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    fetched = (
        r"""(?:<(?:script|img|iframe)[^>]*\ssrc|<link[^>]*(?:stylesheet|icon|preload)[^>]*\shref)=["'](?:https?:)?//"""
    )
    assert [page.name for page in pages if re.search(fetched, page.read_text())] == []
    styles = [
        style for style in (tmp_path / "site").rglob("*.css") if re.search(r"url\(.?(https?:)?//", style.read_text())
    ]
    assert styles == []
    help_page = (tmp_path / "site" / "reference" / "command-line.html").read_text()
    assert "--strategy" in help_page
