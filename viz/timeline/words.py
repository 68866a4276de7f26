"""The legend of a recording."""

from .layers.model_layer import TIMES
from .layers.robot_layers import POSE_TIMES

TRUTH = "the estimate over the truth. Broad grey: true walls; pink: true path and robot."
NO_TRUTH = "the estimate. Thin grey: the path by wheel odometry alone."
NEES = """**NEES**: squared pose error in units of the stated uncertainty; outside the band in 5 % of the steps
if the estimator knows its own error."""
NIS = """**NIS**: how far each scan's segments lie from where the belief puts them, in units of what it states."""


def legend(title: str, plans: bool, knows_truth: bool = True) -> str:
    """Return, in Markdown, the meaning of what is shown and how to navigate it; a replay `plans` nothing."""
    goal = " Yellow: the goal, and the walls to follow there." if plans else ""
    return f"""**{title}**. Drag the time cursor below: everything moves together.

**Map**, {TRUTH if knows_truth else NO_TRUTH}
Estimated walls: orange and brown in chains still open, blue and violet in closed ones, grey tentative,
red with lack of fit; black dots: corners. Red circles: open ends, to be explored; grey circles: blacklisted.{goal}
Robot with its 3σ ellipse, {POSE_TIMES:.0f} times enlarged; small dots: the scan;
its segments: green fused, blue new, red refused (and why), grey unused.
Pale blue: floor seen so far. Thin lines: the visibility graph.

**Model space**: each wall as the 3σ ellipse of its direction α and distance r, {TIMES:.0f} times enlarged;
green and red: the segments just seen, joined to the walls they were matched to; pale: direction hardly known.

{NEES if knows_truth else NIS} **Chains**: thick, the closed ones.
"""
