"""README and docs: links lead somewhere, commands run and leave what the texts say."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from chainslam.experiments.artifacts.schema import settings_in
from chainslam.experiments.artifacts.settings import record_of
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.views.settings_schema import groups

ROOT = Path(__file__).parents[2]
DOCS = [page for page in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in page.parts]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file(page):
    links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_setting_that_a_text_names_is_one():
    def keys(group, before=""):
        for key, value in group.items():
            yield before + key
            yield from keys(value, f"{before}{key}.") if isinstance(value, dict) else ()

    known = set(keys(record_of(TrialConfig("paper-fig4"))))
    of_classes_known = {f"{group.kind.__name__}.{name}" for group in groups() for name in settings_in(group.kind)}
    for page in PAGES:
        text = page.read_text()
        named = re.findall(r"`(?:--set )?((?:mission|robot|backend_options)\.[a-z_.0-9]+)(?:=[^`]*)?`", text)
        assert [name for name in named if name not in known and not (ROOT / name).exists()] == [], page
        of_classes = re.findall(r"`([A-Z]\w+Config\.\w+)`", text)
        assert [name for name in of_classes if name not in of_classes_known] == [], page


@pytest.mark.long
def test_the_figures_of_the_readme_are_those_of_the_drive_in_its_picture(tmp_path):
    words = "explore paper-fig9 --seed 1 --out run", "replay run/log.npz --backend block-ekf full-ekf graph --out r"
    for line in words:
        program = [sys.executable, "-m", "chainslam.experiments.commands.cli", *line.split()]
        subprocess.run(program, cwd=tmp_path, capture_output=True, env=_environment(), check=True)
    scores = [
        json.loads((tmp_path / "r" / name / "summary.json").read_text())["pose_anees_from_start"]
        for name in ("block-ekf", "full-ekf", "graph")
    ]
    told = re.search(r"filter has (\S+), the full EKF (\S+) and the graph (\S+)\.\n", (ROOT / "README.md").read_text())
    assert [float(value) for value in told.groups()] == pytest.approx(scores, rel=0.005)
    film = json.loads((ROOT / "docs" / "films" / "paper-fig9.json").read_text())
    played = {run["backend"]: run["anees"] for run in film["runs"]}
    assert [played[name] for name in ("block-ekf", "full-ekf", "graph")] == pytest.approx(scores, rel=0.005)
    run = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert f"`make demo`: {run['steps']} steps, {run['path_length_m']:.1f} m." in (ROOT / "docs/index.md").read_text()


def test_every_page_is_shown_for_a_screen_and_for_a_phone():
    shown = sorted((ROOT / "docs" / "pictures" / "pages").iterdir())
    assert {path.stem.rpartition("-")[0] for path in shown} == {"run", "replay", "campaign", "site"}
    for path in shown:
        assert f"({Path('..') / 'pictures' / 'pages' / path.name})" in (ROOT / "docs/contributing/pages.md").read_text()
        assert path.stat().st_size < 250_000
        with Image.open(path) as picture:
            assert picture.width == int(path.stem.rpartition("-")[2])


def _environment():
    return {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1", "HOME": str(Path.home())}


def test_what_the_readme_names_is_there():
    for name in ("LICENSE", "CITATION.cff", "CONTRIBUTING.md"):
        assert (ROOT / name).is_file()
