"""What is counted of the code, on a small tree of which every count is known."""

import pytest

from studies.code.counts import LAYOUT, arrows, by_folder, entries, tunable

CODE = '''
"""A file."""
from dataclasses import dataclass, field
import numpy as np

SCANS = 4
"""So many scans."""
POSE = 3
"""Size of a pose."""
NOTHING = np.zeros((0, 2))
ANGLE_RAD = float(np.deg2rad(3.0))
name = 5
WORD = "seven"


@dataclass
class AConfig:
    """Settings."""

    reach_m: float = 0.3
    """How far."""
    flag: bool = True
    pair: tuple[float, float] = (0.1, 0.2)
    parts: list[int] = field(default_factory=list)


@dataclass
class Other:
    """No settings."""

    x: float = 3.5


def rule(x, y):
    """Decide."""
    if x > 0.25 * y and len(y) > 1 and y[7] == 0:
        return x < -9.0
    nearly = 0.5 * max(x, 1e-3)
    return min(nearly, 8)
'''


@pytest.fixture
def root(tmp_path):
    inside = tmp_path / "slam" / "map"
    inside.mkdir(parents=True)
    (tmp_path / "explore").mkdir()
    (tmp_path / "slam" / "__init__.py").touch()
    (tmp_path / "slam" / "py.typed").touch()
    (inside / "walls.py").write_text(CODE)
    (inside / "__pycache__").mkdir()
    return tmp_path


def test_numbers_that_one_may_tune_are_settings_constants_and_sides_of_comparisons(root):
    found = [(each.name, each.value, each.kind, each.says) for each in tunable(root)]
    assert found == [
        ("AConfig.reach_m", "0.3", "setting", "How far."),
        ("AConfig.pair", "(0.1, 0.2)", "setting", ""),
        ("SCANS", "4", "constant", "So many scans."),
        ("POSE", "3", "layout", "Size of a pose."),
        ("ANGLE_RAD", "float(np.deg2rad(3.0))", "constant", ""),
        ("x > 0.25 * y", "0.25", "literal", ""),
        ("x < -9.0", "9.0", "literal", ""),
        ("nearly = 0.5 * max(x, 0.001)", "0.001", "literal", ""),
    ]


def test_numbers_of_compiled_loops_count_where_these_are_used(root):
    loops = root / "slam" / "map" / "kernels"
    loops.mkdir()
    (loops / "sums.py").write_text("LEAST = 3\nPOSE = 3\n")
    assert by_folder(tunable(root)) == {"slam/map": 8}


def test_what_is_no_choice_is_a_constant_of_the_product(request):
    constants = {each.name for each in tunable(request.config.rootpath) if each.kind == "layout"}
    assert constants == set(LAYOUT)


def test_what_makes_a_folder_a_package_is_no_entry(root):
    assert entries(root, ("slam",)) == {"slam": 1, "slam/map": 1}


def test_no_folder_of_the_product_holds_more_than_a_dozen_entries(request):
    assert max(entries(request.config.rootpath).values()) <= 12


def test_imports_are_counted_from_the_files_of_a_room():
    files, imports = arrows(("slam",))["slam"]
    assert 40 < files < imports
