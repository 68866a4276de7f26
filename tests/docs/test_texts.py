"""README and docs: links lead somewhere, sentences are short, commands run and leave what the texts say."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
LONGEST = 25
"""Words in a sentence of the README."""


def prose(text):
    """Text without code, tables and addresses."""
    text = re.sub(r"^(    .*|\|.*\|)$", "", text, flags=re.MULTILINE)
    return re.sub(r"\]\([^)]*\)", "]", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file(page):
    links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_sentences_of_the_readme_are_short():
    sentences = re.split(r"[.;:!?](?:\s|$)|\n\s*\n", prose((ROOT / "README.md").read_text()))
    words = {len(re.findall(r"[\w'-]+", sentence)): sentence for sentence in sentences}
    assert len(sentences) > 20
    assert max(words) <= LONGEST, words[max(words)]


def commands(page):
    """The lines of a page's code blocks that call the program, with lines that go on joined."""
    blocks = re.findall(r"^    (.*)$", page.read_text().replace("\\\n        ", ""), flags=re.MULTILINE)
    lines = [re.split(r"\s{2,}#", line)[0] for line in blocks]
    return [shlex.split(line)[1:] for line in lines if line.startswith(".venv/bin/chainslam ")]


@pytest.mark.long
def test_the_commands_of_the_readme_run_one_after_the_other(tmp_path):
    found = commands(ROOT / "README.md")
    assert [words[0] for words in found] == ["explore", "replay", "report"]
    for words in found:
        program = [sys.executable, "-m", "experiments.commands.cli", *words]
        done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, env=_environment(), check=False)
        assert done.returncode == 0, done.stderr
    assert "<svg" in (tmp_path / "replays" / "report.html").read_text()


@pytest.mark.long
def test_the_figures_of_the_readme_are_those_of_the_drive_in_its_picture(tmp_path):
    words = "explore paper-fig9 --seed 1 --out run", "replay run/log.npz --backend block-ekf full-ekf graph --out r"
    for line in words:
        program = [sys.executable, "-m", "experiments.commands.cli", *line.split()]
        subprocess.run(program, cwd=tmp_path, capture_output=True, env=_environment(), check=True)
    scores = [
        json.loads((tmp_path / "r" / name / "summary.json").read_text())["pose_anees"]
        for name in ("block-ekf", "full-ekf", "graph")
    ]
    told = re.search(r"filter has (\S+), the full EKF (\S+) and the graph (\S+)\.\n", (ROOT / "README.md").read_text())
    assert [float(value) for value in told.groups()] == pytest.approx(scores, rel=0.005)


def _environment():
    return {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1", "HOME": str(Path.home())}


def test_what_the_readme_names_is_there():
    for name in ("LICENSE", "CITATION.cff", "CONTRIBUTING.md"):
        assert (ROOT / name).is_file()
