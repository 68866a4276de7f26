"""Commands of README, tutorials and how-to pages run one after the other; a tutorial's figures are those it prints."""

import re
import shlex

import pytest

from tests.docs.stand_ins import lay_out
from tests.docs.test_commands import PROGRAM, PYTHON, ROOT, commands, name, python

TUTORIAL = sorted((ROOT / "docs" / "tutorial").glob("*.md"))
HOW_TO = sorted((ROOT / "docs" / "howto").glob("*.md"))
NOT_HERE = {
    "view": "needs a screen, or serves until Ctrl-C",
    "--dask": "needs a cluster",
    "kiss": "needs KISS-ICP in an environment of its own",
}
STEPS = "40"
"""How far the trials of a how-to page's campaign drive here."""


def files(text):
    """The files that a page gives whole, by the names in their captions."""
    return dict(re.findall(r":caption: (\S+)\n\n(.*?)^```", text, flags=re.M | re.S))


def run_in_turn(lines, folder):
    """Run commands in a folder, and return all that they print, on one line each, without the frames of tables."""
    printed = []
    for words in lines:
        done = python(*words, cwd=folder)
        assert done.returncode == 0, f"{words}: {done.stderr}"
        printed += (done.stdout + done.stderr).splitlines()
    return [plain(line) for line in printed]


def plain(line):
    return " ".join(re.sub("[│┃┡━╇┩└┴┘┏┳┓]", " ", line).split())


def of_program(page):
    found = [shlex.split(line)[1:] for line in commands(page) if line.startswith(PROGRAM)]
    return [["-m", "chainslam.experiments.commands.cli", *words] for words in found]


def differ(text, printed):
    """The lines of a page's shown output, and the numbers of its prose, that no command has printed."""
    shown = [
        plain(line) for block in re.findall(r"^```text\n(.*?)^```", text, re.M | re.S) for line in block.splitlines()
    ]
    prose = re.sub(r"^```.*?^```|^    .*?$|!\[.*?\]\(.*?\)|`[^`]*`|\]\(.*?\)", " ", text, flags=re.M | re.S)
    numbers = re.findall(r"(?<![\w.,-])\d[\d,]*(?:\.\d+)?(?![\w-])", prose)
    told = "\n".join([*printed, *files(text).values()])
    lost = [line for line in shown if line not in printed]
    return lost + [number for number in numbers if not re.search(rf"(?<![\d.]){re.escape(number)}(?!\.?\d)", told)]


def test_a_figure_that_no_command_printed_is_found():
    text = "It takes 352 steps, 33.4 m.\n\n```text\nsteps   352\npath    33.3 m\nwalls   38\n```\n\n    chainslam 7\n"
    assert differ(text, ["steps 352", "path 33.3 m"]) == ["walls 38", "33.4"]


@pytest.mark.long
@pytest.mark.parametrize("page", [ROOT / "README.md", *TUTORIAL], ids=name)
def test_commands_run_and_print_what_a_tutorial_shows(page, tmp_path):
    text = page.read_text()
    for caption, content in files(text).items():
        (tmp_path / caption).write_text(content)
    lines = of_program(page)
    assert len(lines) >= 2
    printed = run_in_turn(lines, tmp_path)
    if page in TUTORIAL:
        assert differ(text, printed) == []
    for report in (words[3] for words in lines if words[2] == "report"):
        assert re.search("<svg|<img", (tmp_path / report / "report.html").read_text())


@pytest.mark.long
@pytest.mark.parametrize("page", HOW_TO, ids=name)
def test_commands_of_a_how_to_page_run(page, tmp_path):
    lay_out(tmp_path)
    for caption, content in files(page.read_text()).items():
        (tmp_path / caption).write_text(content)
    modules = [shlex.split(line)[1:] for line in commands(page) if line.startswith(f"{PYTHON} -m ")]
    lines = [shortened(words) for words in of_program(page) if not NOT_HERE.keys() & _names(words)]
    run_in_turn([*lines, *modules], tmp_path)


def _names(words):
    """The words of a command, and the names of what they set."""
    return {word.partition("=")[0] for word in words}


def shortened(words):
    """Return a command of which a campaign is one trial of `STEPS` steps in each combination, and a benchmark a try."""
    if words[2] == "benchmark" and "--table" not in words:
        return [*words, "--quick"]
    if words[2] != "compare" or {"--merge", "--against"} & set(words):
        return words
    place = words.index("--trials") if "--trials" in words else len(words)
    return [*words[:place], *words[place + 2 :], "--trials", "1", "--max-steps", STEPS]
