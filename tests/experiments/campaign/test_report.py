"""The report: one file that holds everything, opened in a real browser by the long tests."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from chainslam.experiments.campaign.comparison.consistency import consistency
from chainslam.experiments.campaign.pages.campaign_page import campaign_page
from chainslam.experiments.campaign.pages.lines import lines_of
from chainslam.experiments.campaign.pages.tables import compared, crossed, marks_table
from chainslam.experiments.campaign.plan import Campaign, command_of
from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.numbers import estimated, interval, number
from chainslam.viz.reports.report import LONG_ROWS, Page, PageTable, Section, html
from tests.experiments.campaign.running import run

CAMPAIGN = Campaign(
    ("paper-fig4",), ("block-ekf", "full-ekf"), ("nearest-robot", "nearest-start"), 2,
    arms=("closed", "replay-true"), max_steps=20,
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


def test_the_page_answers_first_then_shows_curve_maps_and_table_and_fetches_nothing(folder):
    page = (folder / "report.html").read_text()
    first = [page.index(part) for part in ('class="answer"', "<img", "paper-fig4, closed loop", "block-ekf: stopped",
                                           'data-name="verdict"', "<details>")]  # fmt: skip
    assert first == sorted(first)
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "url(" not in page
    assert page.count("<img") == page.count("data:image/svg+xml;base64,") == 5
    assert "chainslam compare --worlds paper-fig4" in page


def test_runs_that_end_at_a_limit_have_their_scores(folder):
    table = campaign_page(folder).tables["estimators"]
    for row in table.rows:
        cells = dict(zip(table.header, row, strict=True))
        assert cells["scored runs"] == "4 of 4"
        assert cells["verdict"] == "too few runs to tell"
        assert "(" not in cells["pose ANEES"], "two runs make no interval"
        assert all(float(cells[name]) > 0 for name in ("pose ANEES", "map ANEES", "wall error, cm", "path error, cm"))


def test_every_number_carries_its_name_for_a_phone(folder):
    page = (folder / "report.html").read_text()
    for name in ("pose ANEES", "map ANEES", "false matches per run", "wall error, ratio", "NIS"):
        assert f'data-name="{name}"' in page
    # Too few runs for a test: a column of dashes would say nothing.
    assert 'data-name="p, corrected"' not in page


def test_a_long_table_is_folded():
    table = PageTable("t", ("a",), tuple((str(k),) for k in range(LONG_ROWS + 1)))
    page = Page("p", ("yes",), "c", (), sections=(Section("s", tables=(table,)),))
    assert b"<details>" in html(page)
    short = replace(table, rows=table.rows[1:])
    assert b"<details>" not in html(replace(page, sections=(Section("s", tables=(short,)),)))


def test_a_campaign_of_one_strategy_that_only_replays_has_no_empty_parts(tmp_path):
    campaign = replace(CAMPAIGN, strategies=("nearest-robot",), trials=1, arms=("replay-own",))
    page = campaign_page(run(tmp_path / "replays", campaign))
    titles = {name for name, table in page.tables.items() if table.rows}
    assert {"estimators", "costs", "stated replay-own"} <= titles
    assert {"strategies", "explored", "interaction", "marks", "cells", "hypothesis"}.isdisjoint(titles)
    shown = html(page).decode()
    for empty in ("Which strategy", "At equal path lengths", "Interaction", "The same recordings"):
        assert empty not in shown
    assert "<tbody>\n</tbody>" not in shown
    assert page.told["arm"] == "replay, own matches"


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
    assert told["pictures"] == 5
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


def test_numbers_have_three_digits_and_are_never_in_powers_of_ten():
    assert [number(v) for v in (-5.2e-14, 0.0000123, -4.56e-7)] == ["0", "0.0000123", "-0.000000456"]
    assert [number(v) for v in (None, 3, 0.0, 0.012345, 123.4, 123456.0)] == ["–", "3", "0", "0.0123", "123", "123,000"]
    assert [number(v) for v in (1.0, 0.95, 99.96, 1234)] == ["1.00", "0.950", "100", "1,234"]
    assert interval({"low": 0.5, "high": 2.0, "runs": 2}, 100.0) == "50.0 to 200"


def test_few_runs_have_no_interval():
    one = {"low": None, "high": None, "runs": 4}
    assert interval(one) == ""
    assert estimated(one | {"mean": 0.5}) == estimated(one | {"value": 0.5}) == "0.500"
    assert estimated(one | {"mean": 0.5, "low": 0.5, "high": 0.7}) == "0.500 (0.500 to 0.700)"
    assert estimated(None) == estimated(one | {"value": None}) == "–"


def pooled(backend, mean=1.0, runs=12, **changes):
    score = {"mean": mean, "low": 0.9 * mean, "high": 1.1 * mean, "runs": runs}
    row = {"backend": backend, "arm": "closed", "complete": 12, "trials": 12, "pose_anees_from_start": score}
    row |= {"map_anees": score, **changes}
    return row | consistency(row)


def against(first, second, measure, value, **more):
    told = {"first": first, "second": second, "arm": "closed", "measure": measure, "value": value, "runs": 12}
    return told | {"kind": "ratio", "low": 0.9 * value, "high": 1.1 * value, "p_holm": 0.2} | more


def test_the_lines_answer_which_is_consistent_what_it_costs_and_which_strategy_is_cheaper():
    campaign = Campaign(("w",), ("graph", "block-ekf", "full-ekf"), ("frontier", "nearest-robot"), 12, arms=("closed",))
    costs = [against("block-ekf", "full-ekf", name, value) for name, value in
             (("wall_rmse_m", 1.8), ("ate_m", 1.5), ("false_matches", 0.25))]  # fmt: skip
    costs += [against("graph", "full-ekf", name, 9.0) for name in ("wall_rmse_m", "ate_m", "false_matches")]
    drives = [against("frontier", "nearest-robot", "path_length_m", value, backend=name)
              for name, value in (("graph", 3.0), ("full-ekf", 1.2))]  # fmt: skip
    rows = [pooled("graph"), pooled("block-ekf", 16.0), pooled("full-ekf", 1.3, 9)]
    said = {"pooled": rows, "backends": costs, "strategies": drives}
    first, second, third = lines_of(campaign, said)
    order = [first.index(part) for part in ("graph is consistent", "block-ekf", "factor of 16.0", "full-ekf")]
    assert order == sorted(order)
    assert "9 of the 10 needed" in first
    assert [part in second for part in ("block-ekf", "graph", "1.80 (1.62 to 1.98)", "1.50 (", "+0.250 (")] == [
        True, False, True, True, True,
    ]  # fmt: skip
    assert "full-ekf" in third
    assert "1.20 (1.08 to 1.32)" in third
    # Without an overconfident estimator the one with the largest wall error is told.
    assert "graph" in lines_of(campaign, said | {"pooled": [pooled("graph"), pooled("block-ekf")]})[1]
    assert len(lines_of(campaign, said | {"backends": [], "strategies": []})) == 1


def test_what_is_more_than_chance_is_starred():
    row = against("graph", "full-ekf", "wall_rmse_m", 0.5)
    assert compared(row) == "0.500 (0.450 to 0.550)"
    assert compared(row | {"p_holm": 0.049}) == "0.500* (0.450 to 0.550)"
    assert compared(None) == "–"


def test_comparisons_are_laid_out_with_a_column_for_each_measure():
    rows = [against("graph", "full-ekf", name, value) for name, value in (("wall_rmse_m", 0.5), ("ate_m", 2.0))]
    rows.append(against("block-ekf", "full-ekf", "ate_m", 1.0) | {"value": None})
    table = crossed("t", rows, {"estimator": "first"}, ("ate_m", "wall_rmse_m", "false_matches"))
    (row,) = table.rows
    assert row == ("graph", "2.00 (1.80 to 2.20)", "0.500 (0.450 to 0.550)", "12"), "no column of dashes alone"
    assert table.header[1] == "path error, ratio"


def test_lengths_that_no_run_reached_are_left_out():
    row = dict.fromkeys(("pose_error_m", "wall_rmse_m", "pose_anees_so_far", "coverage"), 0.5) | {"without": {}}
    row |= {"world": "w", "strategy": "s", "arm": "closed", "finished": 1, "failed": 0}
    cells = (("a", "10", 0), ("b", "10", 1), ("a", "20", 0), ("b", "20", 0), ("a", "end", 0))
    rows = [row | {"backend": name, "metres": metres, "driving": driving} for name, metres, driving in cells]
    table = marks_table({"marks": rows})
    assert [(cells[2], cells[3]) for cells in table.rows] == [("a", "10"), ("b", "10"), ("a", "end")]


def test_the_command_on_the_page_runs_the_campaign_again():
    import tyro

    from chainslam.experiments.commands.campaigns.compare import Compare

    words = command_of(CAMPAIGN).split()
    assert tyro.cli(Compare, args=words[2:]).campaign == CAMPAIGN
