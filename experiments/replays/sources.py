"""What `replay` takes: a simulated run's own log with its truth, or a real robot's log without."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.sim.worlds import World

from ..artifacts.results import REPLAY, config_record
from ..scoring.summary import odometry_poses
from ..trial import TrialResult
from .real_log import RealRun, looked_over, mapped_real, replay_real, replayed_real
from .replay import RecordedRun, ReplayOptions, replay, replayed

RECORDED = "recorded"
"""Among the options of a replay in `config.json`: how a real robot's log was taken."""


def was_real(said: Any) -> bool:
    """Return whether the options of a replay in `config.json` are those of a real robot's log."""
    return isinstance(said, dict) and isinstance(said.get(RECORDED), dict)


@dataclass(frozen=True)
class OwnLog:
    """A simulated run's log."""

    run: RecordedRun
    options: ReplayOptions
    world: World

    @property
    def title(self) -> str:
        """World, seed and whose matches."""
        return f"{self.world.name}, seed {self.run.trial.seed}, replayed with {self.options.association} association"

    @property
    def scans(self) -> int:
        """All that the log holds."""
        return len(self.run.recording)

    def config(self, backend: str) -> dict[str, Any]:
        """Return the settings of the run, and the options of the replay."""
        return config_record(replayed(self.run, backend)) | {REPLAY: asdict(self.options)}

    def go(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Replay it."""
        return replay(self.run, backend, self.options, watch, self.world)

    @property
    def odometry(self) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s 3"]]:
        """Return the times of the scans, and where the odometry puts the robot at each."""
        recording = self.run.recording
        return recording.time_s, odometry_poses(self.run.true_poses_world[0], recording.odometry)

    def true_pose(self, step: Step) -> Float[np.ndarray, "3"]:
        """Return where the robot was at a step."""
        return np.asarray(self.run.true_poses_world[step.index])


@dataclass(frozen=True)
class RealLog:
    """A real robot's log."""

    run: RealRun

    @property
    def title(self) -> str:
        """The log's name."""
        return self.run.name

    @property
    def scans(self) -> int:
        """Its keyframes."""
        return len(self.run.log.recording)

    def config(self, backend: str) -> dict[str, Any]:
        """Return the settings of the mapper, and how the log was taken."""
        said = {name: value for name, value in asdict(self.run.options).items() if value is not None}
        return config_record(replayed_real(self.run, backend)) | {REPLAY: {RECORDED: said}}

    def go(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Map it, and look at it again."""
        return replay_real(self.run, backend, watch)

    def mapped(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Map it."""
        return mapped_real(self.run, backend, watch)

    def looked_over(self, result: TrialResult) -> TrialResult:
        """Look again at what was mapped."""
        return looked_over(self.run, result)

    @property
    def odometry(self) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s 3"]]:
        """Return the times of the scans, and where the odometry puts the robot at each."""
        return self.run.log.scan_time_s, self.run.log.poses_of_scans(self.run.wheels_alone)

    def wheels_pose(self, step: Step) -> Float[np.ndarray, "3"]:
        """Return where wheel odometry puts the robot at a step."""
        return np.asarray(self.run.wheels_alone[step.index])
