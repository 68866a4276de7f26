"""One joint update, then the correlations dropped: what that alone costs, without the relocation-fusion scheme."""

from .kalman.block_map import BlockMap
from .kalman.ekf import Ekf


class JointBlockEkf(Ekf[BlockMap]):
    """The full filter's update on a map that keeps the diagonal blocks alone."""

    new_map = BlockMap
