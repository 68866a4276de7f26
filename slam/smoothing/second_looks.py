"""Second looks at a whole drive: all segments are associated anew at the poses as they are, and all solved together.

A filter decides once, when a segment is seen, which wall it is of. Here every such decision is made again, from poses
that all scans agree on, as often as there are rounds.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..extraction.segments import Segments
from .config import SecondLooksConfig
from .landmarks import Sightings, associated, firm, joined
from .solve import begun, solved

DEFAULTS = SecondLooksConfig()


def second_looks(
    poses_world: Float[np.ndarray, "s 3"],
    motions: Float[np.ndarray, "t 3"],
    segments: Sequence[Segments],
    config: SecondLooksConfig = DEFAULTS,
) -> Float[np.ndarray, "s 3"]:
    """Return the poses that agree best with all motions between scans and the segments of all scans.

    `motions` lead from each pose to the next (robot frame, m m rad), one less than poses; `segments` are those of each
    scan. The first pose stays where it is.
    """
    sightings = joined([firm(k, each, config) for k, each in enumerate(segments)])
    poses = poses_world
    for gate_m in config.gates_m:
        owner = associated(sightings, poses, gate_m, config)
        kept = owner >= 0
        seen = Sightings(*(getattr(sightings, name)[kept] for name in Sightings.__dataclass_fields__))
        poses = solved(begun(poses, seen, owner[kept]), motions, seen, owner[kept], config).poses
    return poses
