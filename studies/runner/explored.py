"""One exploration, scored as a campaign scores it, and how often its strategy turned back to known walls."""

from dataclasses import dataclass

import numpy as np

from chainslam.experiments.campaign.comparison.tables import doubles
from chainslam.experiments.campaign.scores.observer import Observer
from chainslam.experiments.campaign.scores.score import record_of
from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.explore.goal import Goal
from chainslam.explore.step import Step
from chainslam.sim.worlds import World
from chainslam.slam.geometry.poses import wrap

from .rows import Row

SCORES = (
    *("status", "reason", "steps", "path_length_m", "coverage", "contours_closed", "contours_reachable", "collisions"),
    *("pose_anees", "map_anees", "pose_rmse_m", "wall_rmse_m", "wall_shape_m", "duplicate_lines", "merges"),
    *("false_merges", "false_matches", "false_matches_few_beams", "matches_true", "matches_missed", "matches_false"),
)


@dataclass
class Returns:
    """Counts the goals that lie beside known walls, whatever step names them."""

    count: int = 0
    _goal: Goal | None = None

    def watch(self, step: Step) -> None:
        """Take note of one step."""
        goal = step.decision.goal
        if goal is not None and goal.kind == "known-walls" and goal is not self._goal:
            self.count += 1
        self._goal = goal


def explored(config: TrialConfig, world: World | None = None) -> Row:
    """Run one trial and return its scores: null for what could not be scored."""
    scenario = build(config, world)
    observer = Observer(
        truth_of(scenario.world, config.robot).walls, lambda index: scenario.robot.record.faces_of_beams[index]
    )
    returns = Returns()

    def watch(step: Step) -> None:
        observer(step)
        returns.watch(step)

    result = run_scenario(scenario, watch, default_mission)
    summary = record_of(result, observer, None).summary
    row = {key: summary.get(key) for key in SCORES} | {"returns": returns.count}
    row |= {"double_entries": doubles(summary, config.mission.mapper.matching.gate)["double_entries"]}
    if result.log is None:
        return row | {"heading_error_deg": None}
    off = np.abs(wrap(result.log.estimated_world[:, 2] - result.log.true_world[:, 2]))
    return row | {"heading_error_deg": float(np.rad2deg(off.max()))}
