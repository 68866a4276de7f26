"""Map unknown buildings with line segments: the public interface.

    import chainslam

    run = chainslam.explore("paper-fig4", seed=2)
    run.summary["status"]

Every name is imported from its own subpackage when it is first used, and with it GTSAM, Rerun or matplotlib.
"""

import sys
from importlib import import_module
from importlib.metadata import version
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chainslam.experiments.library.audit.auditing import Audit, audit
    from chainslam.experiments.library.comparing import Comparison, compare, load
    from chainslam.experiments.library.running import explore, replay
    from chainslam.experiments.library.runs import Map, Run
    from chainslam.experiments.scoring.keys import Steps, Summary
    from chainslam.experiments.scoring.without_truth.unseen_floor import UnseenFloor, unseen_floor
    from chainslam.experiments.usage import UsageError
    from chainslam.explore.step import Step
    from chainslam.explore.strategies import STRATEGIES, Choice, Situation, Strategy, StrategyEntry
    from chainslam.sim.worlds import DrawingOptions, World
    from chainslam.sim.worlds.registry import READERS, WORLDS
    from chainslam.slam.backends import BACKENDS, BackendEntry
    from chainslam.slam.estimation.backend import Backend, Belief, Joint, Observations, StaleBeliefError
    from chainslam.slam.evaluation.axioms.check import Failure, check_backend
    from chainslam.slam.robot import MotionCommand, Odometry, Robot, RobotError, RobotSpec, Scan, ScannerSpec, WheelSpec
    from chainslam.slam.robot.streaming import SteppedRobot, StreamingRobot, TimedScan, Twist

_PLACES = {
    "chainslam.experiments.library.running": ("explore", "replay"),
    "chainslam.experiments.library.audit.auditing": ("Audit", "audit"),
    "chainslam.experiments.library.comparing": ("Comparison", "compare", "load"),
    "chainslam.experiments.library.runs": ("Map", "Run"),
    "chainslam.experiments.scoring.keys": ("Steps", "Summary"),
    "chainslam.experiments.scoring.without_truth.unseen_floor": ("UnseenFloor", "unseen_floor"),
    "chainslam.experiments.usage": ("UsageError",),
    "chainslam.explore.step": ("Step",),
    "chainslam.explore.strategies": ("STRATEGIES", "Choice", "Situation", "Strategy", "StrategyEntry"),
    "chainslam.sim.worlds": ("DrawingOptions", "World"),
    "chainslam.sim.worlds.registry": ("READERS", "WORLDS"),
    "chainslam.slam.backends": ("BACKENDS", "BackendEntry"),
    "chainslam.slam.estimation.backend": ("Backend", "Belief", "Joint", "Observations", "StaleBeliefError"),
    "chainslam.slam.evaluation.axioms.check": ("Failure", "check_backend"),
    "chainslam.slam.robot": (
        "MotionCommand",
        "Odometry",
        "Robot",
        "RobotError",
        "RobotSpec",
        "Scan",
        "ScannerSpec",
        "WheelSpec",
    ),
    "chainslam.slam.robot.streaming": ("SteppedRobot", "StreamingRobot", "TimedScan", "Twist"),
}
"""The module of each name."""
_PLACE_OF = {name: place for place, names in _PLACES.items() for name in names}

__version__ = version("chainslam")
__all__ = [
    "BACKENDS", "READERS", "STRATEGIES", "WORLDS", "Audit", "Backend", "BackendEntry", "Belief", "Choice", "Comparison",
    "DrawingOptions", "Failure", "Joint", "Map", "MotionCommand", "Observations", "Odometry", "Robot", "RobotError",
    "RobotSpec", "Run", "Scan", "ScannerSpec", "Situation", "StaleBeliefError", "Step", "SteppedRobot", "Steps",
    "Strategy", "StrategyEntry", "StreamingRobot", "Summary", "TimedScan", "Twist", "UnseenFloor", "UsageError",
    "WheelSpec", "World", "__version__", "audit", "check_backend", "compare", "explore", "load", "replay",
    "unseen_floor",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import and return a public name."""
    if name not in _PLACE_OF:
        raise AttributeError(f"module 'chainslam' has no attribute {name!r}")
    try:
        value = getattr(import_module(_PLACE_OF[name]), name)
    except ImportError as error:
        raise import_module("chainslam.experiments.usage").missing(error) from error
    if name in ("BACKENDS", "STRATEGIES", "READERS"):
        import_module("chainslam.experiments.campaign.plugins").register_installed()
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


class _Interface(ModuleType):
    """The package itself: its `explore` is a function, although a subpackage has the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        """Bind a name, but do not let the import of a subpackage hide the function of the same name."""
        if not (name in _PLACE_OF and isinstance(value, ModuleType)):
            super().__setattr__(name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to unpickle this package in another process: import it."""
        return import_module, (self.__name__,)


sys.modules[__name__].__class__ = _Interface
