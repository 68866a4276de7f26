"""Which open ends lie on something round, whose chain of short walls no look can close."""

from chainslam.slam.geometry.circles import DEFAULT, RoundConfig, radius_of
from chainslam.slam.map.chains import OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap


def is_round(end: OpenEnd, walls: StochasticMap, config: RoundConfig = DEFAULT) -> bool:
    """Return whether the wall of an open end and others beside it touch one circle from outside."""
    row = int(walls.belief.rows([end.wall])[0])
    return radius_of(row, walls.belief.lines_world, walls.ends_world, config) > 0.0
