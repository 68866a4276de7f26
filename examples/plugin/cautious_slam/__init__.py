"""What this package adds to chainslam: `pyproject.toml` names it, and `pip install` is all that it takes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

import chainslam
from chainslam.sim.worlds.drawing import Drawing, WorldError
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.estimation.models import Motion


@dataclass(frozen=True)
class CautiousConfig:
    """Settings of its own: `--set backend_options.own.CautiousConfig.times=3`."""

    times: float = 2.0
    """The wheels are believed to err by so many times as much as they state."""


class CautiousEkf(FullEkf):
    """The full EKF, which trusts the wheels less than they state."""

    def __init__(self, pose_world: np.ndarray, pose_cov: np.ndarray, config: CautiousConfig = CautiousConfig()) -> None:
        """Start at a pose with its covariance and an empty map."""
        super().__init__(pose_world, pose_cov)
        self._times = config.times

    def motion(self, odometry: chainslam.Odometry) -> tuple[Motion, np.ndarray]:
        """Return the motion, and the noise that it adds to the pose's error."""
        motion, noise = super().motion(odometry)
        return motion, self._times**2 * noise


class Farthest:
    """Chooses among the open ends to which a way is known."""

    def choose(self, situation: chainslam.Situation) -> chainslam.Choice | None:
        """Return the open end that is farthest away; None where there is none that can be reached."""
        metres = np.where(np.isfinite(situation.end_metres), situation.end_metres, -1.0)
        if not len(metres) or metres.max() < 0.0:
            return None
        best = int(np.argmax(metres))
        return chainslam.Choice(situation.open_ends[best], f"the farthest of {len(metres)}, {metres[best]:.1f} m away")


def read_walls(path: Path, options: chainslam.DrawingOptions) -> Drawing:
    """Return walls from lines of `x1 y1 x2 y2`; raises WorldError, in one line, for any other file."""
    try:
        ends = np.loadtxt(path, ndmin=2).reshape(-1, 2, 2) * (options.scale or 1.0)
    except (ValueError, OSError) as error:
        raise WorldError(f"expected `x1 y1 x2 y2` in every line, found {path.name} ({error}): correct it") from error
    return Drawing(lines=tuple(map(shapely.LineString, ends)), start=np.array([1.5, 1.0, 0.0]))


BACKEND = chainslam.BackendEntry(CautiousEkf, "full EKF that doubts the wheels", options=CautiousConfig)
STRATEGY = chainslam.StrategyEntry(Farthest, "the open end that is farthest to drive to")
