"""The report: one file that holds everything, opened in a real browser by the long tests."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from chainslam.experiments.campaign.comparison.story import answer, story_of
from chainslam.experiments.campaign.comparison.words import command_of, interval, within
from chainslam.experiments.campaign.pages.page import marks_table, page_of
from chainslam.experiments.campaign.plan import Campaign
from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.numbers import number
from chainslam.viz.reports.report import LONG_ROWS, Page, PageTable, Section, filled, html
from tests.experiments.campaign.running import run

CAMPAIGN = Campaign(
    ("paper-fig4",), ("block-ekf", "full-ekf"), ("nearest-robot", "nearest-start"), 2,
    arms=("closed", "replay-true"), max_steps=6,
)  # fmt: skip
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
WITNESS = """<meta http-equiv="Content-Security-Policy" content="default-src data: 'unsafe-inline'"><script>
const wrong = [], fetched = [];
addEventListener("error", e => wrong.push(String(e.message || e.target.src)), true);
addEventListener("securitypolicyviolation", e => fetched.push(e.blockedURI));
addEventListener("load", () => { document.title = JSON.stringify({ wrong, fetched,
  pictures: document.images.length, shown: [...document.images].filter(i => i.complete && i.naturalWidth > 0).length,
  wide: document.documentElement.scrollWidth - innerWidth,
  cut: [...document.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth + 1).length }); });
</script>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("report") / "campaign"
    assert main(["report", str(run(made, CAMPAIGN)), "--latex"]) == 0
    return made


def test_the_page_answers_first_and_fetches_nothing(folder):
    page = (folder / "report.html").read_text()
    assert page.index("verdict") < page.index("<h2>")
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "url(" not in page
    assert page.count("<img") == page.count("data:image/png;base64,") >= 4
    assert "chainslam compare --worlds paper-fig4" in page


def test_every_number_carries_its_name_for_a_phone_and_claims_come_first(folder):
    page = (folder / "report.html").read_text()
    for name in (
        "pose ANEES from the start (95 % interval)",
        "pose ANEES",
        "steps outside the band %",
        "duplicates",
    ):
        assert f'data-name="{name}"' in page
    assert page.index("Claims") < page.index("Does it know how wrong it is?")


def test_a_long_table_is_folded_up():
    table = PageTable("t", ("a",), tuple((str(k),) for k in range(LONG_ROWS + 1)))
    page = Page("p", "why?", ("yes",), "c", (), (Section("s", tables=(table,)),))
    assert b"<details>" in html(page)
    short = replace(table, rows=table.rows[1:])
    assert b"<details>" not in html(replace(page, sections=(Section("s", tables=(short,)),)))


def test_what_has_nothing_to_show_is_left_out():
    empty, table = PageTable("t", ("a",), ()), PageTable("u", ("a",), (("1",),))
    sections = Section("s", ("An introduction.",), (empty,)), Section("v", tables=(empty, table))
    assert filled(*sections) == (Section("v", tables=(table,)),)


def test_a_campaign_of_one_strategy_that_only_replays_has_no_empty_tables(tmp_path):
    campaign = replace(CAMPAIGN, strategies=("nearest-robot",), trials=1, arms=("replay-own",))
    page = page_of(run(tmp_path / "replays", campaign))
    titles = [section.title for section in page.sections]
    assert {"Strategies", "At equal metres driven"}.isdisjoint(titles)
    assert {"What it shows", "Against the full EKF"} <= set(titles)
    assert page.sections[titles.index("Maps")].words[0].startswith("One seed, replay, own gate, by every back end.")
    assert all(table.rows for section in page.sections for table in section.tables)


def test_the_same_results_give_the_same_page_and_the_earlier_one_is_told_of(folder, capsys):
    before = (folder / "report.html").read_bytes()
    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out == f"report in {folder / 'report.html'}, in place of an earlier one\n"
    assert (folder / "report.html").read_bytes() == before


def test_the_tables_are_there_as_latex(folder):
    tables = (folder / "tables.tex").read_text()
    assert tables.count(r"\begin{tabular}") == tables.count(r"\end{tabular}") >= 5
    assert not re.findall(r"(?<!\\)[%_#]", tables)


def seen_in_a_browser(page, folder, width):
    """Return what the witness saw of a page, and whether the browser's console said something."""
    copy = folder / "report.html"
    copy.write_text(page.replace("<head>", "<head>" + WITNESS))
    flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}", "--dump-dom"]
    command = [BROWSER, *flags, f"--window-size={width},900", f"file://{copy}"]
    seen = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return json.loads(re.search(r"<title>(.*?)</title>", seen.stdout).group(1)), "CONSOLE" in seen.stderr


def faults(told):
    """Return the names of what is wrong with a page by what the witness saw."""
    found = {name for name in ("wrong", "fetched", "cut") if told[name]}
    return (
        found
        | ({"wide"} if told["wide"] > 0 else set())
        | ({"pictures"} if told["shown"] < told["pictures"] else set())
    )


@pytest.mark.long
@pytest.mark.parametrize("width", [390, 1000])
def test_a_browser_shows_all_pictures_and_finds_no_error(folder, tmp_path, width):
    told, spoke = seen_in_a_browser((folder / "report.html").read_text(), tmp_path, width)
    assert faults(told) == set()
    assert told["pictures"] >= 4
    assert not spoke


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "body"),
    [
        ("pictures", '<img src="data:image/png;base64,AAAA">'),
        ("wrong", "<script>throw Error('e')</script>"),
        ("fetched", '<link rel="stylesheet" href="other.css">'),
        ("fetched", '<img src="http://127.0.0.1:9/other.png">'),
        ("wide", '<div style="width: 2000px">w</div>'),
        ("cut", '<div class="scroll" style="overflow: auto"><p style="width: 2000px">w</p></div>'),
    ],
)
def test_the_browser_would_tell(tmp_path, fault, body):
    page = f"<!doctype html><html><head></head><body>{body}</body></html>"
    (tmp_path / "other.css").write_text("p { color: red }")
    sound = page.replace(body, "<p>w</p>")
    assert fault in faults(seen_in_a_browser(page, tmp_path, 1000)[0])
    assert faults(seen_in_a_browser(sound, tmp_path, 1000)[0]) == set()


def test_a_folder_without_a_campaign_gets_one_line_and_status_2(tmp_path, capsys):
    (tmp_path / "config.json").write_text("[]")
    for place in (tmp_path, tmp_path / "nowhere"):
        assert main(["report", str(place)]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("chainslam: expected")
        assert "\n" not in said


def test_the_verdict_says_answer_interval_and_failures():
    ratio = {"value": 2.0, "low": 1.5, "high": 2.5, "runs": 12}
    states = {"driving": 3, "finished": 8, "failed": 1}
    at = {
        "wall_rmse_m": ratio,
        "wall_shape_m": ratio,
        "pose_anees_so_far": ratio,
        "contender": states,
        "baseline": states,
    }
    said = {
        "decisive_mark": "33", "marks": {"33": at | {"uncovered": {"value": 0.02}}}, "matches_within": 1.1,
        "contender": "A", "baseline": "B", "verdict": "does not match",
    }  # fmt: skip
    words = answer(said)
    assert words[0].startswith("No: after 33 m driven, A does not match B")
    assert "2 times (1.5 to 2.5)" in words[0]
    assert "its shape alone" in words[0]
    assert "1 have failed" in words[2]
    assert "2.0 percentage points more" in words[2]


def test_numbers_are_short_and_never_in_powers_of_ten():
    assert [number(v) for v in (-5.2e-14, 0.0000123, -4.56e-7)] == ["0", "0.0000123", "-0.000000456"]
    assert [number(v) for v in (None, 3, 0.0, 0.012345, 123.4, 123456.0)] == ["–", "3", "0", "0.0123", "123", "123,000"]
    assert interval({"low": 0.5, "high": 2.0, "runs": 2}, 100.0) == "50 to 200"


def test_few_runs_have_no_interval():
    one = {"low": None, "high": None, "runs": 4}
    assert interval(one) == "–"
    assert within("0.5", one) == "0.5"
    assert within("0.5", one, more="3 distances") == "0.5 (3 distances)"
    assert (
        within("0.5", one | {"runs": 5, "low": 0.5, "high": 0.7}, more="3 distances") == "0.5 (0.5 to 0.7; 3 distances)"
    )


def pooled(backend, **changes):
    pose = {"mean": 1.2, "low": 1.0, "high": 1.4, "runs": 12}
    row = {"backend": backend, "arm": "closed", "complete": 12, "trials": 12, "pose_anees": None, "map_anees": pose}
    return row | {"pose_anees_from_start": pose, "wall_rmse_m": pose | {"mean": 0.012}} | changes


def against(first, second, measure, value):
    told = {"first": first, "second": second, "arm": "closed", "measure": measure, "value": value, "runs": 12}
    return told | {"low": 0.9 * value, "high": 1.1 * value}


def test_the_story_is_that_of_the_campaign():
    plain = Campaign(("rooms",), ("graph", "full-ekf"), ("nearest-robot",), 12, arms=("closed",))
    said = {"hypothesis": None, "pooled": [pooled("graph"), pooled("full-ekf")], "strategies": []}
    said["backends"] = [
        against("graph", "full-ekf", "wall_rmse_m", 0.8),
        against("graph", "full-ekf", "pose_anees_from_start", 2.0),
    ]
    story = story_of(plain, said)
    assert story.title == "Estimators compared: graph and full-ekf"
    assert "cross-correlations" not in story.title + story.question
    assert len(story.verdict) == 1
    assert "error of the walls 0.8 times (0.72 to 0.88)" in story.verdict[0]
    assert "pose ANEES from the start 2 times (1.8 to 2.2)" in story.verdict[0]

    strategies = replace(plain, backends=("graph",), strategies=("frontier", "nearest-robot"), trials=3)
    said |= {"pooled": [pooled("graph")], "backends": []}
    said["strategies"] = [against("frontier", "nearest-robot", "path_length_m", 1.5)]
    story = story_of(strategies, said)
    assert story.title == "Strategies compared: frontier and nearest-robot"
    assert "way driven 1.5 times (1.35 to 1.65)" in story.verdict[0]
    assert story.verdict[1].startswith("3 runs a cell: too few")

    one = replace(plain, backends=("graph",), trials=1)
    story = story_of(one, said | {"strategies": []})
    assert story.title == "graph by nearest-robot"
    assert story.question.startswith("A robot maps rooms, one run each.")
    assert "graph: 12 of 12 runs complete, pose ANEES from the start 1.2 (1 to 1.4)" in story.verdict[0]


def test_lengths_that_no_run_reached_are_left_out():
    row = dict.fromkeys(("pose_error_m", "wall_rmse_m", "pose_anees_so_far", "coverage"), 0.5) | {"without": {}}
    row |= {"world": "w", "strategy": "s", "arm": "closed", "finished": 1, "failed": 0}
    cells = (("a", "10", 0), ("b", "10", 1), ("a", "20", 0), ("b", "20", 0), ("a", "end", 0))
    rows = [row | {"backend": name, "metres": metres, "driving": driving} for name, metres, driving in cells]
    table = marks_table({"marks": rows})
    assert [(cells[2], cells[3]) for cells in table.rows] == [("a", "10"), ("b", "10"), ("a", "end")]


def test_the_command_on_the_page_runs_the_campaign_again():
    import tyro

    from chainslam.experiments.commands.compare import Compare

    words = command_of(CAMPAIGN).split()
    assert tyro.cli(Compare, args=words[2:]).campaign == CAMPAIGN
