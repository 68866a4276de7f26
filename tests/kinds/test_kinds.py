"""Inputs of each kind, made by chance, are read rightly or refused in one line."""

import re
from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.usage import UsageError

from .__main__ import BEGIN, END
from .case import Case, verdict
from .registry import KINDS

DRAWS = range(2)
PAGE = Path(__file__).parents[2] / "docs" / "contributing" / "testing.md"


@pytest.mark.parametrize("kind", KINDS)
def test_inputs_of_each_kind_are_read_rightly_or_refused(kind, tmp_path):
    wrong = []
    for number in DRAWS:
        folder = tmp_path / str(number)
        folder.mkdir()
        found, fault = verdict(KINDS[kind](np.random.default_rng([7, number]), folder))
        if found == "wrong":
            wrong.append(f"{number}: {fault}")
    assert not wrong


def refuses(words):
    def read():
        raise UsageError(words)

    return read


def fails():
    raise ZeroDivisionError


@pytest.mark.parametrize(
    ("case", "end"),
    [
        (Case(lambda: 1), "right"),
        (Case(lambda: 1, lambda found: f"{found} is no 2"), "wrong"),
        (Case(lambda: 1, refused="expected"), "wrong"),
        (Case(fails), "wrong"),
        (Case(fails, refused="expected"), "wrong"),
        (Case(refuses("expected a log, found none: name one"), refused="found none"), "refused"),
        (Case(refuses("expected a log, found none: name one"), refused="found two"), "wrong"),
        (Case(refuses("expected a log, found none: name one")), "wrong"),
        (Case(refuses("expected a log,\nfound none: name one"), refused="found none"), "wrong"),
        (Case(refuses("found none"), refused="found none"), "wrong"),
    ],
)
def test_what_is_read_wrongly_or_refused_in_other_words_is_wrong(case, end):
    assert verdict(case)[0] == end


def test_the_page_has_a_row_for_each_kind_and_none_was_read_wrongly():
    table = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    rows = re.findall(r"^\| (.+?) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", table, re.MULTILINE)
    assert [kind for kind, *_ in rows] == [*KINDS, "**all**"]
    for _, tried, right, refused, wrong in rows:
        assert (int(tried), int(wrong)) == (int(right) + int(refused), 0)
        assert int(tried) > 0
