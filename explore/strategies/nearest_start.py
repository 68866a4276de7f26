"""Next to start position: the open end closest to where the robot began (paper, section 3.3 and figure 6)."""

import numpy as np

from .nearest import nearest_end
from .strategy import Choice, Situation


class NearestStart:
    """Goes to the open end closest to the start, which swings the robot back and forth through the best known walls."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the open end that is closest to the start in a straight line, of those to which a way is known."""
        ends = situation.open_ends
        places = np.reshape([end.position_world for end in ends], (-1, 2))
        from_start = np.hypot(*(places - situation.start_world).T)
        best = nearest_end(situation, from_start)
        if best is None:
            return None
        reason = (
            f"of {len(ends)} open ends the nearest to the start, {from_start[best]:.1f} m from it,"
            f" {situation.end_metres[best]:.1f} m to drive"
        )
        return Choice(ends[best], reason)
