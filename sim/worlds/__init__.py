"""Named worlds and the readers of drawn maps."""

from .contour import Contour
from .drawing import WorldError
from .options import AS_DRAWN, DrawingOptions
from .registry import WORLDS, is_own, listing, load
from .world import World

__all__ = ["AS_DRAWN", "WORLDS", "Contour", "DrawingOptions", "World", "WorldError", "is_own", "listing", "load"]
