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
from ..following.ping_pong import WallErrand
from ..following.surroundings import Surroundings
from ..following.wall_following import Errand, PlaceErrand
from ..goal import Goal
from ..outcome import Outcome
from ..planning.wall_routes import route
from ..strategies import Choice, Place, Situation, Strategy, Watchful
from ..strategies.nearest import straight_to_nearest_end
from ..survey.frontiers import known_floor
from ..survey.round_things import is_round
from .decider import Decision
from .explorer_config import ExplorerConfig
from .ledger import Event, Key, Ledger
from .second_tries import SecondTries
from .sweep import Sweep


@dataclass
class _Task:
    """What the robot is about."""

    choice: Choice
    errand: Errand | PaperErrand
    goal: Goal
    walls_to_follow: tuple[int, ...]
    is_sweep: bool
    steps: int = 0
    """So many were spent on it."""

    @property
    def doing(self) -> str:
        """What the robot is about and why, in words."""
        return f"{self.errand.doing} ({self.choice.reason})"


class Explorer:
    """Holds the present task and the ledger of what was given up."""

    def __init__(self, strategy: Strategy, start_world: Float[np.ndarray, 2], config: ExplorerConfig) -> None:
        self.strategy = strategy
        self._start, self._config = start_world, config
        self._step = -1
        self._tries = SecondTries(config)
        self.start_over()

    def start_over(self) -> None:
        """Forget what was given up, and where: the floor is drawn anew."""
        self._task: _Task | None = None
        self._ledger = Ledger(self._config.near_m)
        self._sweep = Sweep(self._config.sweeping, self._ledger, self._config.sweep)
        self._tries.start_over(self._ledger)
        self._looked_again = 0

    @property
    def strategy(self) -> Strategy:
        """Who chooses where to go; may be exchanged while the robot drives, which drops the present goal."""
        return self._strategy

    @strategy.setter
    def strategy(self, strategy: Strategy) -> None:
        self._strategy, self._task = strategy, None
        # Asked once: what a protocol asks of a class takes longer than most strategies.
        self._watchful = strategy if isinstance(strategy, Watchful) else None

    def watch(self, around: Surroundings) -> None:
        """Take note of a step's surroundings; `decide` does so itself."""
        self._step += 1
        if self._watchful is not None:
            self._watchful.watch(around)
        self._tries.watch(around)

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do next; at the end, which ends are left."""
        self.watch(around)
        ends = {(end.wall, end.side): end for chain in chains for end in chain.open_ends}
        self._tries.take_up_moved(ends)
        self._keep_within(around, ends)
        self._abandon(around, ends)
        command = self._command(around, chains, ends, graph)
        given_up, task = self._ledger.given_up, self._task
        if command is not None:
            if task is None:
                return Decision(command, "", given_up=given_up)
            led = task.errand.walls_to_follow
            walls = task.walls_to_follow if led is None else led
            return Decision(command, task.doing, task.goal, walls, given_up, task.errand.behaviour)
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
        """Return the next step, or None when there is nowhere left to go."""
        known = len(self._ledger.set_aside)
        for _ in range(len(ends) + 20):
            task = self._task = self._task or self._choose(around, chains, ends, graph)
            if task is None:
                break
            task.steps += 1
            command = task.errand.command(around)
            in_time = task.steps <= self._config.patience_steps or isinstance(task.errand, PaperErrand)
            if command is not None and in_time:
                self._looked_again = 0
                return command
            self._task = self._give_up(task, around, ends)
            self._tries.gave_up_s = around.scan.time_s
        if self._tries.take_up_all(around, ends):
            return spin(around, 1.0, self._config.following.driving)
        return self._look_again(around, len(self._ledger.set_aside) > known)

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way to the present goal: something stands in this one."""
        if self._task is not None:
            self._task.errand.interrupt(around)

    def _look_again(self, around: Surroundings, gave_up: bool) -> MotionCommand | None:
        """Turn on the spot while there are tentative walls; None when there is nothing left to do.

        Ends that were given up just now may join others that were: the chains are connected with the next scan.
        """
        self._looked_again += 1
        again = self._looked_again <= self._config.second_looks and bool(around.walls.tentative.any())
        if not again and not gave_up:
            return None
        return spin(around, 1.0, self._config.following.driving)

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
            if not is_open:
                self._ledger.note(Event.GONE, target.position_world)
            holds = holds and is_open and self._ledger.end(key).set_aside is None
            if holds and isinstance(task.errand, EndErrand):
                task.errand.follow(ends[key])
        if not holds:
            self._task = None

    def _candidates(self, ends: dict[Key, OpenEnd]) -> tuple[OpenEnd, ...]:
        return tuple(end for key, end in ends.items() if self._ledger.end(key).set_aside is None)

    def _choose(
        self, around: Surroundings, chains: tuple[Chain, ...], ends: dict[Key, OpenEnd], graph: nx.DiGraph[int]
    ) -> _Task | None:
        """Ask the strategy where to go, and set out; None when there is nowhere left."""
        self._tire(ends)
        if self._config.following.method == "viewpoints":
            self._pass_round(around, ends)
        if not self._candidates(ends):
            self._tries.take_up_known(around, ends)
        situation = Situation(
            around=around,
            chains=chains,
            open_ends=self._candidates(ends),
            graph=graph,
            start_world=self._start,
            step=self._step,
            was_in_vain=self._sweep.was_in_vain,
            following=self._config.following,
        )
        choice = self.strategy.choose(situation)
        is_sweep = choice is None and not situation.open_ends
        if choice is None:
            choice = self._sweep.choose(situation) if is_sweep else straight_to_nearest_end(situation)
        return None if choice is None else self._set_out(choice, situation, is_sweep)

    def _keep_within(self, around: Surroundings, ends: dict[Key, OpenEnd]) -> None:
        """Set aside what lies beyond the fence."""
        candidates = self._candidates(ends)
        if around.free_space.config.fence is None or not candidates:
            return
        within = around.free_space.is_within(np.array([end.position_world for end in candidates]))
        for end, is_within in zip(candidates, within, strict=True):
            if not is_within:
                self._ledger.put_aside(end, "beyond the fence")

    def _tire(self, ends: dict[Key, OpenEnd]) -> None:
        """Set aside what opens and closes without end, as a chain can that looks closed from one side only."""
        for end in self._candidates(ends):
            if (times := self._ledger.count(Event.GONE, end.position_world)) >= self._config.returns:
                self._ledger.put_aside(end, f"open again after it was gone {times} times")

    def _pass_round(self, around: Surroundings, ends: dict[Key, OpenEnd]) -> None:
        """Set aside what lies on something round: each look at it finds another short wall with two more ends."""
        for end in self._candidates(ends):
            if is_round(end, around.walls, self._config.round_things):
                self._ledger.put_aside(end, "on a curved obstacle")

    def _set_out(self, choice: Choice, situation: Situation, is_sweep: bool) -> _Task:
        target, following = choice.target, self._config.following
        if isinstance(target, OpenEnd):
            goal = Goal("open-end", target.wall, target.side, target.position_world, choice.reason)
            if following.method == "paper":
                return _Task(choice, PaperErrand(target, following), goal, (), is_sweep)
            walls = route(situation.graph, situation.current_wall, target.wall)
            return _Task(choice, EndErrand(target, walls, following), goal, walls, is_sweep)
        errand = PlaceErrand(target.points_world, f"to where {target.what}", following)
        return _Task(choice, errand, Goal(target.kind, None, None, target.centre_world, choice.reason), (), is_sweep)

    def _give_up(self, task: _Task, around: Surroundings, ends: dict[Key, OpenEnd]) -> _Task | None:
        """Set the goal aside with the reason; an end that nothing was seen of, only after a walk along its wall."""
        errand, target, following = task.errand, task.choice.target, self._config.following
        in_time = task.steps <= self._config.patience_steps
        late = "" if in_time else f"not reached in {self._config.patience_steps} steps"
        if isinstance(target, Place):
            self._sweep.ended(target, late or errand.trouble)
            return None
        if isinstance(errand, PaperErrand):
            for side in (TAIL, HEAD):
                if (end := ends.get((target.wall, side))) is not None:
                    self._ledger.put_aside(end, errand.trouble)
                    self._ledger.note(Event.SET_ASIDE, end.position_world)
            return None
        key = (target.wall, target.side)
        if in_time and isinstance(errand, WallErrand):
            task.errand = EndErrand(target, (target.wall,), following)
            return task
        if in_time and not errand.looks_done and not self._ledger.end(key).was_walked:
            self._ledger.note_walk(key)
            task.errand = WallErrand(target.wall, target.side, following)
            return task
        end = errand.end if isinstance(errand, EndErrand) else target
        if not in_time:
            self._ledger.put_aside(end, late)
        elif errand.looks_done:
            self._ledger.put_aside(end, f"still open after {errand.looks_done} view{'s' * (errand.looks_done > 1)}")
        else:
            known = known_floor(around.free_space, end.position_world, following.viewpoints.near_m)
            self._ledger.put_aside(end, errand.trouble, known)
        self._ledger.note(Event.SET_ASIDE, end.position_world)
        return None
