"""The next open end in the actual chain: close one chain before beginning another (paper, section 3.3)."""

from .nearest import nearest_end
from .strategy import Choice, Situation


class SameChain:
    """Stays with the chain that it works on until that has no open end left, then takes the nearest other one."""

    def __init__(self) -> None:
        self._wall: int | None = None

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearer open end of the actual chain, else the nearest of all."""
        ends = situation.open_ends
        mine = self._actual_chain(situation)
        best = nearest_end(situation, None, [row for row, end in enumerate(ends) if end.wall in mine])
        if best is not None:
            metres = situation.end_metres[best]
            reason = f"open end of the actual chain of {len(mine)} walls, {metres:.1f} m to drive"
        else:
            best = nearest_end(situation)
            if best is None:
                return None
            state = "no chain was begun" if self._wall is None else "the actual chain has no end to explore"
            metres = situation.nearest_end_metres[best]
            reason = f"{state}: the nearest of {len(ends)} open ends, {metres:.1f} m to drive"
        self._wall = ends[best].wall
        return Choice(ends[best], reason)

    def _actual_chain(self, situation: Situation) -> tuple[int, ...]:
        """Return the walls of the chain that was worked on; if its wall is gone, of the one that is followed."""
        for wall in (self._wall, situation.current_wall if self._wall is not None else None):
            for chain in situation.chains:
                if wall in chain.walls:
                    return chain.walls
        return ()
