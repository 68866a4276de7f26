"""How many of the 95 % intervals of distances between corners hold the truth, run by run, over every pair of corners.

Corners of one map share their errors, so that the pairs of a run are wrong together: even of a right filter, in one run
all intervals hold and in another fewer. What a right filter would show is drawn from each map's own covariance.

.venv/bin/python -m studies.consistency.intervals --seeds 100     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.maps.corners import Corner, corners
from chainslam.experiments.scoring.maps.measurements import Z_95, corner_points, distances
from chainslam.experiments.scoring.truth import Truth
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import TrialResult, run_trial
from chainslam.slam.geometry.lines import normals

from ..runner.command import run_study
from ..runner.rows import Row
from ..runner.scores import interval_words
from ..runner.trials import scored

NAMES = ("world", "backend", "seed")
DRAWS = 400
"""Maps drawn from a map's own covariance, to see what a right filter would show."""
LOW = 0.025
"""Runs below this quantile of what their own covariance says are too rare to be chance."""


@dataclass(frozen=True)
class IntervalStudy:
    """Explore a world with many seeds, and print how many of the intervals between corners hold the truth, by run."""

    world: str = "paper-fig8"
    """A bundled world or a file."""
    backends: tuple[str, ...] = ("block-ekf", "full-ekf", "invariant-ekf")
    """The estimators; each drives."""
    seeds: int = 100
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/intervals.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print a row for each back end; raises UsageError."""
        trials = [
            TrialConfig(self.world, name, seed=seed)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for name in self.backends
        ]
        plain_console(width=150).print(table(scored(trials, self.out, _known_by, _scores_of, self.jobs)))


def _known_by(trial: TrialConfig) -> Row:
    return {name: getattr(trial, name) for name in NAMES}


def _scores_of(trial: TrialConfig) -> Row:
    return scores(run_trial(trial))


def scores(result: TrialResult) -> Row:
    """Return how the intervals of one run's corners fared, and what its own covariance says they should."""
    assert result.last is not None
    walls = result.last.map
    joint = walls.belief.joint(walls.ids)
    crossing = [corner for corner in corners(walls, result.last.chains) if corner.jacobian is not None]
    known = [(corner, at) for corner in crossing if (at := true_corner(corner, result)) is not None]
    if len(known) < 2:
        return {"pairs": 0}
    true = np.array([at for _, at in known])
    jacobians = np.array([corner.jacobian for corner, _ in known])
    mapped = np.array([corner.position_world for corner, _ in known])
    points = corner_points(mapped, jacobians, joint.cov)
    pairs = np.argwhere(np.triu(np.ones((len(known), len(known)), dtype=bool), 1))
    pairs = pairs[np.hypot(*(true[pairs[:, 1]] - true[pairs[:, 0]]).T) > 1e-6]
    lengths, sigmas = distances(points, pairs)
    z = (lengths - apart(true, pairs)) / sigmas
    drawn = expected_shares(mapped, jacobians, joint.cov, pairs, sigmas, int(result.scenario.config.seed))
    held = float(np.mean(np.abs(z) <= Z_95))
    return {
        "corners": len(known),
        "pairs": len(pairs),
        "held": held,
        "mean_z2": float(np.mean(z**2)),
        "worst_mm": float(1e3 * np.abs(lengths - apart(true, pairs)).max()),
        "sigma_mm": float(1e3 * np.median(sigmas)),
        "expected_sd": float(np.std(drawn)),
        "expected_low": float(np.quantile(drawn, LOW)),
        "rarer": float(np.mean(drawn <= held)),
        "map_anees": result.summary["map_anees"],
    }


def true_corner(corner: Corner, result: TrialResult) -> Float[np.ndarray, "2"] | None:
    """Return where the true walls of a mapped corner meet, None where the beams do not tell them or they do not cross.

    Which walls are true is told by the beams, never by what is near.
    """
    truth: Truth = result.votes.truth
    faces = result.votes.faces_of(np.array(corner.walls))
    if (faces < 0).any() or truth.walls[faces[0]] == truth.walls[faces[1]]:
        return None
    n = normals(truth.lines[faces, 0])
    if abs(np.linalg.det(n)) < np.sin(np.deg2rad(10.0)):
        return None
    at = np.linalg.solve(n, truth.lines[faces, 1])
    ends = truth.faces[faces].reshape(-1, 2)
    # Walls that meet in the drawing: a corner of lines that end before it is none.
    return at if np.hypot(*(ends - at).T).reshape(2, 2).min(axis=1).max() < 1e-6 else None


def apart(points: Float[np.ndarray, "n 2"], pairs: Int[np.ndarray, "p 2"]) -> Float[np.ndarray, " p"]:
    """Return the distances of some pairs of points."""
    return np.hypot(*(points[pairs[:, 1]] - points[pairs[:, 0]]).T)


def expected_shares(
    mapped: Float[np.ndarray, "n 2"],
    jacobians: Float[np.ndarray, "n 2 s"],
    cov: Float[np.ndarray, "s s"],
    pairs: Int[np.ndarray, "p 2"],
    sigmas: Float[np.ndarray, " p"],
    seed: int,
) -> Float[np.ndarray, " d"]:
    """Return the share of intervals that hold, in worlds drawn from the covariance of one map."""
    G = jacobians.reshape(-1, cov.shape[0])
    values, vectors = np.linalg.eigh(G @ cov @ G.T)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    errors = np.random.default_rng(seed).standard_normal((DRAWS, len(root))) @ root.T
    lengths = apart(mapped, pairs)
    held = [np.abs(apart(mapped + error.reshape(-1, 2), pairs) - lengths) <= Z_95 * sigmas for error in errors]
    return np.mean(held, axis=1)


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each back end: the shares by run, and what the maps' own covariances say of them."""
    shown = Table(title="95 % intervals between corners, shares by run", title_justify="left")
    for column in ("back end", "runs", "pairs a run", "held (95 %)", "median", "least", "runs below 0.8", "mean z²",
                   "sd by run", "sd expected", "runs too rare (2.5 % expected)"):  # fmt: skip
        shown.add_column(column, justify="left" if column == "back end" else "right")
    for name in dict.fromkeys(row["backend"] for row in rows):
        own = [row for row in rows if row["backend"] == name and row["pairs"]]
        held = np.array([row["held"] for row in own])
        rare = np.mean([row["rarer"] <= LOW for row in own])
        shown.add_row(
            name, str(len(own)), f"{np.mean([row['pairs'] for row in own]):.0f}",
            f"{held.mean():.3f} {interval_words(held)}", f"{np.median(held):.3f}", f"{held.min():.3f}",
            str(int(np.sum(held < 0.8))), f"{np.mean([row['mean_z2'] for row in own]):.2f}", f"{held.std():.3f}",
            f"{np.sqrt(np.mean([row['expected_sd'] ** 2 for row in own])):.3f}", f"{rare:.3f}",
        )  # fmt: skip
    return shown


if __name__ == "__main__":
    run_study(IntervalStudy)
