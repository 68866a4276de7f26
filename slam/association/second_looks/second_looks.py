"""Second looks at a whole drive: all segments are associated anew at the poses as they are, and all solved together.

A filter decides once, when a segment is seen, which wall it is of. Here every such decision is made again, from poses
that all scans agree on, as often as there are rounds.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ...extraction.segments import Segments
from .config import SecondLooksConfig
from .landmarks import Sightings, associated, firm, joined
from .solve import Unknowns, begun, solved

DEFAULTS = SecondLooksConfig()


def second_looks(
    starts_world: Sequence[Float[np.ndarray, "s 3"]],
    motions: Float[np.ndarray, "t 3"],
    segments: Sequence[Segments],
    config: SecondLooksConfig = DEFAULTS,
) -> Float[np.ndarray, "s 3"]:
    """Return the poses that agree best with all motions between scans and the segments of all scans.

    `motions` lead from each pose to the next (robot frame, m m rad), one less than poses; `segments` are those of each
    scan. Of several paths to start from, that one counts whose segments end on the fewest lines: where a path has not
    come together, walls stand twice. The first pose stays where it is.
    """
    sightings = joined([firm(k, each, config) for k, each in enumerate(segments)])
    found = [_settled(poses, motions, sightings, config) for poses in starts_world]
    return min(found, key=lambda each: len(each.lines)).poses


def _settled(
    poses: Float[np.ndarray, "s 3"], motions: Float[np.ndarray, "t 3"], sightings: Sightings, config: SecondLooksConfig
) -> Unknowns:
    """Return poses and lines after all rounds of association and solution."""
    unknowns = Unknowns(poses, np.zeros((0, 2)), np.zeros((0, 2)))
    for gate_m in config.gates_m:
        owner = associated(sightings, unknowns.poses, gate_m, config)
        kept = owner >= 0
        seen = Sightings(*(getattr(sightings, name)[kept] for name in Sightings.__dataclass_fields__))
        unknowns = solved(begun(unknowns.poses, seen, owner[kept]), motions, seen, owner[kept], config)
    return unknowns
