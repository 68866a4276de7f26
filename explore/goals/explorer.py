"""The top layer: which open end next, when to abandon it, what was given up and why (paper, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import networkx as nx
import numpy as np
from jaxtyping import Float

from slam.map.chains import Chain, OpenEnd
from slam.robot import MotionCommand

from ..following.ping_pong import WallErrand
from ..following.wall_following import EndErrand, Errand, FollowingConfig, PlaceErrand, Surroundings
from ..goal import Goal, LeftPlace, SetAside
from ..outcome import Outcome
from ..planning.visibility_graph import followed_wall
from ..planning.wall_routes import route
from ..strategies import Choice, Place, Situation, Strategy
from ..survey.frontiers import known_floor
from .sweep import Sweep, SweepConfig
from .visited_places import Spots


@dataclass(frozen=True)
class ExplorerConfig:
    """When an end is given up, and for how long."""

    following: FollowingConfig = field(default_factory=FollowingConfig)
    moved_m: float = 0.2
    """An end that was set aside is tried again when it has moved this far."""
    attempts: int = 3
    """So many ends set aside at one place (within 0.3 m) are enough: it is not tried again."""
    returns: int = 8
    """An end that was gone so often while the robot was about it, and came back, is set aside."""
    grown: float = 0.1
    """An end that could not be looked at is tried again when so much more of the floor around it is known."""
    patience_steps: int = 400
    """A goal that takes longer is set aside."""
    second_looks: int = 4
    """Before it ends, the robot turns on the spot this often while there are walls that it saw only once."""
    sweep: bool = True
    """After the last chain, visit what is reachable and unseen."""
    sweeping: SweepConfig = field(default_factory=SweepConfig)


class Explorer:
    """Holds the present goal and the memory of what was given up."""

    def __init__(self, strategy: Strategy, start_world: Float[np.ndarray, 2], config: ExplorerConfig) -> None:
        self._strategy = strategy
        self._start, self._config = start_world, config
        self._step = -1
        self._errand: Errand | None = None
        self._choice: Choice | None = None
        self._sweeping = False
        self._steps_on_goal = 0
        self._attempts = Spots(0.3)
        self._sweep = Sweep(config.sweeping, config.sweep)
        self._walked: set[tuple[int, int]] = set()
        self._gone = Spots(0.3)
        self._floor_known: dict[tuple[int, int], int] = {}
        self.set_aside: dict[tuple[int, int], SetAside] = {}
        self._looked_again = 0
        self._open: frozenset[tuple[int, int]] = frozenset()
        self.needs_floor = True
        self.goal: Goal | None = None
        self.walls_to_follow: tuple[int, ...] = ()

    @property
    def strategy(self) -> Strategy:
        """Who chooses where to go; may be exchanged while the robot drives, which drops the present goal."""
        return self._strategy

    @strategy.setter
    def strategy(self, strategy: Strategy) -> None:
        self._strategy = strategy
        self._drop()

    @property
    def doing(self) -> str:
        """What the robot is about and why, in words."""
        if self._errand is None or self._choice is None:
            return ""
        return f"{self._errand.doing} ({self._choice.reason})"

    @property
    def still_open(self) -> tuple[SetAside, ...]:
        """The ends that were set aside and are open still."""
        return tuple(aside for key, aside in self.set_aside.items() if key in self._open)

    @property
    def left_places(self) -> tuple[LeftPlace, ...]:
        """The borders of unseen floor that were to be visited, and what was in the way."""
        return self._sweep.left

    @property
    def outcome(self) -> Outcome:
        """Why there is nowhere left to go."""
        return Outcome.ENDS_LEFT if self.still_open else Outcome.ALL_CLOSED

    @property
    def closing_words(self) -> str:
        """The same in words."""
        left = len(self.still_open)
        return "every chain is closed" if not left else f"no reachable open end is left; {left} cannot be closed"

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return the next step, or None when there is nowhere left to go."""
        self._step += 1
        ends = {(end.wall, end.side): end for chain in chains for end in chain.open_ends}
        self._open = frozenset(ends)
        self._revive(ends)
        self._abandon(around, ends)
        known = len(self.set_aside)
        for _ in range(len(ends) + 20):
            if self._errand is None and not self._choose(around, chains, ends, graph):
                return self._look_again(around, len(self.set_aside) > known)
            assert self._errand is not None
            self._steps_on_goal += 1
            command = self._errand.command(around)
            if command is not None and self._steps_on_goal <= self._config.patience_steps:
                self._looked_again = 0
                return command
            self._give_up(around)
        return self._look_again(around, len(self.set_aside) > known)

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way to the present goal: something stands in this one."""
        if self._errand is not None:
            self._errand.interrupt(around)

    def start_over(self) -> None:
        """Forget what was given up, and where: the floor is drawn anew."""
        self._drop()
        self._sweep = Sweep(self._config.sweeping, self._config.sweep)
        self._attempts, self._gone = Spots(0.3), Spots(0.3)
        self._walked, self._floor_known = set(), {}
        self.set_aside.clear()
        self._looked_again = 0

    def _look_again(self, around: Surroundings, gave_up: bool) -> MotionCommand | None:
        """Turn on the spot while there are walls that were seen only once; None when there is nothing left to do.

        Ends that were given up just now may join others that were: the chains are connected with the next scan.
        """
        self._looked_again += 1
        again = self._looked_again <= self._config.second_looks and bool(around.walls.tentative.any())
        if not again and not gave_up:
            return None
        return MotionCommand(0.0, self._config.following.driving.turn_rad)

    def _revive(self, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Forget what was set aside where the end is gone or has moved: there it may be tried again."""
        for key, aside in list(self.set_aside.items()):
            end = ends.get(key)
            if end is None or self._is_hopeless(end.position_world):
                continue
            if np.hypot(*(end.position_world - aside.position_world)) > self._config.moved_m:
                del self.set_aside[key]

    def _abandon(self, around: Surroundings, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Drop a goal that is no open end any longer or no longer holds; a sweep, as soon as there is an end."""
        if self._choice is None:
            return
        holds = self._choice.holds(around) and not (self._sweeping and self._candidates(ends))
        if isinstance(self._choice.target, OpenEnd):
            key = (self._choice.target.wall, self._choice.target.side)
            if key not in ends:
                self._gone.add(self._choice.target.position_world)
            holds = holds and key in ends and key not in self.set_aside
            if holds and isinstance(self._errand, EndErrand):
                self._errand.follow(ends[key])
        if not holds:
            self._drop()

    def _candidates(self, ends: dict[tuple[int, int], OpenEnd]) -> tuple[OpenEnd, ...]:
        return tuple(end for key, end in ends.items() if key not in self.set_aside)

    def _choose(
        self,
        around: Surroundings,
        chains: tuple[Chain, ...],
        ends: dict[tuple[int, int], OpenEnd],
        graph: nx.DiGraph[int],
    ) -> bool:
        """Ask the strategy where to go, and set out; False when there is nowhere left."""
        following = self._config.following
        self._tire(ends)
        if not self._candidates(ends):
            self._retry(around, ends)
        situation = Situation(
            around, chains, self._candidates(ends), graph, self._start, followed_wall(around.walls), self._step,
            self._sweep.was_in_vain, following.paths, following.looks,
        )  # fmt: skip
        choice = self.strategy.choose(situation)
        self._sweeping = choice is None and not situation.open_ends
        if choice is None:
            choice = self._sweep.choose(situation) if self._sweeping else _straight_to_nearest(situation)
        if choice is None:
            return False
        self._set_out(choice, situation)
        return True

    def _tire(self, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Set aside what opens and closes without end, as a chain can that looks closed from one side only."""
        for end in self._candidates(ends):
            if (times := self._gone.count(end.position_world)) >= self._config.returns:
                reason = f"open again after it was gone {times} times"
                self.set_aside[end.wall, end.side] = SetAside(end.wall, end.side, end.position_world, reason)

    def _set_out(self, choice: Choice, situation: Situation) -> None:
        self._choice, self._steps_on_goal = choice, 0
        target, following = choice.target, self._config.following
        if isinstance(target, OpenEnd):
            self.walls_to_follow = route(situation.graph, situation.current_wall, target.wall)
            self._errand = EndErrand(target, self.walls_to_follow, following)
            self.goal = Goal("open-end", target.wall, target.side, target.position_world, choice.reason)
        else:
            self.walls_to_follow = ()
            self._errand = PlaceErrand(target.points_world, f"to where {target.what}", following)
            self.goal = Goal(target.kind, None, None, target.centre_world, choice.reason)

    def _drop(self) -> None:
        self._errand = self._choice = self.goal = None

    def _give_up(self, around: Surroundings) -> None:
        """Set the goal aside with the reason; an end that nothing was seen of, only after a walk along its wall."""
        errand, choice = self._errand, self._choice
        assert errand is not None
        assert choice is not None
        target, following = choice.target, self._config.following
        in_time = self._steps_on_goal <= self._config.patience_steps
        late = "" if in_time else f"not reached in {self._config.patience_steps} steps"
        if isinstance(target, Place):
            self._drop()
            self._sweep.ended(target, late or errand.trouble)
            return
        key = (target.wall, target.side)
        if in_time and isinstance(errand, WallErrand):
            self._errand = EndErrand(target, (target.wall,), following)
            return
        if in_time and not errand.looks_done and key not in self._walked:
            self._walked.add(key)
            self._errand = WallErrand(target.wall, target.side, following)
            return
        self._drop()
        end = errand.end if isinstance(errand, EndErrand) else target
        if not in_time:
            reason = late
        elif errand.looks_done:
            reason = f"still open after {errand.looks_done} looks"
        else:
            reason = errand.trouble
            self._floor_known[key] = known_floor(around.free_space, end.position_world, following.looks.near_m)
        self.set_aside[key] = SetAside(end.wall, end.side, end.position_world, reason)
        self._attempts.add(end.position_world)

    def _retry(self, around: Surroundings, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Forget that no look at an end was possible where the floor has become known since."""
        reach = self._config.following.looks.near_m
        for key, before in list(self._floor_known.items()):
            if key not in ends or self._is_hopeless(ends[key].position_world):
                continue
            if known_floor(around.free_space, ends[key].position_world, reach) > (1.0 + self._config.grown) * before:
                del self._floor_known[key]
                self.set_aside.pop(key, None)

    def _is_hopeless(self, place: Float[np.ndarray, 2]) -> bool:
        return self._attempts.count(place) >= self._config.attempts


def _straight_to_nearest(situation: Situation) -> Choice:
    """No way to stand before any open end is known yet: go where the straight way is shortest and see."""
    gaps = [np.hypot(*(end.position_world - situation.around.pose_world[:2])) for end in situation.open_ends]
    end = situation.open_ends[int(np.argmin(gaps))]
    return Choice(end, "no way to stand before any open end is known; nearest")
