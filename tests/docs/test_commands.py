"""Every command of README and docs names what there is; `test_pages_run.py` runs those of the user's pages."""

import importlib.util
import re
import shlex
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

import pytest

from chainslam.experiments.commands.cli import _parse
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds.registry import READERS
from chainslam.slam.backends import BACKENDS

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in page.parts),
]
PROGRAM, PYTHON = ".venv/bin/chainslam", ".venv/bin/python"
TARGETS = re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
STAND_INS = {"N": "1", "ADDRESS": "127.0.0.1:8786", "...": "full-ekf"}
"""What a page writes where a number, an address or more names may stand."""


def name(page):
    return str(page.relative_to(ROOT))


def commands(page):
    """The lines of a page's code blocks and its words in code that are commands, without comments."""
    text = page.read_text()
    blocks = re.findall(r"^(?:    |> ?)(.*)$", text.replace("\\\n", ""), flags=re.MULTILINE)
    blocks += re.findall(r"^([^`|].*)$", "\n".join(re.findall(r"^```(?:bash|sh)\n(.*?)^```", text, re.M | re.S)), re.M)
    # In running text a command may go on in the next line; a name alone is no command.
    words = [" ".join(found.split()) for found in re.findall(r"(?<!`)`([^`]+)`(?!`)", text)]
    lines = [re.split(r"\s+#\s", line)[0].strip() for line in [*blocks, *words]]
    return [line for line in lines if re.match(rf"({PROGRAM}|{PYTHON}|python) -?\w|make [a-z]", line)]


def test_commands_are_found_in_blocks_and_in_running_text(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "    .venv/bin/chainslam worlds    # also: backends\n    .venv/bin/chainslam explore \\\n        rooms\n\n"
        "`make\nbench`, and `python -m studies.exploration.plans`; `make` alone is none.\n"
    )
    assert commands(page) == [
        ".venv/bin/chainslam worlds",
        ".venv/bin/chainslam explore         rooms",
        "make bench",
        "python -m studies.exploration.plans",
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_command_of_a_page_is_one(page):
    for line in commands(page):
        words = shlex.split(line)
        program, rest = words[0], [STAND_INS.get(word, word) for word in words[1:]]
        if program == "make":
            assert rest[0] in TARGETS, line
        elif program == PROGRAM:
            _parse_or_help(rest)
        elif rest[0] == "-m":
            assert importlib.util.find_spec(rest[1]) is not None, line
        elif rest[0] != "-c":
            assert (ROOT / rest[0]).is_file(), line


def _parse_or_help(words):
    """Parse a command without running it; raises UsageError for one that there is not. Registries stay as they were."""
    with suppress(SystemExit), patch.dict(BACKENDS), patch.dict(STRATEGIES), patch.dict(READERS):
        _parse(words)


def _module_commands():
    found = {line for page in PAGES for line in commands(page) if " -m " in line}
    return sorted(line.replace(PYTHON, "python") for line in found)


@pytest.mark.long
def test_every_option_of_a_module_is_in_its_help():
    helps = {}
    for line in _module_commands():
        _, _, module, *rest = shlex.split(line)
        if module in ("pytest", "benchmarks.recording_pairs"):
            continue
        if module not in helps:
            done = python("-m", module, "--help", cwd=ROOT)
            assert done.returncode == 0, f"{line}: {done.stderr}"
            helps[module] = done.stdout
        for option in (word.partition("=")[0] for word in rest if word.startswith("--")):
            assert option in helps[module], line


def python(*words, cwd):
    """Run Python on these sources in a folder, and return what came of it."""
    env = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1", "HOME": str(Path.home())}
    return subprocess.run([sys.executable, *words], cwd=cwd, capture_output=True, text=True, env=env, check=False)
