"""What is wrong with a robot, in one line."""


class RobotError(ValueError):
    """What no robot is or reports, told in one line: what was expected, what was found, what to do."""
