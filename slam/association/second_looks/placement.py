"""Where a map lies in a saved one of the same building, if the robot was lost when it began.

Stretches of the drive propose places: the walls around each are laid on all walls of the saved map. The whole drive
decides, since a corridor fits many others: its beams end on the walls of the saved map at the right place, and pass
through them at a wrong one. There the walls that both maps have tell the place, with its covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import chi2

from ...geometry.poses import compose, inverse, to_robot, to_world
from ...odometry.field_kernels import LikelihoodField, field_of
from ...odometry.search_kernels import refine
from ..place_search import PlaceSearchConfig, along, apart, places_anywhere
from .agreement import Agreement, Walls, about, agreed
from .refuted import Rays, voted
from .solve import Unknowns

SEARCH = PlaceSearchConfig(cell_m=0.2, step_rad=float(np.deg2rad(2.0)), least=0.5, rival=0.8)
"""How places are proposed: coarsely, and with those that fit less well."""
FINE = PlaceSearchConfig()
"""How finely a place is known before walls are paired, and how far apart places are."""
STRETCHES, NEAR_M, PROPOSED = 16, 6.0, 8
"""So many stretches of a drive propose places, each by the walls as near as this, and each so many."""
FEWEST = 20
"""Fewer points propose nothing."""
ASKED = 200
"""So many scans, spread over the drive, are asked about a place."""
MARGIN_M = 0.25
"""Beams that end so near a wall end on it: both maps are bent."""
SETTLED = 5
"""So many proposals are looked at closely, those first for which scans speak most."""
SHARE = 0.75
"""Of the walls that scans tell anything of, a right place has this share of the length for it ..."""
EXPLAINED = 1.0 / 3.0
"""... and that is so large a part of the walls of either map, by length."""
JOINTLY = 0.999
"""Walls that both maps have fit together if their squared error is below this quantile of chi-square."""
RIVAL = 0.7
"""Another place is possible where so much speaks for it, as a share of what speaks for the best."""


@dataclass(frozen=True)
class Placement(Agreement):
    """A place of a map in a saved one, and what speaks for it."""

    pro_m: float = 0.0
    """Length of the saved walls that scans of the drive see there ..."""
    contra_m: float = 0.0
    """... and of those that they see through."""

    @property
    def net_m(self) -> float:
        """How much more speaks for it than against it."""
        return self.pro_m - self.contra_m

    def holds(self, length_m: float) -> bool:
        """Return whether it explains enough of a map of that length, contradicts little, and the walls fit together."""
        if self.pairs < 2 or self.pro_m < max(SHARE * (self.pro_m + self.contra_m), EXPLAINED * length_m):
            return False
        return self.chi2 < float(chi2.ppf(JOINTLY, 2 * self.pairs - 3))


def placements(saved: Walls, own: Walls, poses: Float[np.ndarray, "s 3"], rays: Rays) -> list[Placement]:
    """Return where a map may lie in a saved one, the likeliest place first; several where nothing decides between them.

    `poses` and `rays` are those of the drive that the map is of, in its frame.
    """
    if not len(saved) or not len(own):
        return []
    asked = np.unique(np.linspace(0, len(poses) - 1, ASKED).astype(np.int64))
    witnesses = poses[asked], Rays([rays.scans[k] for k in asked], rays.scanner)
    middles, proposed = _proposed(saved, own, poses)
    rated = [_rated(saved, Placement(each, FINE.cov), *witnesses) for each in proposed]
    order = np.argsort([-each.net_m for each in rated], kind="stable")
    first = _distinct([(rated[k], middles[k]) for k in order], SETTLED)
    field = _field(saved)
    settled = [_rated(saved, _settled(saved, own, each.place, at, field), *witnesses) for each, at in first]
    likely, middle = possible(settled, min(saved.lengths.sum(), own.lengths.sum())), poses[len(poses) // 2]
    return [each for each, _ in _distinct([(each, middle) for each in likely], SETTLED)]


def possible(rated: Sequence[Placement], length_m: float) -> list[Placement]:
    """Return the placements that hold for a map of that length, the likeliest first, and nearly as likely ones."""
    holding = sorted((each for each in rated if each.holds(length_m)), key=lambda each: -each.net_m)
    return [each for each in holding if each.net_m >= RIVAL * holding[0].net_m]


def _distinct(
    rated: Sequence[tuple[Placement, Float[np.ndarray, "3"]]], most: int
) -> list[tuple[Placement, Float[np.ndarray, "3"]]]:
    """Return the first placements that are apart from those before them, each as seen at a pose of the drive."""
    found: list[tuple[Placement, np.ndarray]] = []
    for each, at in rated:
        if len(found) == most:
            break
        others = [compose(other.place, at) for other, _ in found]
        if all(apart(compose(each.place, at)[None], other, FINE)[0] for other in others):
            found.append((each, at))
    return found


def _proposed(
    saved: Walls, own: Walls, poses: Float[np.ndarray, "s 3"]
) -> tuple[list[Float[np.ndarray, "3"]], list[Float[np.ndarray, "3"]]]:
    """Return the poses of the drive that proposed places, and these places of the map's frame."""
    surface, points = along(saved.ends, 0.5 * SEARCH.cell_m), along(own.ends, SEARCH.cell_m)
    middles, found = list[np.ndarray](), list[np.ndarray]()
    for k in _stretches(poses):
        near = to_robot(points[np.hypot(*(points - poses[k, :2]).T) < NEAR_M], poses[k])
        if len(near) < FEWEST:
            continue
        for place in places_anywhere(surface, near, SEARCH, PROPOSED):
            middles.append(poses[k])
            found.append(compose(place, inverse(poses[k])))
    return middles, found


def _stretches(poses: Float[np.ndarray, "s 3"]) -> Int[np.ndarray, " k"]:
    """Return poses that are evenly spread along a path."""
    ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T)))
    at = (np.arange(STRETCHES) + 0.5) / STRETCHES * ways[-1]
    return np.unique(np.minimum(np.searchsorted(ways, at), len(poses) - 1))


def _rated(saved: Walls, placement: Placement, poses: Float[np.ndarray, "s 3"], rays: Rays) -> Placement:
    """Return a placement with what scans say of the saved walls there."""
    back = inverse(placement.place)
    lines = saved.lines + np.array([back[2], 0.0])
    pro, contra = voted(Unknowns(poses, lines, to_world(saved.anchors, back)), saved.extents, rays, MARGIN_M)
    told = pro + contra > 1  # a single scan may see anything
    pro_m, contra_m = (float(saved.lengths[told & which].sum()) for which in (pro > contra, pro <= contra))
    return replace(placement, pro_m=pro_m, contra_m=contra_m)


def _field(saved: Walls) -> LikelihoodField:
    points = along(saved.ends, 0.5 * FINE.cell_m)
    low, high = points.min(axis=0), points.max(axis=0)
    half_m = 0.5 * float((high - low).max()) + 1.0
    return field_of(points, 0.5 * (low + high), half_m, FINE.cell_m, FINE.cell_m, 4)


def _settled(
    saved: Walls,
    own: Walls,
    place: Float[np.ndarray, "3"],
    at: Float[np.ndarray, "3"],
    field: LikelihoodField,
) -> Placement:
    """Return a placement by all walls at once, and then by those that both have; `at` is the pose that found it."""
    points = to_robot(along(own.ends, FINE.cell_m), at)
    pose, _ = refine(field, points, compose(place, at), FINE.step_rad, 0.1 * FINE.cell_m)
    place = compose(pose, inverse(at))
    found = agreed(saved, own, place, about(FINE.cov, place, at[:2]))
    return Placement(**vars(found))
