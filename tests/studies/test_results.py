"""The generated tables: those on the pages are of the stored rows, and rows of other code are called stale."""

import json
import re

import pytest
from rich.table import Table as ConsoleTable

from studies.results import benchmarks
from studies.results.figures import of_console, pose_score
from studies.results.page import PAGES, Results, part, state
from studies.results.plans import apartments, courts, navigation, schools, whole_schools
from studies.results.rivals import rides
from studies.results.sources import SOURCES, Source
from studies.results.worlds import bundled
from studies.robots.faults import CASES, SOUND
from studies.runner.marks import PART, filled, short
from studies.runner.rows import fingerprint, last, newest


def row(code, world, **more):
    scores = {"coverage": 0.9, "contours_closed": 1, "contours_reachable": 2, "path_length_m": 10.0, "collisions": 0}
    return {"code": code, "world": world, "status": "complete", "errorless": True, **scores, **more}


def test_the_pages_are_those_that_the_stored_rows_make(request, tmp_path, capsys):
    docs = request.config.rootpath / "docs"
    texts = {name: (docs / name).read_text() for name in PAGES}
    copy = tmp_path / "docs"
    (copy / "contributing").mkdir(parents=True)
    for name, text in texts.items():
        (copy / name).write_text(PART.sub(r"\1\3", text))
    Results(copy).run()
    assert {name: (copy / name).read_text() for name in texts} == texts, "run `make results`"
    assert len(capsys.readouterr().out.splitlines()) == len(SOURCES)
    shown = [name for text in texts.values() for _, name, _ in PART.findall(text)]
    assert sorted(shown) == sorted(SOURCES)


def test_the_page_of_benchmarks_is_short(request):
    """Words that a reader sees: prose and cells, neither marks nor rules of tables."""
    text = (request.config.rootpath / "docs" / "benchmarks.md").read_text()
    assert len(re.findall(r"[^\s|]*\w[^\s|]*", re.sub(r"<!--.*?-->|\]\([^)]*\)", "", text))) <= 1500


def test_only_what_lies_between_the_marks_is_written_anew():
    page = "before\n<!-- table: a -->\nold\n<!-- end -->\nmiddle\n<!-- table: b-c -->\n<!-- end -->\nafter\n"
    once = filled(page, str.upper)
    assert once.split() == page.replace("old", "A").replace("b-c -->", "b-c --> B-C").split()
    assert filled(once, str.upper) == once
    assert filled("no marks", str.upper) == "no marks"


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


def test_of_each_key_the_last_row_counts(tmp_path):
    path = tmp_path / "rows.jsonl"
    rows = [row("a", "x", steps=1), row("a", "y", steps=2), row("b", "x", steps=3)]
    path.write_text("".join(json.dumps(each) + "\n" for each in rows))
    assert [each["steps"] for each in last(path, ("world",))] == [3, 2]


@pytest.mark.parametrize(("code", "told"), [("other", "stale"), (fingerprint(), "current")])
def test_rows_of_other_code_are_stale(code, told):
    assert state([row(code, "x")]) == told
    assert state([]) == "missing"


def test_a_part_has_its_table_and_the_command_of_its_rows():
    rows = [row("a", "hall"), row("a", "hall", coverage=0.8, status="stopped", collisions=2)]
    source = Source("make halls", bundled, lambda: rows)
    made = part(source, rows)
    assert "| `hall` | 1 of 2 | 0.8000 | 2 of 4 | 10.0 m | 2 |\n| all | 1 of 2 |" in made
    assert made.endswith("\n\n2 rows, made by `make halls`.")
    assert part(source, []) == "`make halls` makes the rows of this table; none are stored."


def test_numbers_have_three_digits_and_no_exponent():
    assert [short(value) for value in (0.8401, 45.67, 999.4, 2345.6, 3_213_615.0)] == [
        "0.84", "45.7", "999", "2,350", "3,210,000"
    ]  # fmt: skip


def test_a_table_of_the_console_becomes_one_of_a_page():
    table = ConsoleTable("world", "steps")
    table.add_row("hall", "7")
    assert of_console(table) == [["world", "steps"], ["hall", "7"]]


def run(backend, seed=1, **more):
    scores = {"pose_anees": 1.0, "map_anees": 1.0, "duplicate_lines": 1, "false_merges": 1, "planning_ms_mean": 0.5}
    scores |= {"false_matches": 5, "false_matches_few_beams": 3}
    own = {"backend": backend, "seed": seed, "coverage_own_frame": 0.9, "raised": False, "steps": 100}
    return row("a", "school", **scores) | own | more


def test_apartments_stand_by_back_end():
    rows = [run("graph", map_anees=value) for value in (0.5, 0.7, 4.0)] + [run("full-ekf", map_anees=1.3)]
    cells = {line[0]: line[1:] for line in apartments(rows)}
    assert cells["measure"] == ["`graph`", "`full-ekf`"]
    assert cells["map ANEES: mean, median"] == ["1.73, 0.7", "1.3, 1.3"]
    assert cells["maps with an ANEES above 3"] == ["1", "0"]
    assert cells["false matches a plan: of five beams or more, of fewer"] == ["2.00, 3.00", "2.00, 3.00"]
    assert cells["duplicate walls a plan, false mergers in all"] == ["1.00, 3", "1.00, 1"]


def test_schools_count_the_runs_of_each_back_end_that_lost_their_map():
    rows = [run("full-ekf", pose_anees=value) for value in (1.0, 3.1, 9.0)] + [run("graph", 2, raised=True)]
    assert [line[:6] for line in schools(rows)[1:]] == [
        ["`full-ekf`", "3", "0", "3.1", "1", "2"], ["`graph`", "1", "1", "1", "1", "0"]
    ]  # fmt: skip


def test_schools_to_their_end_have_means_over_the_runs():
    found = whole_schools([run("graph", coverage=0.8, status="stopped", steps=300), run("graph")])
    assert found[1] == ["`graph`", "1 of 2", "0.8500, 0.800", "0.9000", "1", "1, 1", "2.0", "200", "0", "-"]


def test_courts_say_how_many_are_complete_and_how_much_of_their_floor_was_seen():
    rows = [run("graph", swept=0.9), run("graph", 2, swept=0.8, status="stopped")]
    assert courts(rows)[1] == ["`school`", "2", "1 of 2", "0.800, 0.850", "0.900", "0"]


def test_navigations_are_compared_by_the_geometric_mean_over_the_plans_that_both_drove():
    driven = {"floor": {"a": 10.0, "b": 10.0, "c": 99.0}, "visibility": {"a": 20.0, "b": 5.0}}
    rows = [
        run("graph", navigation=way, file=file, path_length_m=metres)
        for way, plans in driven.items()
        for file, metres in plans.items()
    ]
    assert [line[:4] for line in navigation(rows)[1:]] == [
        ["`floor`", "2 of 2", "20 m", "1.00"], ["`visibility`", "2 of 2", "25 m", "1.00"]
    ]  # fmt: skip


def ridden(backend, place, seed, **more):
    scores = {"pose_anees_from_start": 1.0, "map_anees": 1.0, "nis": 1.0, "nis_in_band": 0.95, "held": 0.95}
    precise = {"pose_rms_m": 0.002, "pose_sigma_m": 0.001}
    return {"code": "a", "backend": backend, "place": place, "seed": str(seed)} | scores | precise | more


def rows_of_rides():
    rows = [ridden("full-ekf", place, seed) for place in ("paper-fig8", "plan-a", "plan-b") for seed in range(5)]
    rows += [ridden("intersection-ekf", "paper-fig8", k, pose_rms_m=0.004, pose_sigma_m=0.005) for k in range(5)]
    rows += [ridden("block-ekf", "paper-fig8", k, pose_anees_from_start=2.0 + k, map_anees=9.0) for k in range(5)]
    return rows


def test_rides_stand_place_by_place_with_intervals_over_drives_and_precision_paired_by_drive():
    found = rides([*rows_of_rides(), ridden("ukf", "plan-a", 0, map_anees=None)])
    assert list(found) == ["### Figure 8, 5 drives", "### Apartments, 10 drives"]
    first, second = found.values()
    assert first[1] == ["`full-ekf`", "1 (1 to 1), 1", "1 (1 to 1), 1", "1.00, 95 %", "95.0 %", "2, 1", "1.00, 1.00"]
    assert [line[-1] for line in first[2:]] == ["2.00, 5.00", "1.00, 1.00"]
    low, high = map(float, first[3][1].split("(")[1].split(")")[0].split(" to "))
    assert 1.0 < low < 4.0 < high
    assert first[3][1].startswith("4 (")
    assert second[2][1:3] == ["1, 1", "-"], "an interval of one drive, or a score that is none"


def test_estimators_stand_side_by_side_over_all_places():
    rows = [*rows_of_rides(), *(ridden(name, "plan-a", 0) for name in ("intersection-ekf", "block-ekf"))]
    head, *lines = benchmarks.estimators(rows)
    assert head[1:3] == ["figure 8, 5 drives", "apartments, 10 drives"]
    assert [line[:3] for line in lines] == [
        ["`full-ekf`", "1, 1", "1, 1"], ["`intersection-ekf`", "1, 1", "1, 1"], ["`block-ekf`", "4, 9", "1, 1"]
    ]  # fmt: skip
    assert lines[1][3] == f"{2 ** (5 / 6):.2f}, {5 ** (5 / 6):.2f}"


def test_places_between_others_and_variants_like_others_are_in_all_results_only():
    rows = [
        ridden(name, place, 0)
        for name in ("full-ekf", "oc-ekf")
        for place in ("plan-a", "ring of 60 m", "ring of 90 m")
    ]
    found = benchmarks.estimators(rows)
    assert found[0][1:3] == ["apartments, 1 drives", "ring of 90 m, 1 drives"]
    assert [line[0] for line in found[1:]] == ["`full-ekf`"]


def test_buildings_stand_by_kind_and_back_end():
    plan = {"file": "lifull_a", "max_steps": 9, "step_ms_mean": 2.0, "step_ms_p95": 4.0}
    school = plan | {"file": "cml_b", "max_steps": 1500, "status": "stopped"}
    times = {"drive_time_s": 30.0, "processor_s": 3.0}
    rows = [
        run("graph", **plan, **times),
        run("graph", pose_anees=4.0, **plan, **times),
        run("graph", **school, **times),
    ]
    apartment, stopped = benchmarks.exploration(rows)[1:]
    assert apartment[:8] == ["2 apartments", "`graph`", "2 of 2", "0.900, 0.900", "2 of 4", "0", "2.5", "1"]
    assert stopped[:3] == ["1 schools, first 1,500 steps", "`graph`", "0 of 1"]
    assert benchmarks.speed(rows)[1:] == [
        ["apartments", "`graph`", "2.0", "4.0", "10"],
        ["schools, first 1,500 steps", "`graph`", "2.0", "4.0", "10"],
    ]


def test_the_papers_figures_are_quoted_beside_what_the_paper_says():
    drives = [{"block-ekf": {"path, m": metres}, "full-ekf": {"path, m": 20.0}} for metres in (18.0, 22.0)]
    table = benchmarks.figures([{"figure": "fig8", "numbers": drive} for drive in drives])
    assert table[1] == ["figure 8: path, m", "33.0", "20 (18 to 22)", "20"]


def test_logs_have_the_error_and_the_normalised_error_of_each_step():
    scored = {"reference": {"ate_aligned_m": 0.5}, "reference_normalised": {"all": {"median": 1234.0}}}
    own = {"log": "aces", "backend": "graph", "odometry": "scans", "every": 1}
    table = benchmarks.logs([own | scored, own | {"every": 2}])
    assert table[1:] == [["`graph`", "-", "-", "0.500; 1,230", "-"]]


def test_a_fault_has_its_worst_scores_and_the_last_step_of_runs_that_failed():
    ended = {"case": SOUND, "coverage": 0.5, "pose_anees": 1.0, "map_anees": 2345.6, "steps": 9, "status": "failed"}
    rows = [
        ended | {"seed": 1},
        ended | {"seed": 2, "coverage": 0.75, "steps": 12},
        ended | {"seed": 3, "status": "complete"},
    ]
    sound = ended | {"map_anees": 1.0, "status": "complete"}
    others = [sound | {"case": case, "pose_anees": k + 0.5, "seed": 1} for k, case in enumerate(CASES) if k in (1, 2)]
    assert benchmarks.endings([*rows, *others])[2:] == [["2 others", "complete", "0.50", "2.5", "1"]]
    others[1] |= {"map_anees": 3.1}
    assert [line[0] for line in benchmarks.endings([*rows, *others])[2:]] == [others[1]["case"], "1 others"]
    others[0] |= {"status": "stopped"}
    assert {line[0] for line in benchmarks.endings([*rows, *others])[2:]} == {each["case"] for each in others}
    found = benchmarks.endings([sound | {"seed": 1}, others[0] | {"status": "complete"}])
    assert [line[0] for line in found[1:]] == [SOUND, "1 others"]
    assert benchmarks.endings(rows)[1] == [SOUND, "complete, failed by step 12", "0.50", "1", "2,350"]


def test_the_pose_is_scored_from_the_start_where_all_rows_can_tell():
    old, new = {"pose_anees": 1.0}, {"pose_anees": 0.4, "pose_anees_from_start": 1.1}
    failed = {"pose_anees": None, "pose_anees_from_start": None}
    assert pose_score([new, failed, new]) == ("pose ANEES from the start", "pose_anees_from_start")
    assert pose_score([new, old]) == pose_score([old]) == pose_score([]) == ("pose ANEES", "pose_anees")
    assert apartments([run("graph", pose_anees_from_start=3.25)])[5][:2] == [
        "pose ANEES from the start: mean, median",
        "3.25, 3.25",
    ]
