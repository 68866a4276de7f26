"""What a page says under a picture comes from the run that made the picture, and from no other."""

import json
import re
from pathlib import Path

import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import config_record
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.usage import UsageError
from chainslam.sim.logs.recorded_robot import FORMAT
from studies.results import captions
from studies.results.captions import CAPTIONS, KEPT, PICTURES, Caption, checksum, read_captions, shown, with_caption

ROOT = Path(__file__).parents[2]
PAGES = [page for pattern in captions.PAGES for page in sorted(ROOT.glob(pattern))]


def test_every_picture_has_the_caption_that_was_made_of_it():
    kept = read_captions(ROOT / PICTURES)
    files = {path.name: path for path in (ROOT / PICTURES).iterdir() if path.is_file() and path.name != KEPT}
    assert set(kept) == set(files)
    assert [name for name, path in files.items() if checksum(path) != kept[name]["sha256"]] == []


def test_every_page_says_under_a_picture_what_its_caption_says():
    kept, seen = read_captions(ROOT / PICTURES), set()
    for page in PAGES:
        for caption, name in shown(page.read_text()):
            assert caption == kept[name]["caption"], (page, name)
            seen.add(name)
    assert seen == set(kept), "a picture that no page shows"


def test_the_script_that_makes_a_picture_makes_its_caption_from_a_run():
    script = (ROOT / "docs" / "make-pictures").read_text()
    loops = {
        word for names, body in re.findall(r"for name in ([^;]+); do (.*?)done", script, flags=re.S)
        if "caption $name.png" in body for word in names.split()
    }  # fmt: skip
    made = {f"{name}.png" for name in loops} | set(re.findall(r"^ *caption ([\w.-]+)", script, flags=re.M))
    made |= {f"timeline-{name}.png" for name in re.findall(r"^ *shot ([\w-]+)", script, flags=re.M)}
    assert made == set(CAPTIONS)


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A folder of pictures and pages, and a run of which only the settings and the summary are there."""
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "run"
    home.mkdir()
    (tmp_path / PICTURES).mkdir(parents=True)
    (tmp_path / PICTURES / "fig9.png").write_bytes(b"a picture")
    page = "# A page\n\n![seed 99: 5 of 5 contours are closed](pictures/fig9.png)\n\n![other](pictures/nees.png)\n"
    (tmp_path / "docs" / "page.md").write_text(page)
    (home / "config.json").write_bytes(json_bytes(config_record(TrialConfig("paper-fig9", backend="graph", seed=3))))
    said = {"status": "complete", "reason": "", "steps": 17, "path_length_m": 4.25}
    said |= {"contours_closed": 1, "contours_reachable": 2}
    (home / "summary.json").write_text(json.dumps({"format": FORMAT} | said))
    return home


def test_a_caption_says_what_the_run_came_to_and_takes_the_place_of_what_a_page_said(run, tmp_path):
    Caption("fig9.png", (run,)).run()
    words = "paper-fig9, graph, nearest-robot, seed 3: the map after 17 steps, 4.2 m; 1 of 2 contours are closed"
    kept = read_captions()["fig9.png"]
    assert kept == {"caption": words, "sha256": checksum(tmp_path / PICTURES / "fig9.png")}
    assert shown((tmp_path / "docs" / "page.md").read_text()) == [(words, "fig9.png"), ("other", "nees.png")]


@pytest.mark.parametrize("wrong", [{"picture": "none.png"}, {"of": ()}, {"words": "typed, too"}])
def test_a_caption_without_a_picture_or_without_one_source_is_refused(run, wrong):
    with pytest.raises(UsageError, match="expected"):
        Caption(**({"picture": "fig9.png", "of": (run,)} | wrong)).run()


def test_a_caption_changes_nothing_else_on_a_page():
    text = "![a](pictures/x.png) ![a](../pictures/x.png) ![a](pictures/pages/x.png) [x.png](pictures/x.png)"
    now = "![b](pictures/x.png) ![b](../pictures/x.png) ![a](pictures/pages/x.png) [x.png](pictures/x.png)"
    assert with_caption(text, "x.png", "b") == now
