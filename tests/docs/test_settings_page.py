"""The page of settings is what the docstrings beside them say, in a sentence for each."""

import re
import sys
from pathlib import Path

import pytest

from chainslam.experiments.artifacts.settings import defaults, leaves

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "settings.md"
sys.path.append(str(ROOT / "docs" / "_ext"))
import settings_page  # noqa: E402


def rows():
    """The cells of each setting's row by its full key, as a reader puts it together of heading and first column."""
    for part in re.split(r"^## ", PAGE.read_text(), flags=re.M)[1:]:
        prefix = "".join(f"{key}." for key in re.findall(r"\A`(\S+)`", part))
        for line in re.findall(r"^\| (`.*) \|$", part, flags=re.M):
            key, *cells = line.split(" | ")
            yield prefix + key.strip("`"), [cell.strip() for cell in cells]


def test_the_page_is_made_of_the_code_as_it_is():
    assert PAGE.read_text() == settings_page.page(), "make settings"


def test_the_page_has_every_setting_once_and_no_other():
    keys = [key for key, _ in rows()]
    assert len(keys) == len(set(keys))
    assert set(keys) == {key for key, _ in leaves(defaults())}


def test_every_setting_has_a_range_and_one_sentence_without_names_of_the_code():
    for key, (_, _, allowed, words) in rows():
        assert allowed, key
        assert re.fullmatch(r"[A-Z][^.]*(?:\.\w[^.]*)*\.", words), (key, words)
        assert not re.search(r"\.py|[a-z]Config|\bslam/|…|\.\.\.", words), (key, words)


@pytest.mark.parametrize(
    ("key", "cells"),
    [
        ("robot.turn_rad", ["`0.1745` (10°)", "rad", "0.0001 to π"]),
        ("max_path_m", ["`null`", "m", "0.001 to 1e6 or null"]),
        ("mission.mapper.matching.gate", ["`0.99`", "", "between 0 and 1"]),
        ("robot.outline_m", ["`null`", "m", "list: [-10 to 10, -10 to 10] or null"]),
        ("p0", ["`small`", "", "large, small, zero"]),
        ("robot.faults.frozen_from", ["`2147483648`", "", "0 to 2^31"]),
    ],
)
def test_a_default_is_what_may_be_typed_and_a_range_is_short(key, cells):
    assert dict(rows())[key][:3] == cells


def test_a_group_that_may_be_left_out_says_how_and_what_then():
    assert "`--set mission.mapper.merging=null` switches this off. Without it," in PAGE.read_text()
    assert PAGE.read_text().count("=null` switches this off.") == 4
