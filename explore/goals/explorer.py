"""The top layer: which open end next, when to abandon it, what was given up and why (paper, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import HEAD, TAIL, Chain, OpenEnd
from chainslam.slam.robot import MotionCommand

from ..following.driving import spin
from ..following.end_errand import EndErrand
from ..following.paper_errand import PaperErrand
from ..following.surroundings import Surroundings
from ..following.wall_following import Errand, PlaceErrand
from ..goal import GivenUp, Goal, LeftPlace, SetAside
from ..outcome import Outcome
from ..strategies import Choice, Place, Situation, Strategy, Watchful
from ..strategies.nearest import nearest_left, straight_to_nearest_end
from ..survey.round_things import is_round
from .decider import Decision
from .explorer_config import ExplorerConfig
from .second_tries import SecondTries

Key = tuple[int, int]
"""An end of a wall: its id and the side."""
IN_VAIN = 0.5
"""A visit of a place that brought nothing takes this share of the patience with it."""


@dataclass
class _Task:
    """What the robot is about."""

    choice: Choice
    errand: Errand | PaperErrand
    goal: Goal
    is_sweep: bool
    steps: int = 0
    """So many were spent on it."""


class Explorer:
    """Holds the present task and what was given up."""

    def __init__(self, strategy: Strategy, start_world: Float[np.ndarray, 2], config: ExplorerConfig) -> None:
        self._start, self._config = start_world, config
        self._near_m, self._patience_steps = config.near_m, config.patience_steps
        self._step = -1
        self._tries = SecondTries(config)
        self._task: _Task | None = None
        self.strategy = strategy
        self._forget()

    def start_over(self) -> None:
        """Forget what was given up, and where: the floor is drawn anew."""
        self._task = None
        self._tries.start_over()
        self._forget()

    def _forget(self) -> None:
        """Let every end and every place be tried again, as if none had been."""
        self._set_aside: dict[Key, SetAside] = {}
        self._left: list[LeftPlace] = []
        self._tasks: list[_Task] = []

    @property
    def strategy(self) -> Strategy:
        """Who chooses where to go; may be exchanged while the robot drives, which drops the present goal."""
        return self._strategy

    @strategy.setter
    def strategy(self, strategy: Strategy) -> None:
        self._strategy, self._task = strategy, None
        # Asked once: what a protocol asks of a class takes longer than most strategies.
        self._watchful = strategy if isinstance(strategy, Watchful) else None

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do next; at the end, which ends are left.

        A mission begins with some turns on the spot: a scanner that sits elsewhere on the body than stated shows in
        turns, and is noticed before the robot drives past anything.
        """
        self._step += 1
        if self._watchful is not None:
            self._watchful.watch(around)
        self._tries.watch(around)
        driving = self._config.following.driving
        if self._step < self._config.first_turns:
            return Decision(spin(around, 1.0, driving), "first turns on the spot: does the scanner sit as stated")
        ends = {(end.wall, end.side): end for chain in chains for end in chain.open_ends}
        self._keep_within(around, ends)
        self._abandon(around, ends)
        command, task = self._command(around, chains, ends, graph), self._task
        given_up = GivenUp(tuple(self._set_aside.values()), tuple(self._left), self._near_m)
        if command is not None and task is None:
            return Decision(command, "", given_up=given_up)
        if command is not None and task is not None:
            errand, words = task.errand, f"{task.errand.doing} ({task.choice.reason})"
            return Decision(command, words, task.goal, errand.walls_to_follow, given_up, errand.behaviour)
        left, unseen = len(given_up.keys & ends.keys()), sum(bool(place.trouble) for place in given_up.places)
        words = "every chain is closed" if not left else f"no reachable open end is left; {left} cannot be closed"
        outcome = Outcome.NONE_REACHABLE if left else Outcome.ALL_CLOSED
        if self._tries.has_seen_moving and (left or unseen):
            outcome = Outcome.ENDS_LEFT
            words = f"ends-left: {left} open ends and {unseen} borders of unseen floor are blocked by something that"
            words += f" moves or that is no wall, after {self._tries.used + 1} tries"
        return Decision(None, words, given_up=given_up, outcome=outcome)

    def _command(
        self, around: Surroundings, chains: tuple[Chain, ...], ends: dict[Key, OpenEnd], graph: nx.DiGraph[int]
    ) -> MotionCommand | None:
        """Return the next step, or None when there is nowhere left to go.

        Ends that were given up just now may join others that were: the next scan's chains tell.
        """
        known = len(self._set_aside)
        for _ in range(len(ends) + 20):
            task = self._task = self._task or self._choose(around, chains, ends, graph)
            if task is None:
                break
            task.steps += 1
            command = task.errand.command(around)
            if command is not None and (isinstance(task.errand, PaperErrand) or self._is_patient(task.steps)):
                return command
            self._give_up(task, ends)
            self._task, self._tries.gave_up_s = None, around.scan.time_s
        if len(self._set_aside) > known:
            return spin(around, 1.0, self._config.following.driving)
        is_left = bool(self._set_aside.keys() & ends.keys()) or any(place.trouble for place in self._left)
        if not (is_left and self._tries.may_be_had):
            return None
        if self._tries.are_due(around):
            self._forget()
        return spin(around, 1.0, self._config.following.driving)

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way to the present goal: something stands in this one."""
        if self._task is not None:
            self._task.errand.interrupt(around)

    def _abandon(self, around: Surroundings, ends: dict[Key, OpenEnd]) -> None:
        """Drop a goal that is no open end any longer or no longer holds; a sweep, as soon as there is an end."""
        task = self._task
        if task is None:
            return
        holds = task.choice.holds(around) and not (task.is_sweep and self._candidates(ends))
        target = task.choice.target
        if isinstance(target, OpenEnd):
            key = (target.wall, target.side)
            is_open = task.errand.is_open(ends) if isinstance(task.errand, PaperErrand) else key in ends
            holds = holds and is_open and key not in self._set_aside
            if holds and isinstance(task.errand, EndErrand):
                task.errand.follow(ends[key])
        if not holds:
            self._task = None

    def _candidates(self, ends: dict[Key, OpenEnd]) -> tuple[OpenEnd, ...]:
        return tuple(end for key, end in ends.items() if key not in self._set_aside)

    def _choose(
        self, around: Surroundings, chains: tuple[Chain, ...], ends: dict[Key, OpenEnd], graph: nx.DiGraph[int]
    ) -> _Task | None:
        """Ask the strategy where to go, and set out; None when there is nowhere left."""
        efforts = np.array([(*task.goal.position_world, task.steps) for task in self._tasks]).reshape(-1, 3)

        def spent(place_world: Float[np.ndarray, 2]) -> int:
            """Return how many steps were spent on goals at a place."""
            return int(efforts[np.hypot(*(efforts[:, :2] - place_world).T) < self._near_m, 2].sum())

        looks = self._config.following.method == "viewpoints"
        for end in self._candidates(ends):
            if not self._is_patient(steps := spent(end.position_world)):
                self._put_aside(end, f"still open after {steps} steps there")
            elif looks and is_round(end, around.walls, self._config.round_things):
                self._put_aside(end, "on a curved obstacle")  # each look at it finds another wall with two more ends
        situation = Situation(
            around=around,
            chains=chains,
            open_ends=self._candidates(ends),
            graph=graph,
            start_world=self._start,
            step=self._step,
            was_in_vain=lambda place: not self._is_patient(spent(place)),
            following=self._config.following,
        )
        choice = self.strategy.choose(situation)
        is_sweep = choice is None and not situation.open_ends
        if choice is None:
            choice = nearest_left(situation, self._config.sweep) if is_sweep else straight_to_nearest_end(situation)
        if choice is None:
            return None
        self._tasks.append(self._set_out(choice, is_sweep))
        return self._tasks[-1]

    def _set_out(self, choice: Choice, is_sweep: bool) -> _Task:
        target, following = choice.target, self._config.following
        if isinstance(target, OpenEnd):
            goal = Goal("open-end", target.wall, target.side, target.position_world, choice.reason)
            errand = (PaperErrand if following.method == "paper" else EndErrand)(target, following)
            return _Task(choice, errand, goal, is_sweep)
        goal = Goal(target.kind, None, None, target.centre_world, choice.reason)
        return _Task(choice, PlaceErrand(target.points_world, f"to where {target.what}", following), goal, is_sweep)

    def _keep_within(self, around: Surroundings, ends: dict[Key, OpenEnd]) -> None:
        """Set aside what lies beyond the fence."""
        if around.free_space.config.fence is None or not (candidates := self._candidates(ends)):
            return
        within = around.free_space.is_within(np.array([end.position_world for end in candidates]))
        for end, is_within in zip(candidates, within, strict=True):
            if not is_within:
                self._put_aside(end, "beyond the fence")

    def _is_patient(self, steps: int) -> bool:
        return steps <= self._patience_steps

    def _put_aside(self, end: OpenEnd, reason: str) -> None:
        self._set_aside[end.wall, end.side] = SetAside(end.wall, end.side, end.position_world, reason)

    def _give_up(self, task: _Task, ends: dict[Key, OpenEnd]) -> None:
        """Set the goal aside with the reason."""
        errand, target, views = task.errand, task.choice.target, task.errand.looks_done
        late = "" if self._is_patient(task.steps) else f"not reached in {self._patience_steps} steps"
        if isinstance(target, Place):
            self._left.append(LeftPlace(target.centre_world, late or errand.trouble))
            task.steps += int(np.ceil(IN_VAIN * self._patience_steps))
        elif isinstance(errand, PaperErrand):
            for side in (TAIL, HEAD):
                if (end := ends.get((target.wall, side))) is not None:
                    self._put_aside(end, errand.trouble)
        else:
            seen = f"still open after {views} view{'s' * (views > 1)}" if views else errand.trouble
            self._put_aside(errand.end if isinstance(errand, EndErrand) else target, late or seen)
