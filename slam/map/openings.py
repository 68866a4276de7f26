"""Which gaps between two walls beams have passed through: there a way leads on, and no short face was missed.

And which corners they have cut off: where two walls would meet if both went on, there is none.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.shared import SharedConfig
from ..robot import Scan
from .kernels import ray_kernels
from .kernels.ray_kernels import Watch
from .records import Records
from .stochastic_map import StochasticMap


class Openings:
    """Remembers (wall whose head, wall whose tail) bounds a gap that beams went through.

    A beam passes a gap if it goes on beyond it, four sigmas of a beam away from both ends. Narrower gaps are not
    watched, nor are those wider than a door, which no chain would join. Beams cut a corner off that cross what is
    supposed of either wall, so far from its ends, and reach as far behind it, across the wall.
    """

    def __init__(self, shared: SharedConfig = SharedConfig(), records: Records | None = None) -> None:
        gap_m, reach_m = float(shared.door_m), float(shared.short_m)
        self._watch = Watch(gap_m, reach_m, float(shared.beyond_m), float(shared.beams_m), shared.scans)
        self._records = Records() if records is None else records
        self._records.relate("passed", "cut_off")

    @property
    def passed(self) -> set[tuple[int, int]]:
        """Pairs (wall whose head, wall whose tail) that bound a gap through which beams went."""
        return self._records.pairs["passed"]

    @property
    def cut_off(self) -> set[tuple[int, int]]:
        """Pairs that make no corner where their lines cross: beams went through one of the two supposed pieces."""
        return self._records.pairs["cut_off"]

    def see(self, walls: StochasticMap, scan: Scan) -> None:
        """Hold one scan, taken at the map's pose, against gaps and corners of established walls within its range."""
        watch, belief = self._watch, walls.belief
        is_watched = ~walls.tentative & (walls.distances_m < scan.range_max_m + watch.widest_m)
        beams = scan.bearings_rad, scan.passed_m, float(scan.range_max_m)
        pairs, passed, supposed, cut_off = ray_kernels.between(
            walls.ends_world, belief.lines_world, is_watched, belief.pose_world, *beams, watch
        )
        if passed.any():
            self.passed.update(_tuples(walls.ids[pairs[passed]]))
        if self.cut_off:
            # Ends that have come to meet where the lines cross suppose nothing any more.
            self.cut_off.difference_update(_tuples(walls.ids[pairs[~supposed]]))
        if cut_off.any():
            self.cut_off.update(_tuples(walls.ids[pairs[cut_off]]))


def _tuples(pairs: Int[np.ndarray, "k 2"]) -> list[tuple[int, int]]:
    return [(head, tail) for head, tail in pairs.tolist()]


def passing(
    from_world: Float[np.ndarray, "g 2"],
    to_world: Float[np.ndarray, "g 2"],
    pose_world: Float[np.ndarray, "3"],
    scan: Scan,
    beyond_m: float,
    margin_m: float,
    across_m: float = 0.0,
) -> Bool[np.ndarray, "g k"]:
    """Return which beams cross the straight way between two points, away from both, and go on beyond it.

    So far along the beam, and so far across the way.
    """
    beams = scan.bearings_rad, scan.passed_m
    return ray_kernels.passing(
        from_world, to_world, pose_world, *beams, float(beyond_m), float(margin_m), float(across_m)
    )
