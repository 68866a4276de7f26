"""Innovations of true associations, taken before any gate, which would truncate their distribution."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.association.matching import KnownWalls, Matches, MatchingConfig
from chainslam.slam.association.methods import Matcher
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.models import innovations
from chainslam.slam.evaluation.consistency import nis, whitened
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.extraction.straightness import cov_of_faces
from chainslam.slam.map.reliability import ReliabilityConfig, are_clear

from ...scoring.innovations import share_in_own_band


@dataclass
class InnovationEar:
    """Wraps a matcher that knows the true pairs, and records the innovations of each scan."""

    reliability: ReliabilityConfig
    """Segments of uncertain direction do not change the estimate and are ignored."""
    values: list[float] = field(default_factory=list)
    """NIS of each scan with a known wall."""
    dofs: list[int] = field(default_factory=list)
    _before: dict[int, Float[np.ndarray, "2"]] = field(default_factory=dict)
    _pairs: list[Float[np.ndarray, "2 2"]] = field(default_factory=list)

    def around(self, matcher: Matcher) -> Matcher:
        """Return the wrapped matcher."""

        def overheard(
            segments: Segments, walls: KnownWalls, joint: Joint, config: MatchingConfig, *, clear_only: bool = False
        ) -> Matches:
            matches = matcher(segments, walls, joint, config, clear_only=clear_only)
            if clear_only:
                self._hear(segments, walls.ids, joint, matches)
            return matches

        return overheard

    def mean(self) -> float | None:
        """Return the NIS of all scans over its degrees of freedom: 1 is ideal."""
        return float(np.sum(self.values) / np.sum(self.dofs)) if self.values else None

    def in_band(self) -> float | None:
        """Return the share of scans whose NIS lies in the 95 % band of its own chi-square."""
        return share_in_own_band(self.values, self.dofs) if self.values else None

    def whiteness(self) -> float | None:
        """Return the correlation of a wall's normalised innovations in consecutive scans: 0 for a correct filter."""
        if not self._pairs:
            return None
        before, after = np.array(self._pairs).transpose(1, 0, 2)
        norm = np.sqrt(np.sum(before**2) * np.sum(after**2))
        return float(np.sum(before * after) / norm) if norm > 0 else None

    def _hear(self, segments: Segments, ids: Int[np.ndarray, " n"], joint: Joint, matches: Matches) -> None:
        pairs = matches.pairs[are_clear(segments, self.reliability)[matches.pairs[:, 0]]]
        if not len(pairs):
            self._before = {}
            return
        rows = np.searchsorted(ids, pairs[:, 1])
        seen = segments.take(pairs[:, 0])
        e, S = stacked(joint, rows, seen.lines, seen.cov + cov_of_faces(seen, self.reliability.straightness))
        try:
            value = float(nis(e[None], S[None])[0])
        except np.linalg.LinAlgError:
            self._before = {}
            return
        self.values.append(value)
        self.dofs.append(len(e))
        # Whiten each wall's own 2 by 2 block, so that scans are comparable whatever else they show.
        blocks = S.reshape(len(rows), 2, len(rows), 2)[np.arange(len(rows)), :, np.arange(len(rows))]
        white = whitened(e.reshape(-1, 2), blocks)
        now = dict(zip(pairs[:, 1].tolist(), white, strict=True))
        self._pairs += [np.stack([self._before[wall], now[wall]]) for wall in now if wall in self._before]
        self._before = now


def stacked(
    joint: Joint, rows: Int[np.ndarray, " m"], lines_robot: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k k"]]:
    """Return the innovation (2m,) of lines observed for the joint's lines `rows`, and its predicted covariance."""
    m = len(rows)
    means = joint.mean[3:].reshape(-1, 2)
    model = innovations(joint.mean[:3], joint.anchors[rows], means[rows], lines_robot, cov)
    H, R, each = np.zeros((m, 2, len(joint.mean))), np.zeros((m, 2, m, 2)), np.arange(m)
    H[:, :, :3] = model.H_pose
    for k in range(2):
        H[each, :, 3 + 2 * rows + k] = model.H_line[:, :, k]
    R[each, :, each, :] = model.R
    flat = H.reshape(2 * m, len(joint.mean))
    return model.e.ravel(), flat @ joint.cov @ flat.T + R.reshape(2 * m, 2 * m)
