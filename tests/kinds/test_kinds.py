"""Inputs of each kind, made by chance, are read rightly or refused in one line."""

import numpy as np
import pytest

from .case import verdict
from .registry import KINDS

DRAWS = range(6)


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
