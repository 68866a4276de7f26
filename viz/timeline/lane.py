"""One back end's part of a recording: it receives steps and regularly sends columns, layer by layer."""

from typing import Protocol

import numpy as np
from jaxtyping import Float

from chainslam.explore.step import Step

from .block import Block
from .drawn_step import DrawnStep, Keeper
from .layers.curves import CurvesLayer, DecisionsLayer
from .layers.map_layers import CornersLayer, GoalLayer, OpenEndsLayer, SweptLayer, WallsLayer
from .layers.model_layer import ModelLayer
from .layers.robot_layers import RobotLayer, ScanLayer
from .layers.sights import SightsLayer
from .layers.truth import NeesLayer, NeesOf, TruthLayer
from .recording import RerunRecording


class Layer(Protocol):
    """One kind of thing in a recording; it sends its changes and remembers what it has sent."""

    def send(self, block: Block) -> None:
        """Send some steps, in order and only once."""
        ...


class Lane:
    """Collects the steps of one back end."""

    def __init__(self, recording: RerunRecording, backend: str, truth: TruthLayer, nees_of: NeesOf | None) -> None:
        self._keeper = Keeper()
        self._kept: list[DrawnStep] = []
        self._r_span = (0.0, 0.0)
        self.seen_world = np.zeros((0, 2))
        """Ends of the walls of the last step, m."""
        kinds = (
            SweptLayer,
            WallsLayer,
            CornersLayer,
            OpenEndsLayer,
            GoalLayer,
            RobotLayer,
            ScanLayer,
            SightsLayer,
            ModelLayer,
            CurvesLayer,
            DecisionsLayer,
        )
        self._layers: list[Layer] = [kind(recording, backend) for kind in kinds]
        self._layers += [truth] if nees_of is None else [truth, NeesLayer(recording, backend, nees_of)]

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def r_span(self) -> tuple[float, float]:
        """Smallest and largest r of the lines so far, m."""
        return self._r_span

    def add(self, step: Step, true_pose_world: Float[np.ndarray, "3"] | None) -> None:
        """Keep a step; its belief is queried at once, before the back end continues."""
        self.seen_world = step.map.ends_world.reshape(-1, 2)
        self._kept.append(self._keeper.keep(step, true_pose_world))

    def flush(self) -> None:
        """Send what was kept since the last time."""
        rows, self._kept = self._kept, []
        if not rows:
            return
        block = Block(rows)
        r = np.append(block.lines[:, 1], self._r_span)
        self._r_span = float(r.min()), float(r.max())
        for layer in self._layers:
            layer.send(block)
