"""The path of the wheel odometry, under `/world/odometry`: the same for all back ends, so sent once."""

import numpy as np
from jaxtyping import Float

from chainslam.explore.step import Step

from ... import palette
from ..colours import packed
from ..recording import RerunRecording, Timestamps
from .map_layers import style
from .robot_layers import send_path

WHEELS = "/world/odometry/path"


class WheelsLayer:
    """Collects the odometry's path and sends each piece once."""

    def __init__(self, out: RerunRecording) -> None:
        self._out = out
        self._next = 0
        self._kept: list[tuple[int, float, np.ndarray]] = []
        self._before: Float[np.ndarray, "1 3"] | None = None

    def add(self, step: Step, pose_world: Float[np.ndarray, "3"]) -> None:
        """Keep a pose, unless another back end has sent it already."""
        if step.index >= self._next:
            self._kept.append((step.index, step.time_s, pose_world))
            self._next = step.index + 1

    def flush(self) -> None:
        """Send what was kept since the last time."""
        rows, self._kept = self._kept, []
        if not rows:
            return
        if self._before is None:
            self._out.fixed(WHEELS, style(1.2, 9.0, colors=packed(palette.PATH_ODOMETRY)))
        steps, seconds, poses = zip(*rows, strict=True)
        moments = Timestamps(np.array(steps), np.array(seconds))
        self._before = send_path(self._out, WHEELS, moments, np.array(poses), self._before)
