"""The page of results: its tables are those of the stored rows, and rows of other code are called stale."""

import json

import pytest

from studies.results.figures import pose_score
from studies.results.headlines import HEADLINES, Headline
from studies.results.page import BEGIN, END, Results, newest, section, state
from studies.results.plans import apartments, schools, whole_schools
from studies.results.shortcut import rides
from studies.results.worlds import bundled
from studies.runner.rows import fingerprint


def row(code, world, **more):
    scores = {"coverage": 0.9, "contours_closed": 1, "contours_reachable": 2, "path_length_m": 10.0, "collisions": 0}
    return {"code": code, "world": world, "status": "complete", "errorless": True, **scores, **more}


def test_the_pages_are_those_that_the_stored_rows_make(request, tmp_path, capsys):
    docs = request.config.rootpath / "docs"
    texts = {name: (docs / name).read_text() for name in {headline.page for headline in HEADLINES}}
    for name, text in texts.items():
        (tmp_path / name).write_text(text[: text.index(BEGIN)] + BEGIN + END + text[text.index(END) + len(END) :])
    Results(tmp_path).run()
    assert {name: (tmp_path / name).read_text() for name in texts} == texts, "run `make results`"
    assert len(texts) == 3
    assert len(capsys.readouterr().out.splitlines()) == len(HEADLINES) <= 12


def test_rows_of_the_code_that_has_most_of_them_count_and_the_last_of_equals(tmp_path):
    path = tmp_path / "rows.jsonl"
    assert newest(path) == []
    rows = [row("a", "x"), row("a", "y"), row("b", "x"), row("b", "y"), row("c", "x")]
    path.write_text("".join(json.dumps(each) + "\n" for each in rows))
    assert [each["code"] for each in newest(path)] == ["b", "b"]
    rows = [row("a", "x"), row("a", "x"), row("b", "x"), row("b", "y")]
    path.write_text("".join(json.dumps(each) + "\n" for each in rows))
    assert [(each["code"], each["world"]) for each in newest(path, "world")] == [("a", "x"), ("a", "x"), ("b", "y")]
    assert state([row(fingerprint(), "x"), row("a", "y")]) == "stale"


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
    assert "made by `make halls`" in made


def run(backend, seed=1, **more):
    scores = {"pose_anees": 1.0, "map_anees": 1.0, "duplicate_lines": 1, "false_merges": 1, "planning_ms_mean": 0.5}
    scores |= {"false_matches": 5, "false_matches_few_beams": 3}
    own = {"backend": backend, "seed": seed, "coverage_own_frame": 0.9, "raised": False, "steps": 100}
    return row("a", "school", **scores) | own | more


def test_apartments_stand_by_back_end_and_the_verdict_says_which_way_the_covariance_is_off():
    rows = [run("graph", map_anees=value) for value in (0.5, 0.7, 4.0)] + [run("full-ekf", map_anees=1.3)]
    found = apartments(rows)
    cells = {line[0]: line[1:] for line in found.table}
    assert cells["measure"] == ["`graph`", "`full-ekf`"]
    assert cells["map ANEES: mean, median"] == ["1.73, 0.7", "1.3, 1.3"]
    assert cells["maps with an ANEES above 3"] == ["1", "0"]
    assert cells["false matches a plan: of five beams or more, of fewer"] == ["2.00, 3.00", "2.00, 3.00"]
    assert cells["duplicate walls a plan, false mergers in all"] == ["1.00, 3", "1.00, 1"]
    assert (
        "`graph`: 3 of 3 complete, map ANEES 1.73 in the mean, 0.7 at the median: covariances are typically too wide."
        in found.verdict
    )
    assert found.verdict.endswith("typically too narrow.")


def test_schools_count_the_runs_of_each_back_end_that_lost_their_map():
    rows = [run("full-ekf", pose_anees=value) for value in (1.0, 3.1, 9.0)] + [run("graph", 2, raised=True)]
    found = schools(rows)
    assert [line[:6] for line in found.table[1:]] == [
        ["`full-ekf`", "3", "0", "3.1", "1", "2"], ["`graph`", "1", "1", "1", "1", "0"]
    ]  # fmt: skip
    assert found.verdict == "Ended by an exception: 1 runs. Maps lost: `full-ekf` 2 of 3; `graph` 0 of 1."


def test_schools_to_their_end_have_means_over_the_runs():
    found = whole_schools([run("graph", coverage=0.8, status="stopped", steps=300), run("graph")])
    assert found.table[1] == ["`graph`", "1 of 2", "0.8500, 0.800", "0.9000", "1", "1, 1", "2.0", "200", "0", "-"]


def ridden(backend, place, seed, **more):
    scores = {"pose_anees_from_start": 1.0, "map_anees": 1.0, "nis": 1.0, "nis_in_band": 0.95, "held": 0.95}
    precise = {"pose_rms_m": 0.002, "pose_sigma_m": 0.001}
    return {"code": "a", "backend": backend, "place": place, "seed": str(seed)} | scores | precise | more


def test_rides_stand_place_by_place_with_intervals_over_drives_and_the_price_of_honesty(tmp_path):
    """Precision is paired by drive; a score that one drive lacks makes no back end consistent."""
    rows = [ridden("full-ekf", place, seed) for place in ("paper-fig8", "plan-a", "plan-b") for seed in range(5)]
    rows += [ridden("intersection-ekf", "paper-fig8", k, pose_rms_m=0.004, pose_sigma_m=0.005) for k in range(5)]
    rows += [ridden("block-ekf", "paper-fig8", k, pose_anees_from_start=2.0 + k, map_anees=9.0) for k in range(5)]
    rows.append(ridden("ukf", "plan-a", 0, map_anees=None))
    found = rides(rows).parts
    assert list(found) == ["Figure 8, 5 drives", "Apartments, with the lines that the extraction finds, 10 drives"]
    first, second = found.values()
    assert first.table[1] == ["`full-ekf`", "1 (1 to 1), 1", "1 (1 to 1), 1", "1.00, 95 %", "95.0 %", "2, 1"]
    low, high = map(float, first.table[3][1].split("(")[1].split(")")[0].split(" to "))
    assert 1.0 < low < 4.0 < high
    assert first.table[3][1].startswith("4 (")
    assert "both means up to 1.5: `full-ekf`, `intersection-ekf`." in first.verdict
    assert "`intersection-ekf` errs by 2 times as much and states 5 times as much" in first.verdict
    assert "`block-ekf` errs by 1 times as much and states 1 times as much" in first.verdict
    assert second.table[2][2] == "-"
    assert second.verdict == "Consistent, with both means up to 1.5: `full-ekf`."
    made = section(Headline("Rides", "All.", "make rivals", tmp_path, rides), rows)
    assert made.count("\n### ") == 2
    assert made.count("**Verdict.**") == 2
    assert f"{len(rows)} rows, made by `make rivals`." in made


def test_the_pose_is_scored_from_the_start_where_all_rows_can_tell():
    old, new = {"pose_anees": 1.0}, {"pose_anees": 0.4, "pose_anees_from_start": 1.1}
    failed = {"pose_anees": None, "pose_anees_from_start": None}
    assert pose_score([new, failed, new]) == ("pose ANEES from the start", "pose_anees_from_start")
    assert pose_score([new, old]) == pose_score([old]) == pose_score([]) == ("pose ANEES", "pose_anees")
    assert apartments([run("graph", pose_anees_from_start=3.25)]).table[5][:2] == [
        "pose ANEES from the start: mean, median",
        "3.25, 3.25",
    ]
