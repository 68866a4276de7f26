"""Apartments whose walls have steps, bends and pilasters."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from chainslam.experiments.scenario import load_world
from studies.plans.uneven import UnevenStudy
from studies.plans.uneven_walls import DEPTH_M, LONG_M, uneven

PLAN = "tests/data/plans/apartment.json"


@pytest.mark.parametrize("seed", range(3))
def test_walls_are_uneven_by_at_most_so_much_and_the_building_is_the_same(seed):
    world = load_world(PLAN)
    changed = uneven(world, seed)
    apart = shapely.hausdorff_distance(world.free.exterior, changed.free.exterior)
    assert DEPTH_M[0] <= apart <= DEPTH_M[1] + 1e-6
    assert changed.free.is_valid
    assert len(changed.free.interiors) == len(world.free.interiors)
    long = np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T) >= LONG_M
    assert len(changed.faces) > len(world.faces) + 0.5 * np.count_nonzero(long)
    assert shapely.equals(uneven(world, seed).free, changed.free)


def test_the_study_writes_its_buildings_drives_in_them_and_says_how_consistent_the_maps_are(tmp_path, capsys):
    plans = tmp_path / "plans"
    plans.mkdir()
    (plans / "lifull_1.json").write_text(Path(PLAN).read_text())
    UnevenStudy(plans=plans, max_steps=4, jobs=1, out=tmp_path / "out" / "rows.jsonl").run()
    told = capsys.readouterr().out
    assert "0 of 1 complete" in told
    drawn = load_world(str(tmp_path / "out" / "lifull_1.geojson"))
    made = uneven(load_world(str(plans / "lifull_1.json")), 1).free
    # What is read from a drawing is smoothed by 12 mm.
    assert shapely.hausdorff_distance(drawn.free.exterior, made.exterior) < 0.012
