"""A slice of `make fuzz`: broken files of every format give a world or one line."""

import warnings

import numpy as np
import pytest

from chainslam.sim.worlds import World, WorldError, load
from tests.fuzzing import worlds

EACH = 30
MUTATORS = (worlds.damaged_file, worlds.other_values, worlds.other_words, worlds.other_shapes)


@pytest.mark.parametrize("mutator", MUTATORS, ids=lambda mutator: mutator.__name__)
def test_a_broken_file_is_a_world_or_one_line(tmp_path, mutator):
    told = []
    for number in range(EACH):
        folder = tmp_path / str(number)
        folder.mkdir()
        _, name, *_ = mutator(np.random.default_rng([2, number]), folder)[0]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                assert isinstance(load(folder / name), World)
            except WorldError as error:
                told.append(str(error))
    assert all(words.isprintable() and len(words) < 400 for words in told)
    assert 0 < len(told) < EACH, "a mutator that breaks nothing, or all, tests little"


def test_a_scribble_smaller_than_a_wall_is_refused_before_it_costs_minutes(tmp_path):
    ring = ", ".join(f"[{0.0001 * (i * 37 % 101)}, {0.0001 * (i * 53 % 97)}]" for i in range(60))
    (tmp_path / "a.geojson").write_text(f'{{"type": "LineString", "coordinates": [[0, 0], [9, 0], {ring}]}}')
    with pytest.raises(WorldError, match=r"nearer than .*--scale METRES"):
        load(tmp_path / "a.geojson")
