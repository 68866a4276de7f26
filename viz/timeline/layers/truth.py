"""The truth as plain geometry, under `/world/truth`, and the NEES of an estimate."""

from collections.abc import Callable, Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float

from ... import palette
from ..block import Block
from ..colours import packed
from ..recording import RerunRecording
from .curves import LOG_NEES, NEES, POSE_BAND, curve_style
from .map_layers import style
from .robot_layers import body, send_path

NeesOf = Callable[
    [Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]], Float[np.ndarray, " n"]
]
"""Function from estimated poses, their covariances and the true poses to the NEES of each; NaN if it cannot be
computed."""


BAND_WORDS = {"high": "above: overconfident", "low": "below: too cautious"}


class TruthLayer:
    """The true walls, and the true path so far; the same for all back ends, so sent once."""

    def __init__(self, out: RerunRecording, rings_world: Sequence[Float[np.ndarray, "_ 2"]]) -> None:
        self._out = out
        self._next = 0
        self._before: Float[np.ndarray, "1 3"] | None = None
        if len(rings_world):
            strips = [np.concatenate([ring, ring[:1]]) for ring in rings_world]
            walls = rr.LineStrips2D(
                strips, radii=rr.Radius.ui_points(4.0), colors=packed(palette.SOLID), draw_order=1.0
            )
            out.fixed("/world/truth/walls", walls)

    def send(self, block: Block) -> None:
        """Send the true poses of steps that no other back end has shown yet."""
        new = [at for at, row in enumerate(block.rows) if row.index >= self._next and row.true_pose is not None]
        if not new:
            return
        if not self._next:
            self._out.fixed("/world/truth/path", style(4.0, 10.0, colors=packed(palette.PATH_TRUE_PALE)))
            self._out.fixed("/world/truth/robot/body", body(palette.PATH_TRUE, block.rows[0].robot.radius_m, 3.6, 45.0))
        moments = block.moments.take(new)
        poses = np.array([block.rows[at].true_pose for at in new])
        self._out.poses("/world/truth/robot", moments, poses)
        self._before = send_path(self._out, "/world/truth/path", moments, poses, self._before)
        self._next = int(moments.step[-1]) + 1


class NeesLayer:
    """The pose's NEES, plain and as a power of ten, with its band over the same steps."""

    def __init__(self, out: RerunRecording, backend: str, nees_of: NeesOf) -> None:
        self._out, self._backend, self._of = out, backend, nees_of
        self._band_drawn = False
        for plot in (NEES, LOG_NEES):
            out.fixed(f"/plots/{plot}/{backend}", curve_style(backend))
            for name, words in BAND_WORDS.items():
                line = rr.SeriesLines(colors=packed(palette.BAND), names=words, widths=2.5)
                out.fixed(f"/plots/{plot}/band/{name}", line)

    def send(self, block: Block) -> None:
        """Send the values of the steps with known truth."""
        known = [at for at, row in enumerate(block.rows) if row.true_pose is not None]
        if not known:
            return
        moments = block.moments.take(known)
        covs = np.array([block.rows[at].pose_cov for at in known])
        values = self._of(block.poses[known], covs, np.array([block.rows[at].true_pose for at in known]))
        finite = np.isfinite(values)
        self._out.values(f"/plots/{NEES}/{self._backend}", moments.take(finite), values[finite])
        powers = np.log10(np.maximum(values[finite], 1e-3))
        self._out.values(f"/plots/{LOG_NEES}/{self._backend}", moments.take(finite), powers)
        ends = moments.take([-1]) if self._band_drawn else moments.take([0, -1])
        self._band_drawn = True
        for name, level in zip(("low", "high"), POSE_BAND, strict=True):
            self._out.values(f"/plots/{NEES}/band/{name}", ends, np.full(len(ends), level))
            self._out.values(f"/plots/{LOG_NEES}/band/{name}", ends, np.full(len(ends), np.log10(level)))
