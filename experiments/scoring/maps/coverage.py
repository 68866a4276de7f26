"""How much of the reachable contour the map covers, and which true contours it has closed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.geometry.segment_kernels import lie_beside
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from ..association import Votes
from ..records import Sketch
from ..trajectories import alignment_of_paths
from ..truth import Truth

NEAR_M, NEAR_NOISY_M = 0.1, 0.3
"""A point of the contour is covered by a wall this near; the second is for runs with noise, after alignment."""
PITCH_M = 0.02
CLOSED_SHARE = 0.9
"""A closed chain represents a true contour if it covers this share of the contour's reachable length."""


@dataclass(frozen=True)
class Samples:
    """Points of the reachable contour, each representing a piece of it."""

    points_world: Float[np.ndarray, "p 2"]
    normals_world: Float[np.ndarray, "p 2"]
    """Into the wall."""
    length_m: Float[np.ndarray, " p"]
    rings: Int[np.ndarray, " p"]


def sample(truth: Truth, pitch_m: float = PITCH_M) -> Samples:
    """Return the reachable contour as points at most so far apart, m; within the fence, where there is one."""
    pieces = truth.contour.segments
    along = pieces[:, 1] - pieces[:, 0]
    lengths = np.hypot(along[:, 0], along[:, 1])
    counts = np.maximum(np.ceil(lengths / pitch_m).astype(int), 1)
    piece = np.repeat(np.arange(len(pieces)), counts)
    share = (np.arange(len(piece)) - (np.cumsum(counts) - counts)[piece] + 0.5) / counts[piece]
    points, fence = pieces[piece, 0] + share[:, None] * along[piece], truth.world.fence
    within = np.ones(len(points), dtype=bool) if fence is None else shapely.contains_xy(fence, *points.T)
    return Samples(
        points[within],
        normals(truth.lines[truth.contour.face[piece], 0])[within],
        (lengths / counts)[piece][within],
        truth.rings[truth.contour.face[piece]][within],
    )


def alignment(estimated_world: Float[np.ndarray, "3"], true_world: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return the motion that carries the estimate's frame to the true one, from the initial poses of both."""
    return compose(true_world, inverse(estimated_world))


def began(lines: Int[np.ndarray, " s"]) -> int:
    """Return the step at which the map began, by its number of lines: 0 unless no wall was in sight at first."""
    return min(int(np.max(np.flatnonzero(lines == 0), initial=-1)) + 1, len(lines) - 1)


def own_alignment(
    start_estimate: Float[np.ndarray, "3"],
    estimated_world: Float[np.ndarray, "s 3"],
    true_world: Float[np.ndarray, "s 3"],
    step: int,
) -> Float[np.ndarray, "3"]:
    """Return the motion that carries the map to the truth: by the path since the step where it began, if not the first.

    What the robot lost before its first wall no scan can tell; it moves the map as a whole, also later on, since a
    filter that does not know its heading to some degrees is turned by small innovations.
    """
    if not step:
        return alignment(start_estimate, true_world[0])
    return alignment_of_paths(*(_with_headings(path[step:]) for path in (estimated_world, true_world)))


def _with_headings(poses_world: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "r 3"]:
    """Return poses and a point one metre ahead of each, since a robot that stands still has a heading too."""
    ahead = np.column_stack([poses_world[:, :2] + normals(poses_world[:, 2]), poses_world[:, 2]])
    return np.concatenate([poses_world, ahead])


def covered(samples: Samples, walls_world: Float[np.ndarray, "m 2 2"], near_m: float) -> Bool[np.ndarray, " p"]:
    """Return which points lie within `near_m` of a wall whose normal agrees within 45 degrees."""
    mapped = normals(through(walls_world)[:, 0])
    return lie_beside(samples.points_world, samples.normals_world, walls_world, mapped, near_m, np.cos(np.pi / 4))


def coverage(samples: Samples, walls_world: Float[np.ndarray, "m 2 2"], near_m: float) -> float:
    """Return the covered share of the reachable contour, by length."""
    share = samples.length_m[covered(samples, walls_world, near_m)].sum() / samples.length_m.sum()
    return float(share)


def coverage_curve(
    samples: Samples, sketches: Sequence[Sketch], to_true: Float[np.ndarray, "3"], near_m: float
) -> dict[str, list[float]]:
    """Return the covered share of the contour and the path length, each as a list."""
    return {
        "path_length_m": [sketch.path_length_m for sketch in sketches],
        "coverage": [coverage(samples, to_world(sketch.ends_world, to_true), near_m) for sketch in sketches],
    }


def closed_contours(
    samples: Samples, walls: StochasticMap, chains: tuple[Chain, ...], votes: Votes, to_true: Float[np.ndarray, "3"],
    near_m: float,
) -> list[int]:  # fmt: skip
    """Return the reachable true contours that a closed chain stands for.

    A chain belongs to the contour from which most of its beams came; it stands for it if its walls cover nine
    tenths of the contour's reachable length, so that a chain closed by mistake across a door does not count.
    """
    reachable = set(votes.truth.contour.rings.tolist())
    found: set[int] = set()
    for chain in chains:
        beams = [votes.beams[wall] for wall in chain.walls if wall in votes.beams]
        if not chain.is_closed or not beams:
            continue
        ring = int(np.bincount(votes.truth.rings, weights=np.sum(beams, axis=0)).argmax())
        mine = samples.rings == ring
        ends = to_world(walls.ends_world[walls.belief.rows(chain.walls)], to_true)
        length = samples.length_m[mine & covered(samples, ends, near_m)].sum()
        if ring in reachable and length >= CLOSED_SHARE * samples.length_m[mine].sum():
            found.add(ring)
    return sorted(found)
