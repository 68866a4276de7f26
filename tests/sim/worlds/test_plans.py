"""The real floor plans and pictures, where they lie beside the checkout."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from sim.worlds import load

DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the floor plans (../shared/data) are not beside this checkout"
)


def test_all_plans_load_with_a_valid_free_space_and_a_clear_start():
    plans = sorted((DATA / "plans").glob("*.json"))
    assert len(plans) == 199
    for plan in plans:
        world = load(plan)
        assert world.free.is_valid, plan.name
        assert world.free.contains(shapely.Point(world.start[:2])), plan.name
        assert world.free.boundary.distance(shapely.Point(world.start[:2])) >= 0.2, plan.name
        assert world.reachable().area > 1.0, plan.name


@pytest.mark.parametrize(
    ("name", "faces", "free_m2"),
    [
        ("nav2_depot.yaml", (100, 600), (410, 450)),
        ("nav2_tb3_sandbox.yaml", (30, 150), (19, 21)),
        ("stage_cave.png", (60, 250), (460, 500)),
        ("stage_hospital_section.png", (300, 900), (780, 880)),
        ("willow-2010-0.10.yaml", (1000, 4000), (1000, 1200)),
    ],
)
def test_pictures_load_with_straight_faces_and_the_area_of_their_light_pixels(name, faces, free_m2):
    world = load(DATA / "rasters" / name)
    assert faces[0] < len(world.faces) < faces[1]
    assert free_m2[0] < world.free.area < free_m2[1]
    assert world.free.is_valid


def test_an_apartment_is_quick_and_almost_wholly_seen():
    world = load(DATA / "plans" / "lifull_04277621a038_0001.json")
    total = np.sum(np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T))
    assert 0.9 * total < world.reachable_contour().length_m <= total + 1e-6
