"""What is wrong with a robot, in one line."""


class RobotError(ValueError):
    """A value that no robot can state or report: what was expected, what was found, and what to do, in one line."""
