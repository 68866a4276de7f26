"""Exploration as an environment of Gymnasium: a policy drives the robot, and is paid for what the map truly tells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import networkx as nx
import numpy as np
from gymnasium import spaces
from jaxtyping import Float, UInt8

from chainslam.explore.floor.floor_memory import FloorMemory
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.goals.decider import Decision
from chainslam.explore.mission import driven_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.slam.geometry.poses import to_robot, to_world
from chainslam.slam.map.chains import Chain
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import MotionCommand, Odometry, Robot, Scan

from ..artifacts.settings import settings_of
from ..scenario import KNOWN, Scenario, build, check, load_world
from ..scoring.maps.coverage import sample
from ..scoring.maps.information import PITCH_M, Ruler
from ..scoring.truth import truth_of
from ..usage import UsageError
from .asked import asked_trial

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""What the floor in an observation says of a cell."""
RANDOM = "random"
"""In place of a world: another random building in each episode."""
CELL_M = 0.1
"""Side of a cell of the observed floor."""
MAPPED_SHARE = 0.99
"""Of the reachable contour: an episode is over once more is mapped."""
REST = MotionCommand(0.0, 0.0)


class _Led:
    """A robot that drives what the policy says, in place of what it is told by the loop."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self.command = robot, REST

    def sense(self) -> Scan:
        """Return the scan of the robot."""
        return self._robot.sense()

    def drive(self, command: MotionCommand) -> Odometry:
        """Drive the policy's command."""
        return self._robot.drive(self.command)


class _Nobody:
    """Decides nothing: the policy does, between two steps; ends the episode where the scans say what is broken."""

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return a command that nobody obeys."""
        if around.fault:
            return Decision(None, around.fault, outcome=Outcome.FAILED)
        return Decision(REST, "lost" if around.is_lost else "led by a policy")

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of nothing."""


class Exploration(gymnasium.Env[dict[str, Any], np.ndarray]):
    """A robot with a laser in an unknown building; each step is one scan, one update of the map and one motion.

    The action is (forward, turn), each from -1 to 1 of the longest step and the widest turn. The observation is a dict:

    - `ranges` (beams,) m, in the order of the scanner's beams; the range of the scanner where nothing was hit,
    - `floor` (2 * view, 2 * view) uint8, cells of 0.1 m about the robot, row 0 on its left, column 0 behind it:
      0 unknown, 1 free, 2 occupied,
    - `pose` (3,) the estimated pose in the frame of the world, m m rad, and `sigmas` (3,) its standard deviations,
    - `open_ends` (ends, 2) the nearest open ends of chains, robot frame, m, and `open_end_count` (1,).

    The reward is the gain in information about the true walls (`MapInformation`), nat times m, which an estimator
    cannot raise by an overconfident covariance, minus `step_cost` and for each contact `touch_cost`. An episode
    terminates once 99 % of the reachable contour is mapped, or the robot fails; it is truncated after `max_steps`.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(
        self,
        world: str | Path = RANDOM,
        *,
        backend: str = "invariant-ekf",
        max_steps: int = 1000,
        view: int = 32,
        ends: int = 8,
        step_cost: float = 0.1,
        touch_cost: float = 10.0,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """Explore `world`, a bundled name or a file; `random` is another random building in each episode.

        `view` is how many cells the observed floor reaches to each side, `ends` how many open ends are told. `settings`
        maps the keys of docs/reference/settings.md to values. The start is known. Raises UsageError for bad input.
        """
        if min(view, ends) < 1:
            raise UsageError(f"expected at least 1 for view and for ends, found {min(view, ends)}: raise it")
        named = "random:0" if world == RANDOM else str(world)
        said = {"world": named, "backend": backend, "p0": KNOWN, "max_steps": max_steps}
        self._trial = asked_trial(said, {}, None, None, None, None, [settings_of(settings or {})])
        check(self._trial)
        self._world = None if world == RANDOM else load_world(named)
        self._view, self._ends, self._costs = view, ends, (step_cost, touch_cost)
        robot = self._trial.robot
        beams, far_m = robot.lidar.beams, robot.lidar.range_max_m
        side = 2 * view
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = spaces.Dict(
            {
                "ranges": spaces.Box(0.0, far_m, (beams,), np.float32),
                "floor": spaces.Box(0, OCCUPIED, (side, side), np.uint8),
                "pose": spaces.Box(-np.inf, np.inf, (3,), np.float32),
                "sigmas": spaces.Box(0.0, np.inf, (3,), np.float32),
                "open_ends": spaces.Box(-np.inf, np.inf, (ends, 2), np.float32),
                "open_end_count": spaces.Box(0, np.inf, (1,), np.float32),
            }
        )
        out = CELL_M * (0.5 * np.arange(2 * side) - view + 0.25)
        self._cells_robot = np.stack(np.meshgrid(out, -out, indexing="xy"), axis=-1).reshape(-1, 2)
        self._steps: Iterator[Step] = iter(())
        self._led: _Led | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode: the seed decides the building, if it is random, and all noise."""
        super().reset(seed=seed)
        chance = int(self.np_random.integers(2**31))
        name = f"random:{chance}" if self._world is None else self._trial.world
        scenario = build(replace(self._trial, world=name, seed=chance), self._world)
        rules = scenario.config.mission
        self._led = _Led(scenario.robot)
        mapper, floor = Mapper(scenario.backend, rules.mapper), FreeSpace(rules.free_space)
        self._steps = driven_mission(self._led, mapper, _Nobody(), FloorMemory(floor, rules.floor_memory))
        self._ruler = _ruler(scenario)
        self._contacts = 0
        step = next(self._steps)
        self._told = self._ruler.measure(step.map)
        return self._observed(step), self._info(step)

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Drive one motion, map one scan, and return the observation, the reward, and whether the episode is over.

        Raises RuntimeError before the first `reset` and after the end of an episode, and ValueError for an action that
        is not two finite numbers.
        """
        asked = np.asarray(action, dtype=np.float64)
        if asked.shape != (2,) or not np.all(np.isfinite(asked)):
            raise ValueError(f"expected an action of two finite numbers, found {action!r}: give (forward, turn)")
        if self._led is None:
            raise RuntimeError("expected an episode, found none: call reset() first")
        forward, turn = np.clip(asked, -1.0, 1.0).tolist()
        robot = self._trial.robot
        self._led.command = MotionCommand(forward * robot.step_m, turn * robot.turn_rad)
        step = next(self._steps, None)
        if step is None:
            raise RuntimeError("expected an episode that goes on, found one that has ended: call reset()")
        self._contacts += bool(step.odometry.touched)
        told, before = self._ruler.measure(step.map), self._told
        self._told = told
        step_cost, touch_cost = self._costs
        reward = told.nat_m - before.nat_m - step_cost - touch_cost * bool(step.odometry.touched)
        terminated = step.outcome is not None or told.coverage > MAPPED_SHARE
        truncated = step.index >= self._trial.max_steps
        if terminated or truncated:
            self._steps = iter(())
        return self._observed(step), reward, terminated, truncated, self._info(step)

    def _observed(self, step: Step) -> dict[str, np.ndarray]:
        belief, far_m = step.map.belief, self._trial.robot.lidar.range_max_m
        ranges = np.where(np.isfinite(step.scan.ranges_m), step.scan.ranges_m, far_m)
        found = [end.position_world for chain in step.chains for end in chain.open_ends]
        places = to_robot(np.array(found).reshape(-1, 2), belief.pose_world)
        nearest = places[np.argsort(np.hypot(*places.T))[: self._ends]]
        ends = np.zeros((self._ends, 2))
        ends[: len(nearest)] = nearest
        return {
            "ranges": np.clip(ranges, 0.0, far_m).astype(np.float32),
            "floor": _floor_about(step.free_space, self._cells_robot, belief.pose_world, 2 * self._view),
            "pose": belief.pose_world.astype(np.float32),
            "sigmas": np.sqrt(np.diag(belief.pose_cov)).astype(np.float32),
            "open_ends": ends.astype(np.float32),
            "open_end_count": np.array([len(places)], dtype=np.float32),
        }

    def _info(self, step: Step) -> dict[str, Any]:
        return {
            "information_nat_m": self._told.nat_m,
            "coverage": self._told.coverage,
            "path_length_m": step.path_length_m,
            "contacts": self._contacts,
            "words": step.decision.words,
        }


def _ruler(scenario: Scenario) -> Ruler:
    """Return what the map of an episode is measured by."""
    robot = scenario.config.robot
    return Ruler(sample(truth_of(scenario.world, robot), PITCH_M), robot.lidar.range_max_m)


def _floor_about(
    floor: FreeSpace, cells_robot: Float[np.ndarray, "n 2"], pose_world: Float[np.ndarray, 3], side: int
) -> UInt8[np.ndarray, "h w"]:
    """Return the floor about the robot, by the quarter of each cell that says most; unknown beyond the grid."""
    cells = floor.cells(to_world(cells_robot, pose_world))
    inside = floor.inside(cells)
    rows, columns = cells[inside].T
    evidence = floor.evidence[rows, columns]
    seen = np.where(floor.occupied[rows, columns], OCCUPIED, np.where(evidence != 0, FREE, UNKNOWN))
    about = np.zeros(len(cells), dtype=np.uint8)
    about[inside] = seen
    return about.reshape(side, 2, side, 2).max(axis=(1, 3))
