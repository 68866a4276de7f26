"""Second looks at a whole drive: loops are closed, all segments associated anew, and all solved for together.

A filter decides once, when a segment is seen, which wall it is of. Here every such decision is made again, from poses
that all scans agree on, as often as there are rounds. Nothing of it asks which back end ran.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csc_array

from ...estimation.backend import POSE, Joint
from ...extraction.segments import Segments
from ...geometry.poses import body_pair_covs
from ...map.stochastic_map import StochasticMap
from .closures import Drive, closure_links, held, settled
from .config import SecondLooksConfig
from .landmarks import Sightings, associated, firm, joined
from .loop_search import LoopSearch
from .refuted import NO_RAYS, Rays, refuted
from .scatter import as_scattered
from .solve import begun, normal_equations, solved, without_lines
from .submaps import Returns
from .walls import blocks_at, inverse_at, merged, spans, surveyed

DEFAULTS = SecondLooksConfig()
SEARCH = 0.5
"""Share of the work that is the search for loops."""


def to_the_end(share: float) -> bool:
    """Go on whatever share is done."""
    return True


@dataclass(frozen=True)
class Survey:
    """What all scans of a drive say together, world frame."""

    poses: Float[np.ndarray, "s 3"]
    walls: StochasticMap
    joint: Joint
    """The last pose and all walls."""
    closures: int
    """So many places that the robot came back to hold the path together."""
    information: csc_array
    """About all poses, of which the first is fixed, and then all walls; the floors of walls are not in it."""

    def pose_covs(self) -> Float[np.ndarray, "s 3 3"]:
        """Return the covariance of each pose."""
        return blocks_at(self.information, len(self.poses))

    def pair_covs(self, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        """Return how two poses err together, each in its body frame."""
        told, at = np.unique(np.stack([first, second]), return_inverse=True)
        cov = inverse_at(self.information, (POSE * told[:, None] + np.arange(POSE)).ravel())
        rows = (POSE * at.reshape(2, -1).T[..., None] + np.arange(POSE)).reshape(len(first), 2 * POSE)
        return body_pair_covs(self.poses[first], self.poses[second], cov[rows[:, :, None], rows[:, None, :]])


def second_looks(
    start_world: Float[np.ndarray, "3"],
    drive: Drive,
    segments: Sequence[Segments],
    returns: Sequence[Float[np.ndarray, "_ 2"]],
    config: SecondLooksConfig = DEFAULTS,
    rays: Rays = NO_RAYS,
    goes_on: Callable[[float], bool] = to_the_end,
) -> Survey:
    """Return the poses and walls that agree best with all motions between scans and the segments of all scans.

    The drive has one motion less than poses; `segments` and `returns` are those of each scan, robot frame. The first
    pose stays where it is. By `rays`, walls that came and went are left out. `goes_on` hears of the share that is done;
    where it answers no, no further loop is sought, and segments are associated once.
    """
    found = Returns(returns, config.closures)
    search = LoopSearch(start_world, drive, found, config, lambda share: goes_on(SEARCH * share))
    sightings = joined([firm(k, each, config) for k, each in enumerate(segments)])
    return _with_walls(search, sightings, config, rays, lambda share: goes_on(SEARCH + (1.0 - SEARCH) * share))


def _with_walls(
    search: LoopSearch,
    sightings: Sightings,
    config: SecondLooksConfig,
    rays: Rays = NO_RAYS,
    goes_on: Callable[[float], bool] = to_the_end,
) -> Survey:
    """Return poses and walls after all rounds of association and solution; at last, duplicate walls are one.

    The information is that of sightings which scatter as much as their errors at the solution.
    """
    c, drive = config.closures, search.drive.links(config.doubt, config)
    unknowns = without_lines(settled(search.poses, search.drive, search.closures, config))
    seen, of = sightings, np.zeros(0, dtype=np.int64)
    links, kept = [drive], search.closures
    rounds = [*config.gates_m, None]
    for number, gate_m in enumerate(rounds):
        if 0 < number < len(rounds) - 1 and not goes_on(number / len(rounds)):
            continue
        if gate_m is None:
            of = merged(unknowns, spans(unknowns, seen, of), of, config)
            unknowns = begun(unknowns.poses, seen, of)
            gone = refuted(unknowns, spans(unknowns, seen, of), rays, config.gates_m[-1])[of]
            seen, of = seen.take(~gone), np.unique(of[~gone], return_inverse=True)[1]
        else:
            owner = associated(sightings, unknowns.poses, gate_m, config)
            seen, of = sightings.take(owner >= 0), owner[owner >= 0]
        kept = held(search.closures, unknowns.poses, c)
        links = [drive, closure_links(kept, config.doubt, c)]
        unknowns = solved(begun(unknowns.poses, seen, of), links, seen, of, config)
    # The path stays: where sightings of other walls are among them, their errors are no guide to better weights.
    scattered, by = as_scattered(unknowns, seen, of, config)
    information, _ = normal_equations(unknowns, links, scattered, of, by)
    walls, joint = surveyed(unknowns, information, seen, of, config)
    return Survey(unknowns.poses, walls, joint, len(kept), information)
