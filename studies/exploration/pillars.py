"""A room with a pillar of 8 to 20 cm: how often its contour is closed, and how far the closed one is from the truth.

.venv/bin/python -m studies.exploration.pillars --pillars 60
"""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.polygon import orient

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.trial import run_trial
from chainslam.sim.worlds import World

from ..runner.command import run_study

ROOM_M = (3.5, 3.0)
START = (0.6, 0.6, 0.3)


@dataclass(frozen=True)
class PillarsStudy:
    """Explore one room for each pillar, with noise, and print what became of the pillar."""

    pillars: int = 60
    """How many: boxes of 12 by 11 cm, triangles and thin boxes by turns."""
    first_seed: int = 0
    """The seed of the first, which decides its place and the noise; the others follow it."""
    backend: str = "full-ekf"
    """The estimator."""

    def run(self) -> None:
        """Run the study and print a row for each pillar whose contour is not closed rightly; raises UsageError."""
        check(TrialConfig("pillar", self.backend))
        wrong = 0
        for k in range(self.first_seed, self.first_seed + self.pillars):
            corners = pillar(k)
            ring = [(0.0, 0.0), (ROOM_M[0], 0.0), ROOM_M, (0.0, ROOM_M[1])]
            room = orient(shapely.Polygon(ring, [corners]))
            world = World(f"pillar-{k}", room, np.array(START), {})
            summary = run_trial(TrialConfig(world.name, self.backend, seed=k, max_steps=500), world=world).summary
            contours = summary["certificate"]["contours"]
            off_m = [
                shapely.Polygon(contour["polygon"]).hausdorff_distance(shapely.Polygon(corners))
                for contour in contours
                if contour["contour"] == "island"
            ]
            if summary["contours_closed"] < 2 or max(off_m, default=1.0) > 0.1:
                wrong += 1
                shape = f"closed, {100 * off_m[0]:.0f} cm from the truth" if off_m else "not closed"
                print(f"pillar {k}: {shape}; {summary['reason']}", flush=True)
        print(f"{self.pillars - wrong} of {self.pillars} closed rightly")


def pillar(seed: int) -> Float[np.ndarray, "n 2"]:
    """Return the corners of a pillar somewhere in the room, turned by any angle, m."""
    chance = np.random.default_rng(seed)
    kind = seed % 3
    wide, deep = 0.12, 0.11
    if kind == 1:
        wide, deep = chance.uniform(0.09, 0.2, 2)
    elif kind == 2:
        wide, deep = chance.uniform(0.08, 0.12), chance.uniform(0.12, 0.2)
    at, turn = np.array([chance.uniform(1.2, 2.3), chance.uniform(1.2, 1.8)]), chance.uniform(0.0, np.pi)
    corners = np.array([[0.0, 0.0], [wide, 0.0], [wide, deep], [0.0, deep]])
    if kind == 1:
        corners = np.array([[0.0, 0.0], [wide, 0.0], [0.3 * wide, deep]])
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return (corners - corners.mean(axis=0)) @ rotation + at


if __name__ == "__main__":
    run_study(PillarsStudy)
