"""Named worlds and the readers of drawn maps."""

from .contour import Contour
from .drawing import WorldError
from .registry import WORLDS, listing, load
from .world import World

__all__ = ["WORLDS", "Contour", "World", "WorldError", "listing", "load"]
