"""What the robot is doing at one step, as one word: the column `behaviour` of `steps.csv`."""

from enum import StrEnum


class Behaviour(StrEnum):
    """What the robot is doing; the first four are those of the paper's wall following layer (section 3.1)."""

    APPROACH = "approach"
    """It drives to a wall that it does not follow yet."""
    FOLLOW = "follow"
    """It follows a wall at the stand-off."""
    ROUND = "round"
    """It drives round the end of a wall at the same distance."""
    REVERSE = "reverse"
    """It turns round to follow the wall in the other direction."""
    LOOK = "look"
    """It drives to a viewpoint of an open end, or only measures, as a recorded robot does throughout."""
    SWEEP = "sweep"
    """It drives to floor that it has not seen, or to an obstacle that is no wall of the map."""
    HOME = "home"
    """It drives back to the start."""
    LOST = "lost"
    """It does not know where it is."""
    RETREAT = "retreat"
    """It drives back along its own path."""
