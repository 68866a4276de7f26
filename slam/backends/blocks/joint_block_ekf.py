"""One joint update, then the correlations dropped: what that alone costs, without the relocation-fusion scheme."""

from ..kalman.ekf import Ekf
from .block_map import BlockMap


class JointBlockEkf(Ekf[BlockMap]):
    """The full filter's update on a map that keeps the diagonal blocks alone."""

    new_map = BlockMap
