"""The page of results: its tables are those of the stored rows, and rows of other code are called stale."""

import json

import pytest

from studies.results.headlines import HEADLINES, Headline, bundled
from studies.results.page import BEGIN, END, Results, newest, section, state
from studies.runner.rows import fingerprint


def row(code, world, **more):
    scores = {"coverage": 0.9, "contours_closed": 1, "contours_reachable": 2, "path_length_m": 10.0, "collisions": 0}
    return {"code": code, "world": world, "status": "complete", "errorless": True, **scores, **more}


def test_the_page_is_the_one_that_the_stored_rows_make(request, tmp_path, capsys):
    page = request.config.rootpath / "docs" / "results.md"
    copy = tmp_path / "results.md"
    text = page.read_text()
    copy.write_text(text[: text.index(BEGIN)] + BEGIN + END + text[text.index(END) + len(END) :])
    Results(copy).run()
    assert copy.read_text() == text, "run `make results`"
    assert len(capsys.readouterr().out.splitlines()) == len(HEADLINES) <= 12


def test_rows_of_the_code_that_has_most_of_them_count_and_the_last_of_equals(tmp_path):
    path = tmp_path / "rows.jsonl"
    assert newest(path) == []
    rows = [row("a", "x"), row("a", "y"), row("b", "x"), row("b", "y"), row("c", "x")]
    path.write_text("".join(json.dumps(each) + "\n" for each in rows))
    assert [each["code"] for each in newest(path)] == ["b", "b"]


@pytest.mark.parametrize(("code", "told"), [("other", "stale"), (fingerprint(), "current")])
def test_rows_of_other_code_are_stale(code, told):
    assert state([row(code, "x")]) == told
    assert state([]) == "missing"


def test_a_section_has_aim_table_verdict_and_command(tmp_path):
    rows = [row("a", "hall"), row("a", "hall", coverage=0.8, status="stopped", collisions=2)]
    made = section(Headline("Halls", "All.", "make halls", tmp_path, bundled), rows)
    assert "## Halls\n\n**Aim.** All.\n" in made
    assert "| `hall` | 1 of 2 | 0.8000 | 2 of 4 | 10.0 m |" in made
    assert "**Verdict.** 1 of 2 complete, 2 of 4 contours closed, 2 collisions." in made
    assert "made at a commit not recorded: `make halls`" in made
