"""Mapping unknown buildings by walls: the public interface.

    import chainslam

    run = chainslam.explore("paper-fig4", seed=2)
    run.summary["status"]

Every name here is one of the rooms' own; what it loads (GTSAM, Rerun, matplotlib) it loads when it is used.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from experiments.library.comparing import Comparison, compare, load
    from experiments.library.running import explore, replay
    from experiments.library.runs import Map, Run
    from experiments.usage import UsageError
    from explore.step import Step
    from explore.strategies import STRATEGIES, Choice, Situation, Strategy, StrategyEntry
    from sim.worlds import DrawingOptions, World
    from sim.worlds.registry import READERS, WORLDS
    from slam.backends import BACKENDS, BackendEntry
    from slam.estimation.backend import Backend, Belief, Joint, Observations, StaleBeliefError
    from slam.evaluation.axioms.check import Failure, check_backend
    from slam.robot import MotionCommand, Odometry, Robot, RobotError, RobotSpec, Scan, ScannerSpec, WheelSpec
    from slam.robot.streaming import SteppedRobot, StreamingRobot, TimedScan, Twist

_PLACES = {
    "experiments.library.running": ("explore", "replay"),
    "experiments.library.comparing": ("Comparison", "compare", "load"),
    "experiments.library.runs": ("Map", "Run"),
    "experiments.usage": ("UsageError",),
    "explore.step": ("Step",),
    "explore.strategies": ("STRATEGIES", "Choice", "Situation", "Strategy", "StrategyEntry"),
    "sim.worlds": ("DrawingOptions", "World"),
    "sim.worlds.registry": ("READERS", "WORLDS"),
    "slam.backends": ("BACKENDS", "BackendEntry"),
    "slam.estimation.backend": ("Backend", "Belief", "Joint", "Observations", "StaleBeliefError"),
    "slam.evaluation.axioms.check": ("Failure", "check_backend"),
    "slam.robot": (
        "MotionCommand",
        "Odometry",
        "Robot",
        "RobotError",
        "RobotSpec",
        "Scan",
        "ScannerSpec",
        "WheelSpec",
    ),
    "slam.robot.streaming": ("SteppedRobot", "StreamingRobot", "TimedScan", "Twist"),
}
"""Where each name comes from."""
_PLACE_OF = {name: place for place, names in _PLACES.items() for name in names}

__version__ = version("chainslam")
__all__ = [
    "BACKENDS", "READERS", "STRATEGIES", "WORLDS", "Backend", "BackendEntry", "Belief", "Choice", "Comparison",
    "DrawingOptions", "Failure", "Joint", "Map", "MotionCommand", "Observations", "Odometry", "Robot", "RobotError",
    "RobotSpec", "Run", "Scan", "ScannerSpec", "Situation", "StaleBeliefError", "Step", "SteppedRobot", "Strategy",
    "StrategyEntry", "StreamingRobot", "TimedScan", "Twist", "UsageError", "WheelSpec", "World", "__version__",
    "check_backend", "compare", "explore", "load", "replay",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Return a name of the interface, from where it lives."""
    if name not in _PLACE_OF:
        raise AttributeError(f"module 'chainslam' has no attribute {name!r}")
    value = getattr(import_module(_PLACE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
