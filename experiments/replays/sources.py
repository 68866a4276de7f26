"""The inputs of `replay`: a simulated run's log with the truth, or a real robot's log without it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.sim.worlds import World

from ..artifacts.results import REPLAY, config_record
from ..scenario import OFFLINE, TrialConfig
from ..scoring.summary import odometry_poses
from ..trial import TrialResult
from .real_log import RealRun, looked_over, mapped_real, replay_real, replayed_real
from .replay import RecordedRun, ReplayOptions, replay, replayed

RECORDED = "recorded"
"""Key of a real robot's log among the options of a replay in `config.json`."""


def was_real(said: Any) -> bool:
    """Return whether the options of a replay in `config.json` are those of a real robot's log."""
    return isinstance(said, dict) and isinstance(said.get(RECORDED), dict)


@dataclass(frozen=True)
class OwnLog:
    """A simulated run's log."""

    run: RecordedRun
    options: ReplayOptions
    world: World
    backend: str = TrialConfig.backend
    """What replays it unless a back end is named."""

    @property
    def title(self) -> str:
        """World, seed and association."""
        return f"{self.world.name}, seed {self.run.trial.seed}, replayed with {self.options.association} association"

    @property
    def scans(self) -> int:
        """Number of scans."""
        return len(self.run.recording)

    def config(self, backend: str) -> dict[str, Any]:
        """Return the settings of the run, and the options of the replay."""
        return config_record(replayed(self.run, backend)) | {REPLAY: asdict(self.options)}

    def go(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Replay it."""
        return replay(self.run, backend, self.options, watch, self.world)

    @property
    def odometry(self) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s 3"]]:
        """Return the times of the scans and the odometry's pose at each."""
        recording = self.run.recording
        return recording.time_s, odometry_poses(self.run.true_poses_world[0], recording.odometry)

    def true_pose(self, step: Step) -> Float[np.ndarray, "3"]:
        """Return the true pose at a step."""
        return np.asarray(self.run.true_poses_world[step.index])


@dataclass(frozen=True)
class RealLog:
    """A real robot's log."""

    run: RealRun

    @property
    def title(self) -> str:
        """Name of the log."""
        return self.run.name

    @property
    def scans(self) -> int:
        """Number of keyframes."""
        return len(self.run.log.recording)

    def config(self, backend: str) -> dict[str, Any]:
        """Return the settings of the mapper, and how the log was read."""
        said = {name: value for name, value in asdict(self.run.options).items() if value is not None}
        return config_record(replayed_real(self.run, backend)) | {REPLAY: {RECORDED: said}}

    def go(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Map it and refine the result offline, if asked for."""
        return replay_real(self.run, backend, watch)

    def mapped(self, backend: str, watch: Callable[[Step], None]) -> TrialResult:
        """Map it."""
        return mapped_real(self.run, backend, watch)

    def looked_over(self, result: TrialResult, watch: Callable[[float], None]) -> TrialResult:
        """Refine a result offline."""
        return looked_over(self.run, result, watch)

    @property
    def backend(self) -> str:
        """What maps it unless a back end is named: offline refinement, if somebody else recorded it."""
        return OFFLINE if self.run.trial.backend == OFFLINE else TrialConfig.backend

    @property
    def odometry(self) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s 3"]]:
        """Return the times of the scans and the odometry's pose at each."""
        return self.run.log.scan_time_s, self.run.log.poses_of_scans(self.run.wheels_alone)

    def wheels_pose(self, step: Step) -> Float[np.ndarray, "3"]:
        """Return the odometry's pose at a step."""
        return np.asarray(self.run.wheels_alone[step.index])
