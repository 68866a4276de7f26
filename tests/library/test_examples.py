"""Every example runs, from another folder, and says what it should; the notebooks run cell by cell."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PAGE = EXAMPLES.parent / "docs" / "howto" / "python.md"
SAID = {
    "own_backend": "axioms that fail: 0\n",
    "own_strategy": "farthest: complete",
    "own_world_format": "complete: coverage 1.000",
    "own_robot": "complete: 6 walls",
    "streaming_robot": "complete: 6 walls",
    "irsim_robot": "complete: 12 walls",
    "mujoco_robot": "complete: 12 walls",
    "read_results": "wall 1:",
    "policy": "of the contour mapped",
    "cluster_campaign": "full-ekf",
}
NEEDS_ROS = {"ros_node"}
"""`test_ros_node.py` runs these without it."""
PROGRAMS = {"external_odometry", "external_kiss_icp"}
"""Started by `--external` (tests/experiments/replays/test_external.py); the second needs KISS-ICP."""
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))
pytestmark = pytest.mark.long


def test_each_example_is_named_here():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == SAID.keys() | NEEDS_ROS | PROGRAMS
    assert len(NOTEBOOKS) == 2


@pytest.mark.parametrize("name", SAID)
def test_an_example_runs_from_anywhere(name, tmp_path):
    done = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py"], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, done.stderr
    assert SAID[name] in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_page_about_python_runs_block_by_block(tmp_path):
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)
    assert len(blocks) == 3
    _run_in_turn(blocks, tmp_path)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_its_first_cell_to_its_last(notebook, tmp_path):
    """Each cell in turn, in one namespace, as a kernel would; the last line of a cell may be an expression."""
    cells = json.loads(notebook.read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in cells if cell["cell_type"] == "code")
    assert len(code) > 3
    _run_in_turn(code, tmp_path)


def _run_in_turn(code, folder):
    words = "import sys\nfor cell in eval(sys.stdin.read()):\n    exec(compile(cell, 'cell', 'exec'), globals())"
    done = subprocess.run(
        [sys.executable, "-c", words], input=repr(code), capture_output=True, text=True, cwd=folder, check=False
    )
    assert done.returncode == 0, done.stderr
