"""Scores of a drive without ground truth: from the map itself, and null for all others."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from jaxtyping import Int

from chainslam.explore.step import Step
from chainslam.sim.robot import TrueRecord
from chainslam.sim.worlds import Contour, World

from ...scenario import Scenario
from ..association import Votes
from ..innovations import innovation_scores
from ..maps.swept import SOON
from ..records import Log
from ..summary import Ending, range_scores, run_keys, spread_ms
from ..truth import Truth
from .doubles import doubles

WITNESSED = (
    "path_length_true_m coverage coverage_own_frame coverage_curve contours_closed contours_reachable swept"
    " pose_rmse_m heading_rmse_rad odometry_rmse_m odometry_max_m odometry_end_m pose_anees pose_nees_in_band map_anees"
    " pose_anees_from_start map_anees_straight map_frame_anees map_frame_m map_frame_rad lines_unlabelled false_matches"
    " false_matches_few_beams false_merges collisions map_began_step return_to_start"
)
"""The keys of summary.json that need the truth."""


def unseen_world(name: str) -> World:
    """Return a world for a recorded drive: a name without a drawing."""
    return World(name, shapely.Polygon(), np.zeros(3), {})


def no_truth(world: World) -> Truth:
    """Return the truth about an unknown building: no faces."""
    none, rows = np.zeros((0, 2, 2)), np.zeros(0, dtype=np.int64)
    return Truth(world, none, np.zeros((0, 2)), rows, rows, Contour(rows, np.zeros((0, 2)), none, rows))


@dataclass
class NoVotes(Votes):
    """Counts merges; without the truth, beams have no walls."""

    def add(self, *_: Any, **__: Any) -> None:
        """Count nothing."""

    def merge(self, keep: int, drop: int) -> None:
        """Count a merge."""
        self.merges += 1

    def faces_of(self, ids: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return -1 for each line."""
        return np.full(len(ids), -1, dtype=np.int64)

    def walls_of(self, ids: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return -1 for each line."""
        return self.faces_of(ids)


class UnwitnessedRecord(TrueRecord):
    """The record of a drive without ground truth: NaN poses, and no face for any beam."""

    def sensed(self, beams: int) -> None:
        """Record that a scan was taken."""
        self.poses_world.append(np.full(3, np.nan))
        self.faces_of_beams.append(np.full(beams, -1, dtype=np.int64))


def summarise_unwitnessed(scenario: Scenario, log: Log, votes: Votes, step: Step, ending: Ending) -> dict[str, Any]:
    """Return every key of summary.json; null for those that need the truth."""
    walls = step.map
    established = ~walls.tentative
    closed = int(log.closed_chains[-1])
    return {
        **run_keys(scenario, ending),
        "steps": len(log),
        "path_length_m": float(log.path_length_m[-1]),
        "drive_time_s": float(log.time_s[-1]),
        "open_ends": int(log.open_ends[-1]),
        "set_aside": [],
        "lines": len(walls),
        "lines_tentative": int(np.count_nonzero(~established)),
        "lines_crooked": int(np.count_nonzero(walls.crooked)),
        "chains_closed": closed,
        "chains_open": len(step.chains) - closed,
        "duplicate_lines": len(doubles(walls.ends_world[established])),
        "merges": votes.merges,
        "distances": {},
        **dict.fromkeys((*WITNESSED.split(), *SOON)),
        **innovation_scores(log),
        **range_scores(step, log),
        "step_ms": spread_ms(log.seconds),
        "planning_ms": spread_ms(log.planning_seconds),
    }
