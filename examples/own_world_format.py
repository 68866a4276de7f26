"""A format of drawings of one's own: a text file with a wall a line, `x1 y1 x2 y2` in metres."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely

import chainslam
from chainslam.sim.worlds.drawing import Drawing, WorldError

ROOM = """0 0 6 0
6 0 6 4
6 4 0 4
0 4 0 0
3 0 3 2.5
"""


def read_walls(path: Path, options: chainslam.DrawingOptions) -> Drawing:
    """Return the walls in a file; raises WorldError, in one line, for any other file."""
    try:
        ends = np.loadtxt(path, ndmin=2).reshape(-1, 2, 2) * (options.scale or 1.0)
    except (ValueError, OSError) as error:
        raise WorldError(f"expected `x1 y1 x2 y2` in every line, found {path.name} ({error}): correct it") from error
    return Drawing(lines=tuple(map(shapely.LineString, ends)), start=np.array([1.5, 1.0, 0.0]))


chainslam.READERS[".walls"] = read_walls

if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        file = Path(folder) / "room.walls"
        file.write_text(ROOM)
        run = chainslam.explore(file, errorless=True)
    print(f"{run.summary['status']}: coverage {run.summary['coverage']:.3f} after {run.summary['steps']} steps")
