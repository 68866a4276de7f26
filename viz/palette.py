"""Colours with one meaning each, the same in Rerun and in matplotlib."""

from chainslam.slam.backends import BACKENDS

BACKEND_COLOURS = (
    "#D55E00", "#E69F00", "#CC79A7", "#0072B2", "#56B4E9", "#009E73", "#3A3A3A", "#6B2C91",
    "#874B00", "#0000D2", "#B42D69", "#B400FF", "#2D002D",
)  # fmt: skip
"""Okabe and Ito's palette without its yellow, which is invisible on white paper, and six darker colours. With any
colour vision, two of them are as distinguishable as any two of that palette (simulated in
tests/viz/test_palette.py)."""


def of_backend(name: str) -> str:
    """Return the colour of a back end by its place in the registry; of an unregistered one, the last."""
    names = list(BACKENDS)
    turn = names.index(name) if name in names else len(BACKEND_COLOURS) - 1
    return BACKEND_COLOURS[turn % len(BACKEND_COLOURS)]


def backends() -> dict[str, str]:
    """Return the colour of each registered back end."""
    return {name: of_backend(name) for name in BACKENDS}


def of_rank(rank: int) -> str:
    """Return the colour of anything else, by its place in a list."""
    return BACKEND_COLOURS[rank % len(BACKEND_COLOURS)]


CLOSED = ("#0072B2", "#7B4FA3", "#56B4E9", "#1F3F7A", "#A68BD0", "#4C5FD5", "#2A8FA8", "#5B2A86")
"""Closed chains, in turn; none is green, which means fused segments."""
OPEN = "#E69F00"
"""Chains with open ends ..."""
OPEN_SHADES = (OPEN, "#B86E00", "#F2C45A", "#8C5A1E")
"""... in turn, if several are distinguished."""
ALARM = "#D55E00"
"""Open ends."""
TENTATIVE = "#9A9A9A"
CROOKED = "#C8102E"
GOAL = "#FFC400"
SWEPT = "#E4EFF7"
SCAN = "#4A90D9"
FUSED = "#009E73"
NEW = "#0072B2"
REFUSED = "#C8102E"
UNUSED = "#9A9A9A"
SIGHT = "#C4CDD6"
NEIGHBOUR = "#8796A5"
TO_FOLLOW = "#F3E58A"
GRID_STRONG = "#B9B6AE"
BAND = "#9A9A9A"
PAGE = "#FFFFFF"
SOLID = "#D9D7D2"
"""True walls."""
FLOOR = "#FBFAF7"
WALL_LINE = "#8F8C85"
GRID = "#E4E2DC"
INK = "#2B2B2B"
PATH_ESTIMATED = "#333A56"
PATH_ODOMETRY = "#B7B2A6"
PATH_TRUE = "#CC79A7"
PATH_TRUE_PALE = "#E3B5CD"
