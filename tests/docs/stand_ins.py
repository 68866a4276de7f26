"""Files that a reader of the how-to pages has, in place of which stand small ones here."""

import gzip
import shutil
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image

from tests.kinds.logs import SCANS, drive, seen_from
from tests.sim.logs.written_bag import Bag, pose_at

ROOT = Path(__file__).parents[2]


def lay_out(folder: Path) -> None:
    """Put drawings, a log with what was measured of it, a bag and the examples into a folder, by the pages' names."""
    (folder / "examples").symlink_to(ROOT / "examples")
    (folder / ".venv").symlink_to(sys.prefix)
    shutil.copy(ROOT / "examples" / "plans" / "inkscape.svg", folder / "plan.svg")
    corners = [(0, 0), (6, 0), (6, 4), (0, 4), (0, 0)]
    (folder / "plan.dxf").write_text(dxf(corners, "A-WALL-EXTERIOR"))
    room = np.full((250, 300), 255, dtype=np.uint8)
    room[:10], room[-10:], room[:, :10], room[:, -10:] = 0, 0, 0, 0
    Image.fromarray(room).save(folder / "scan.png")
    Image.fromarray(room).save(folder / "map.pgm")
    (folder / "map.yaml").write_text(
        "image: map.pgm\nresolution: 0.02\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    floor, maps = np.full((250, 250), 205, dtype=np.uint8), folder / "Explore-Bench/exploration_benchmark/blueprints"
    maps.mkdir(parents=True)
    floor[20:70, 190:240], floor[21:69, 191:239] = 0, 254
    for name in ("room_with_corner", "loop_with_corridor_sym"):
        Image.fromarray(floor).save(maps / f"{name}.pgm")
        (maps / f"{name}.yaml").write_text(f"image: {name}.pgm\nresolution: 0.1\norigin: [-12.5, -12.5, 0]\n")
    made = drive(np.random.default_rng(0))
    with gzip.open(folder / "intel.log.gz", "wt") as log:
        log.writelines(f"{line}\n" for line in made.flaser())
    for day in ("monday", "tuesday"):
        shutil.copy(folder / "intel.log.gz", folder / f"{day}.log.gz")
    path = np.column_stack([made.time_s, made.poses])
    np.savetxt(folder / "intel.ref_gmapping.txt", path, fmt="%.6f")
    x, y, heading = made.poses[-1] - made.poses[0]
    (folder / "intel.relations").write_text(f"{made.time_s[0]} {made.time_s[-1]} {x} {y} 0 0 0 {heading}\n")
    bearings = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    with Bag(folder / "bag", "mcap") as bag:
        for k in range(5 * SCANS):
            pose = pose_at(0.02 * k)
            bag.odometry(1.5e9 + 0.1 * k, pose)
            if k % 5 == 0:
                bag.scan(1.5e9 + 0.1 * k, seen_from(pose, bearings), bearings[0], bearings[1] - bearings[0])


def dxf(corners: list[tuple[float, float]], layer: str) -> str:
    """Return a drawing of lines from corner to corner on one layer."""
    lines = (f"0\nLINE\n8\n{layer}\n10\n{a[0]}\n20\n{a[1]}\n11\n{b[0]}\n21\n{b[1]}\n" for a, b in pairwise(corners))
    return f"0\nSECTION\n2\nENTITIES\n{''.join(lines)}0\nENDSEC\n0\nEOF\n"
