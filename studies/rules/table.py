"""All rules that can be switched off."""

from .explore_rules import EXPLORE_RULES
from .log_rules import LOG_RULES
from .slam_rules import SLAM_RULES

SWITCHES = (*SLAM_RULES, *LOG_RULES, *EXPLORE_RULES)
WHAT = {switch.name: switch.what for switch in reversed(SWITCHES)}
"""What each rule does, by its name."""
