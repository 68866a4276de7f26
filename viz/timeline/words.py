"""What a newcomer reads beside the picture."""

from .model_layer import TIMES
from .robot_layers import POSE_TIMES


def legend(title: str) -> str:
    """Return, in Markdown, what is shown and how to move through it."""
    return f"""**{title}**. Drag the time cursor below: everything moves together.

**Map.** Broad grey: true walls. Pink: true path and robot.
Warm colours: chains of walls still open; cool: closed chains; grey: walls not yet trusted. Black dots: corners.
Red circles: open ends, which draw the robot; grey circles: given up. Yellow: the goal, and the walls to follow there.
Pale blue: floor that the scans swept. Thin lines: the visibility graph.
Robot with its 3σ ellipse, {POSE_TIMES:.0f} times enlarged; dots: the scan;
its segments: green fused, blue new, red refused (and why), grey unused.

**Model space.** Each wall an ellipse of 3σ about its direction α and distance r, {TIMES:.0f} times enlarged
(pale where the direction is hardly known); red and green: the segments just seen, joined to the
walls that they were matched to.

**NEES** of the pose: within the band in 95 % of the steps if the filter knows its own error; above it,
the filter is overconfident.
"""
