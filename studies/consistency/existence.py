"""What `ExistenceConfig` holds, by true faces: how many segments lie over two faces, and which lines looks show.

Bundled worlds and real plans are explored with noise. A segment is of one face where 80 % of its beams came from one
wall; otherwise it lies over two faces. A wall of the map is what its first segment was. A look at it is a scan of which
beams enough reach it, from a place of its own, as the mapper counts them. Lines of few beams that no wall explains are
looked at, too, and shown where a segment may be the same line.

.venv/bin/python -m studies.consistency.existence --plans ../shared/data/plans --every 8
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.scoring.beam_votes import vote
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.experiments.usage import UsageError
from chainslam.explore.step import Step
from chainslam.sim.worlds import WORLDS
from chainslam.slam.association.matching import MatchingConfig
from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.map.existence import JUST_BEGUN, ExistenceConfig
from chainslam.slam.map.kernels.few_beams_kernels import Same, distances, lines_of
from chainslam.slam.map.kernels.ray_evidence import ray_evidence

from ..runner.command import run_study
from .extraction import PLANS

SURE_BEAMS = ExtractionConfig().sure_beams
ODDS = ExistenceConfig().odds(SURE_BEAMS)
FEW_ODDS = ExistenceConfig().few_odds(ExtractionConfig().least_beams)
SAME = Same(
    gate_level(MatchingConfig().gate, 2), float(np.cos(MatchingConfig().angle_rad)), float(ExistenceConfig().slack_m)
)
Kind = tuple[bool, bool]
"""Whether a segment has few beams, and whether it lies over two faces."""


@dataclass(frozen=True)
class ExistenceStudy:
    """What is explored."""

    plans: Path = PLANS
    """Folder of plan files."""
    pattern: str = "lifull_*.json"
    """Which files of the folder."""
    every: int = 8
    """Every so many plans by name; the bundled worlds are explored as well."""
    backend: str = "invariant-ekf"
    """The estimator."""
    seed: int = 1
    """Of the noise."""
    max_steps: int = 3000
    """A run stops here."""

    def run(self) -> None:
        """Explore, and print the table; raises UsageError for a folder without plans."""
        counts: Counter[tuple[str, *Kind]] = Counter()
        for world in self._worlds():
            counts.update(counted(TrialConfig(world, self.backend, seed=self.seed, max_steps=self.max_steps)))
        plain_console(width=120).print(table(counts))

    def _worlds(self) -> Iterator[str]:
        plans = sorted(self.plans.glob(self.pattern))[:: self.every]
        if not plans:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.pattern}")
        yield from (*WORLDS, *map(str, plans))


def counted(config: TrialConfig) -> "Counter[tuple[str, *Kind]]":
    """Return the counts of one run."""
    scenario = build(config)
    walls = truth_of(scenario.world, config.robot).walls
    looks = Looks(walls, lambda index: scenario.robot.record.faces_of_beams[index])
    run_scenario(scenario, looks, default_mission)
    return looks.counts


@dataclass
class Looks:
    """Counts segments and looks while a run goes on, by what it is of which there are so many, and the kind."""

    walls_of_faces: Int[np.ndarray, " f"]
    """The true wall of each true face."""
    faces_of_beams: Callable[[int], Int[np.ndarray, " k"]]
    """Returns the true face of each beam of a scan."""
    counts: "Counter[tuple[str, *Kind]]" = field(default_factory=Counter)
    _kinds: dict[int, Kind] = field(default_factory=dict)
    """By the ids of walls, what their first segments were."""
    _places: dict[int, np.ndarray] = field(default_factory=dict)
    """From where they were looked at last."""
    _lines: list[tuple[np.ndarray, np.ndarray, bool]] = field(default_factory=list)
    """Lines of few beams not looked at yet, from where they were seen, and whether they lie over two faces."""

    def __call__(self, step: Step) -> None:
        """Take note of one step."""
        self._look(step)
        self._look_at_lines(step)
        faces, fresh = self.faces_of_beams(step.index), set(step.matches.unmatched) - set(step.matches.doubtful)
        for row, (span, owner) in enumerate(zip(step.segments.beams.tolist(), step.walls_of_segments, strict=True)):
            kind = bool(step.segments.is_tentative[row]), not vote(span, faces, self.walls_of_faces).is_clear
            self.counts["segments", *kind] += 1
            self.counts["fresh", *kind] += row in fresh
            if row in fresh and owner >= 0 and owner not in self._kinds:
                self._kinds[int(owner)], self._places[int(owner)] = kind, JUST_BEGUN
            elif row in fresh and kind[0]:
                self._lines.append((seen_lines(step)[row], step.map.belief.pose_world[:2].copy(), kind[1]))

    def _look(self, step: Step) -> None:
        beams, ids = reaching(step), step.map.ids.tolist()
        at, seen, ambiguous = step.map.belief.pose_world[:2], set(step.walls_of_segments), set(step.matches.ambiguous)
        for wall, count in zip(ids, beams.tolist(), strict=True):
            counts = wall in seen or (count >= ODDS.beams and wall not in ambiguous)
            if wall not in self._kinds or not counts or np.hypot(*(at - self._places[wall])) < ODDS.apart_m:
                continue
            first, self._places[wall] = np.isnan(self._places[wall]).any(), at.copy()
            if count >= ODDS.beams:
                for name in ("looks", "first looks") if first else ("looks",):
                    self.counts[name, *self._kinds[wall]] += 1
                    self.counts[f"{name} that show", *self._kinds[wall]] += wall in seen

    def _look_at_lines(self, step: Step) -> None:
        """Count the first look at each line of few beams."""
        if not self._lines:
            return
        lines, at = np.array([line for line, _, _ in self._lines]), step.map.belief.pose_world[:2]
        ends = lines[:, 5:] * [-1.0, 1.0]
        beams = crossed(step, lines[:, 1:3].copy(), np.column_stack([lines[:, 0], np.zeros(len(lines))]), ends)
        shown = np.isfinite(distances(seen_lines(step), lines, SAME)).any(axis=0)
        apart = np.array([np.hypot(*(at - place)) >= FEW_ODDS.apart_m for _, place, _ in self._lines])
        looked = (beams >= FEW_ODDS.beams) & apart
        for row in np.flatnonzero(looked).tolist():
            kind = True, self._lines[row][2]
            self.counts["line looks", *kind] += 1
            self.counts["line looks that show", *kind] += int(shown[row])
        self._lines = [line for line, done in zip(self._lines, looked.tolist(), strict=True) if not done]


def seen_lines(step: Step) -> Float[np.ndarray, "s 6"]:
    """Return the segments of a step as lines of the world."""
    return lines_of(step.map.belief.pose_world, step.segments.lines, step.segments.cov, step.segments.ends)


def reaching(step: Step) -> Int[np.ndarray, " n"]:
    """Return how many beams of a step's scan reach each wall of the map."""
    return crossed(step, step.map.belief.anchors, step.map.belief.means, step.map.extents)


def crossed(
    step: Step,
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    extents: Float[np.ndarray, "n 2"],
) -> Int[np.ndarray, " n"]:
    """Return how many beams of a step's scan reach lines, world frame."""
    scan, pose_world = step.scan, step.map.belief.pose_world
    return ray_evidence(scan, pose_world, anchors, means).reaching(extents, ODDS.margin_m)


def table(counts: "Counter[tuple[str, *Kind]]") -> Table:
    """Return how many segments lie over two faces, and how many looks show each kind of wall."""
    shown = Table("what", "of one face", "over two faces", "share", title="By true faces", title_justify="left")
    for few, beams in ((False, f"{SURE_BEAMS} beams or more"), (True, f"fewer than {SURE_BEAMS} beams")):
        for name, title in (("segments", "segments of"), ("fresh", "segments that no wall explains, of")):
            one, two = (counts[name, few, over] for over in (False, True))
            shown.add_row(f"{title} {beams}", str(one), str(two), _share(two, one + two))
    for few, beams in ((False, f"{SURE_BEAMS} beams or more"), (True, f"fewer than {SURE_BEAMS} beams")):
        for name in ("first looks", "looks"):
            told = [f"{_share(counts[f'{name} that show', few, over], counts[name, few, over])} of "
                    f"{counts[name, few, over]}" for over in (False, True)]  # fmt: skip
            shown.add_row(f"{name} that show a wall begun by {beams}", *told, "")
    told = [f"{_share(counts['line looks that show', True, over], counts['line looks', True, over])} of "
            f"{counts['line looks', True, over]}" for over in (False, True)]  # fmt: skip
    shown.add_row("first looks that show a line of few beams", *told, "")
    return shown


def _share(some: int, of: int) -> str:
    return f"{some / of:.3f}" if of else "none"


if __name__ == "__main__":
    run_study(ExistenceStudy)
