"""The report of a run: one page with its map, its numbers and whether it knows how wrong it is."""

import json
import re

import pytest

from experiments.cli import main


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--max-steps", "40", "--out", str(folder)]) == 0
    return folder


def test_a_run_is_told_on_one_page_that_fetches_nothing(run):
    assert main(["report", str(run), "--latex"]) == 0
    page, summary = (run / "report.html").read_text(), json.loads((run / "summary.json").read_text())
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert page.count("<img") == 5
    assert f"{100 * summary['coverage']:.3g} % of the reachable contour mapped" in page
    assert "full-ekf: stopped after" in page
    assert "chainslam explore paper-fig4 --backend full-ekf --strategy nearest-robot --seed 1" in page
    assert "pose ANEES" in (run / "tables.tex").read_text()


def test_back_ends_stand_side_by_side(run, tmp_path):
    out = tmp_path / "replay"
    assert main(["replay", str(run / "log.npz"), "--backend", "block-ekf", "full-ekf", "--out", str(out)]) == 0
    assert main(["report", str(out)]) == 0
    page = (out / "report.html").read_text()
    assert "block-ekf: complete" in page
    assert "full-ekf: complete" in page
    assert page.count("<img") == 6
    assert 'data-name="block-ekf"' in page


def test_a_run_without_a_step_and_a_lost_file_are_told_in_words(run, tmp_path, capsys):
    summary = {"status": "failed", "reason": "no wall", "steps": 0, "open_ends": None}
    for name in ("config.json", "summary.json"):
        text = (run / name).read_text() if name == "config.json" else json.dumps(summary)
        (tmp_path / name).write_text(text)
    assert main(["report", str(tmp_path)]) == 0
    assert "failed before its first step: no wall" in (tmp_path / "report.html").read_text()
    (tmp_path / "summary.json").write_text("{")
    assert main(["report", str(tmp_path)]) == 2
    assert "summary.json" in capsys.readouterr().err
