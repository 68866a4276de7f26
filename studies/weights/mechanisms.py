"""The mechanisms of `slam/` and `explore/`, and the edits of their source that turn each one off."""

import hashlib
from dataclasses import dataclass
from typing import NamedTuple

from chainslam.experiments.usage import UsageError


class Edit(NamedTuple):
    """A piece of source that occurs exactly once in a module, and what takes its place."""

    module: str
    """Below the package `chainslam`, such as `slam.map.merging`."""
    piece: str
    instead: str

    @property
    def path(self) -> str:
        """Return the file of the module, below the root of the repository."""
        return self.module.replace(".", "/") + ".py"

    def applied(self, source: str) -> str:
        """Return the module's source with the edit; raises UsageError unless the piece is there exactly once."""
        if (times := source.count(self.piece)) != 1:
            found = f"found {times} times {self.piece!r}"
            raise UsageError(f"expected once in {self.path}, {found}: correct the mechanism, or drop it")
        return source.replace(self.piece, self.instead)


@dataclass(frozen=True)
class Mechanism:
    """Something that the program does beyond the bare algorithm, and how to turn it off."""

    name: str
    what: str
    """What it does, in plain words."""
    edits: tuple[Edit, ...] = ()

    @property
    def digest(self) -> str:
        """A short name of the edits: rows made by other edits are not of this mechanism."""
        return hashlib.sha256(repr(self.edits).encode()).hexdigest()[:8]


def _off(name: str, what: str, *edits: tuple[str, str, str]) -> Mechanism:
    return Mechanism(name, what, tuple(Edit(*edit) for edit in edits))


BASELINE = Mechanism("", "everything on")

MATCHING = "slam.association.kernels.matching_kernels"
REST = "slam.association.kernels.rest_kernels"
HYPOTHESES = "slam.association.kernels.hypothesis_kernels"
CANDIDATES = "slam.association.kernels.candidate_kernels"

ASSOCIATION = (
    _off("joint matching", "segments are matched together by joint hypotheses, not each to its nearest wall",
         (MATCHING, "    if clear_only:\n", "    if False:\n")),
    _off("rivals", "a segment that a second wall fits nearly as well does not correct the pose",
         (MATCHING, "clear = pairs[margins >= limits.level]", "clear = pairs"),
         (REST, "rivals = differ and d2[c] < d2[best] + clear", "rivals = False")),
    _off("joint compatibility", "matches that are unlikely given all the others are dropped",
         (MATCHING, "return rows[compatible(clear, e, S, limits.level, together)]", "return rows[clear]"),
         (HYPOTHESES, "wrong = losses[worst] > unmatched", "wrong = False")),
    _off("overlap after correction", "a match must overlap its wall also at the pose to which all matches lead",
         (MATCHING, "chosen = still_overlapping(chosen, found, seen, known, limits)", "chosen = chosen")),
    _off("near a wall", "an unmatched segment that nearly fits a wall, or lies along one, starts no new wall",
         (MATCHING, "doubtful = near_a_wall(found, seen, limits)", "doubtful = np.zeros(len(seen.lines), np.bool_)")),
    _off("halfway linearisation", "observations are linearised halfway to the heading that they lead to",
         ("slam.estimation.kernels", "H_pose[k, 1, 2] += less\n        H_line[k, 1, 0] -= less", "pass")),
    _off("recovery", "a motion that the odometry did not report is found, and a lost robot relocalised",
         ("slam.config", "RecoveryConfig | None = field(default_factory=RecoveryConfig)",
          "RecoveryConfig | None = None")),
    _off("wheel noise", "the noise of wheels that slip more than stated is scaled up",
         ("slam.association.recovery", "MotionNoiseConfig | None = field(default_factory=MotionNoiseConfig)",
          "MotionNoiseConfig | None = None")),
)  # fmt: skip

EXTENTS = "slam.map.kernels.extent_kernels"

MAP = (
    _off("lack of fit of walls", "a wall of which all scans together show a step or a turn is stated less certain",
         ("slam.map.kernels.profile_kernels", "found[k] = 4.0 * (", "found[k] = 0.0 * (")),
    _off("lack of fit in observations", "and so are the segments that are matched to it",
         ("slam.mapper", "cov + self._keeper.landmarks.lack_of_fit(seen, matches.pairs[:, 1])", "cov")),
    _off("ends at bends", "two walls that reach past the place where their lines cross at a slight bend end there",
         ("slam.map_keeper", "self._merged(owners, self._ended_at_bends(float(scan.range_max_m)))",
          "self._merged(owners, self.map())")),
    _off("lack of fit of segments", "a segment that is off its line by its own residuals is stated less certain",
         ("slam.extraction.straightness_kernels",
          "found[k] = 4.0 * (chi2[k] - dof) * of_a_beam(cov[k], beam_counts[k]) / beam_counts[k]", "found[k] = 0.0")),
    _off("covariance of short faces", "short faces are stated less certain, since they may lie across corners",
         ("slam.extraction.straightness_kernels", "return (edge_m / (1.0 + (length_m / face_m) ** 4)) ** 2",
          "return 0.0")),
    _off("heading by few beams", "segments of few beams do not correct the heading beside longer ones",
         ("slam.map.kernels.reliability_kernels", "turn = heading_rad if is_tentative[k] else 0.0", "turn = 0.0")),
    _off("existence", "walls are tentative at first, and removed where scans that should show them do not",
         ("slam.map.extents", '"log_odds"] <= self._believed', '"log_odds"] < -np.inf'),
         ("slam.map.extents", '[(log_odds < 0.0) |', '[(log_odds < -np.inf) |')),
    _off("one look a place", "all scans from one place count once for and against a wall",
         ("slam.map.kernels.existence_kernels", "places[n, 1]) < odds.apart_m:", "places[n, 1]) < 0.0:")),
    _off("candidates", "lines of few beams become walls once they were seen from several places",
         ("slam.map_keeper",
          "believed, odds = self._candidates.see(self.backend.belief.pose_world, scan, segments, few)",
          "believed, odds = np.zeros(0, dtype=np.int64), np.zeros(0)")),
    _off("merging", "two landmarks of one wall are merged",
         ("slam.config", "MergingConfig | None = field(default_factory=MergingConfig)",
          "MergingConfig | None = None")),
    _off("merging of hidden walls", "of two walls within a centimetre one goes, however sure the filter is of both",
         ("slam.map.merging", "(is_hidden or same_line(two, one_wall))", "same_line(two, one_wall)")),
    _off("cutting back", "walls are cut back where beams pass through them",
         (EXTENTS, "if against[row] >= twice:", "if against[row] < 0:")),
    _off("sharper corners", "an end moves back to a corner that is seen more sharply",
         (EXTENTS, " or (sharper and -beyond < spacing[row, side])", "")),
    _off("ends that follow", "the ends of walls move along when a loop closure moves the map",
         ("slam.map.extents", "if not len(tell) or np.abs(moved_m).max() <= shared.resolution_m:", "if True:")),
    _off("wider joins", "two ends that were looked at in vain are joined over a wider gap",
         ("slam.map.chains", "if not set_aside:", "if True:")),
)  # fmt: skip

EXTRACTION = (
    _off("sure gap", "a segment ends where its beams stand so far apart that a door could hide between them",
         ("slam.extraction.kernels.extent_kernels", "is_cut = clipped != along[end]", "is_cut = False")),
    _off("joints", "the boundary of two segments moves to where their lines cross",
         ("slam.extraction.kernels.joint_kernels", "if cut < pieces[k, 1] or cut > begins:", "if cut < -1:")),
    _off("beams in doubt", "a beam at a corner that either line explains counts for neither",
         ("slam.extraction.kernels.joint_kernels",
          "return off * off < rules.doubt_sigmas**2 * (returns.sigmas_m[at] ** 2 + variance)",
          "return variance < 0.0")),
    _off("outliers", "beams far off the line leave the fit",
         ("slam.extraction.kernels.fit_kernels", "if not off * off <= gate * gate * spread:", "if spread < 0.0:")),
)  # fmt: skip

DRIVING = "explore.following.driving"
MOTIONS = "explore.following.motion_kernels"
END = "explore.following.end_errand"
EXPLORER = "explore.goals.explorer"

EXPLORATION = (
    _off("first turns", "the robot turns on the spot before it drives",
         ("explore.goals.explorer_config", "first_turns: Number = 4", "first_turns: Number = 0")),
    _off("returns of five scans", "the robot keeps clear of what five scans hit, at the mean of their distances",
         ("explore.floor.accumulated_returns",
          "points_robot[near] *= (mean / np.maximum(rho, 1e-9))[:, None]", "pass"),
         ("explore.floor.accumulated_returns", "recent_robot[~same.any(axis=0)]", "recent_robot[:0]")),
    _off("careful steps", "a step onto floor that was not seen yet is short",
         (DRIVING, "if abs(command.forward_m) > config.careful_m:", "if False:")),
    _off("short steps in tight places", "a short step may leave less clearance than a long one",
         (MOTIONS, "(min(max(now_m / motions.clear_m[a], EXCUSED), 1.0) if is_short else 1.0)", "1.0")),
    _off("kept plan", "planned steps are driven to the end while they are safe, not planned anew each time",
         (MOTIONS, "if len(plan) < 2 or not math.isfinite(cost_m):", "if True:")),
    _off("narrow steps", "a step with little room beside the body costs more",
         (MOTIONS, "return 1.0 + NARROW * (1.0 - room_m / motions.wide_m) ** 2", "return 1.0")),
    _off("outward field", "the distance to the goal is continued a few cells into floor where the body has no room",
         ("explore.planning.paths", "OUTWARDS_CELLS, OUTWARDS_COST = 3, 8.0",
          "OUTWARDS_CELLS, OUTWARDS_COST = 0, 8.0")),
    _off("walls in sight", "a path costs more where no wall is near enough to correct the pose",
         ("explore.planning.passable", "blind_cost: Weight = 4.0", "blind_cost: Weight = 0.0")),
    _off("ways out", "the robot may leave a place that is too near to a wall",
         ("explore.planning.paths", "(self._clearance[box] >= self._clearance[r, c])", "False")),
    _off("single missing returns", "a single beam without a return shows neither free floor nor a way through a wall",
         ("slam.robot.messages", "shown = np.where(lone, np.minimum(before, after), free)", "shown = free"),
         ("slam.robot.messages", "(self.ranges_m == np.inf) & (before == np.inf) & (after == np.inf)",
          "self.ranges_m == np.inf")),
    _off("two scans a view", "an end is viewed by two scans half a step of turn apart",
         (END, "super()._arrived()\n        return True", "super()._arrived()\n        return False")),
    _off("moved ends", "an end whose estimate has moved is viewed afresh",
         (END, "if np.hypot(*(end.position_world - self.end.position_world)) > self._config.moved_m:", "if False:")),
    _off("other viewpoints", "an end is viewed from elsewhere where no ideal viewpoint can be reached",
         (END, "farther = LOOKS[self._stage] in BEYOND", "farther = False"),
         (END, "        if self.looks_done:\n            return False", "        return False")),
    _off("round things", "ends on a curved obstacle are given up without a view",
         (EXPLORER, "elif looks and is_round(end, around.walls, self._config.round_things):", "elif False:")),
    _off("patience", "a place is given up after the steps of a way of 60 m",
         (EXPLORER, "return steps <= self._patience_steps", "return True")),
    _off("sweep", "after the last open end the robot visits unseen floor and obstacles that are no wall of the map",
         ("explore.goals.explorer_config", "sweep: bool = True", "sweep: bool = False")),
)  # fmt: skip

MECHANISMS = (*ASSOCIATION, *MAP, *EXTRACTION, *EXPLORATION)
