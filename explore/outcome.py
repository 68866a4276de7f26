"""Why a mission is over, as one of a few names; the words beside it say which end, which limit, which fault."""

from enum import StrEnum


class Outcome(StrEnum):
    """Why a mission is over."""

    ALL_CLOSED = "all-closed"
    """Every chain of the map is closed."""
    NONE_REACHABLE = "none-reachable"
    """No open end that is left can be reached or closed; each has its reason."""
    ENDS_LEFT = "ends-left"
    """The same, but something moved: what stood in the way may be gone, and the map is not said to be complete."""
    NO_WALL = "no-wall"
    """Nothing was found that could be explored."""
    RECORDING_ENDED = "recording-ended"
    """A recorded robot was ridden to the end of its recording."""
    RECORDING_CUT_SHORT = "recording-cut-short"
    """The same, of a drive that had not come to its own end."""
    STEP_LIMIT = "step-limit"
    PATH_LIMIT = "path-limit"
    TIME_LIMIT = "time-limit"
    INTERRUPTED = "interrupted"
    FAILED = "failed"

    @property
    def status(self) -> str:
        """`complete`: no reachable open end is left; `stopped`: somebody or a limit ended it; or `failed`."""
        if self in (Outcome.ALL_CLOSED, Outcome.NONE_REACHABLE, Outcome.NO_WALL, Outcome.RECORDING_ENDED):
            return "complete"
        return "failed" if self is Outcome.FAILED else "stopped"
