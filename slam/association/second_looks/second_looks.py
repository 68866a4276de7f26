"""Second looks at a whole drive: loops are closed, all segments associated anew, and all solved for together.

A filter decides once, when a segment is seen, which wall it is of. Here every such decision is made again, from poses
that all scans agree on, as often as there are rounds. Nothing of it asks which back end ran.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ...extraction.segments import Segments
from .closures import closure_links, held, settled
from .config import SecondLooksConfig
from .landmarks import Sightings, associated, firm, joined
from .loop_search import LoopSearch
from .solve import Unknowns, begun, solved
from .submaps import Returns

DEFAULTS = SecondLooksConfig()


def second_looks(
    start_world: Float[np.ndarray, "3"],
    motions: Float[np.ndarray, "t 3"],
    segments: Sequence[Segments],
    returns: Sequence[Float[np.ndarray, "_ 2"]],
    config: SecondLooksConfig = DEFAULTS,
) -> Float[np.ndarray, "s 3"]:
    """Return the poses that agree best with all motions between scans and the segments of all scans.

    `motions` lead from each pose to the next (robot frame, m m rad), one less than poses; `segments` and `returns` are
    those of each scan, robot frame. The first pose stays where it is.
    """
    search = LoopSearch(start_world, motions, Returns(returns, config.closures), config)
    sightings = joined([firm(k, each, config) for k, each in enumerate(segments)])
    return _with_lines(search, sightings, config).poses


def _with_lines(search: LoopSearch, sightings: Sightings, config: SecondLooksConfig) -> Unknowns:
    """Return poses and lines after all rounds of association and solution."""
    c, drive = config.closures, search.drive.links(config.doubt, config)
    poses = settled(search.poses, search.drive, search.closures, config)
    unknowns = Unknowns(poses, np.zeros((0, 2)), np.zeros((0, 2)))
    for gate_m in config.gates_m:
        owner = associated(sightings, unknowns.poses, gate_m, config)
        kept = owner >= 0
        seen = Sightings(*(getattr(sightings, name)[kept] for name in Sightings.__dataclass_fields__))
        links = (drive, closure_links(held(search.closures, unknowns.poses, c), config.doubt, c))
        unknowns = solved(begun(unknowns.poses, seen, owner[kept]), links, seen, owner[kept], config)
    return unknowns
