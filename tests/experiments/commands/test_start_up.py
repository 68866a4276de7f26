"""What a command imports before it knows what it is asked: nothing that takes long."""

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from chainslam.experiments.commands.cli import COMMANDS, main

ROOT = Path(__file__).parents[3]
HEAVY = (
    "gtsam",
    "jinja2",
    "joblib",
    "matplotlib",
    "networkx",
    "numba",
    "pandas",
    "PIL",
    "pyarrow",
    "rerun",
    "scipy",
    "shapely",
    "skimage",
)


def imported(program):
    """The heavy packages that a program has imported when it ends."""
    code = f"import sys\n{program}\nprint(*sorted(set({HEAVY!r}) & set(sys.modules)), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stderr.split())


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        (["--help"], set()),
        (["worlds"], {"shapely"}),
        (["backends"], {"scipy"}),
    ],
)
def test_the_help_and_the_listings_import_only_what_they_show(words, needed):
    program = (
        f"from chainslam.experiments.commands.cli import main\ntry:\n    main({words!r})\nexcept SystemExit:\n    pass"
    )
    assert imported(program) <= needed


@pytest.mark.parametrize(
    "words",
    [
        ["strategies"],
        ["demo", "--help"],
        ["explore", "--help"],
        ["replay", "--help"],
        ["report", "no-such-folder"],
        ["compare", "--help"],
    ],
)
def test_a_command_that_runs_no_step_loads_no_compiler(words):
    program = (
        f"from chainslam.experiments.commands.cli import main\ntry:\n    main({words!r})\nexcept SystemExit:\n    pass"
    )
    assert "numba" not in imported(f"import os\nos.dup2(os.open(os.devnull, os.O_WRONLY), 1)\n{program}")


def test_a_campaigns_worker_imports_nothing_that_draws():
    drawing = {"matplotlib", "rerun", "jinja2", "pandas", "gtsam"}
    assert not imported("import chainslam.experiments.campaign.work") & drawing


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_says_of_each_command_what_it_says_of_itself(name):
    command = COMMANDS[name].load()
    assert " ".join(command.__doc__.partition("\n\n")[0].split()) == COMMANDS[name].words


def _is_tried(node, nodes):
    """Whether an import may fail: it stands in a `try` with an answer to ImportError."""
    tries = [each for each in nodes if isinstance(each, ast.Try)]
    answered = [t for t in tries if any(getattr(h.type, "id", "") == "ImportError" for h in t.handlers)]
    return any(node in t.body for t in answered)


def test_no_room_imports_pandas():
    """It is none of the packages that the product asks for; tables of the library are plain arrays without it."""
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert not [name for name in asked if name.startswith("pandas")]
    for room in ("slam", "explore", "sim", "viz", "experiments"):
        for path in (ROOT / room).rglob("*.py"):
            nodes = list(ast.walk(ast.parse(path.read_text())))
            if path == ROOT / "experiments" / "library" / "runs.py":
                nodes = [node for node in nodes if not _is_tried(node, nodes)]
            names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
            names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
            assert not [name for name in names if name.split(".")[0] == "pandas"], path


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["--version"])
    assert leaving.value.code == 0
    told = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert capsys.readouterr().out == f"chainslam {told}\n"
