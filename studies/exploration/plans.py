"""Load all the floor plans and pictures of a folder, to find those that make no building to explore.

    .venv/bin/python -m studies.exploration.plans ../shared/data

The folder holds `plans/*.json` and `rasters/`. Prints a line for each that does not, and how many do; exit status 1 if
any does not.
"""

import sys
from pathlib import Path

import shapely

from chainslam.sim.worlds import load

RASTERS = {
    "nav2_depot.yaml": ((100, 600), (410, 450)),
    "nav2_tb3_sandbox.yaml": ((30, 150), (19, 21)),
    "stage_cave.png": ((60, 250), (460, 500)),
    "stage_hospital_section.png": ((300, 900), (780, 880)),
    "willow-2010-0.10.yaml": ((1000, 4000), (1000, 1200)),
}
"""How many faces, and m2 of light pixels, each picture should have."""


def faults_of_a_plan(path: Path) -> list[str]:
    """Return what is wrong with a plan."""
    world = load(path)
    at = shapely.Point(world.start[:2])
    wrong = {
        "its free space is not valid": not world.free.is_valid,
        "the start is not free": not world.free.contains(at),
        "the start is within 0.2 m of a wall": world.free.boundary.distance(at) < 0.2,
        "the robot reaches less than 1 m2": world.reachable().area <= 1.0,
    }
    return [fault for fault, is_so in wrong.items() if is_so]


def faults_of_a_picture(path: Path) -> list[str]:
    """Return what is wrong with a picture."""
    world, (faces, free_m2) = load(path), RASTERS[path.name]
    wrong = {
        f"{len(world.faces)} faces": not faces[0] < len(world.faces) < faces[1],
        f"{world.free.area:.0f} m2 free": not free_m2[0] < world.free.area < free_m2[1],
        "its free space is not valid": not world.free.is_valid,
    }
    return [fault for fault, is_so in wrong.items() if is_so]


def main(folder: Path) -> int:
    """Look at all files and return the exit status."""
    faults = {path: faults_of_a_plan(path) for path in sorted((folder / "plans").glob("*.json"))}
    faults |= {folder / "rasters" / name: faults_of_a_picture(folder / "rasters" / name) for name in RASTERS}
    bad = {path: wrong for path, wrong in faults.items() if wrong}
    for path, wrong in bad.items():
        print(f"{path.name}: {', '.join(wrong)}")
    print(f"{len(faults) - len(bad)} of {len(faults)} are buildings to explore")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
