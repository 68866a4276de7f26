"""The factor graph against an independent solution: dense Gauss-Newton over every pose and line of one recorded run.

The truth here shares only numbers with the graph: what was sensed, with its covariances, and the line of each
observation. Errors are written out anew and differentiated numerically; nothing comes from GTSAM or
`chainslam.slam.estimation.models`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from rich.table import Table
from scipy.linalg import cho_factor, cho_solve

from chainslam.experiments.replays.recordings import record
from chainslam.experiments.replays.replay import Association, ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.backends.graph.record import Record
from chainslam.slam.geometry.lines import lines_to_world, normals
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study

STEP = 1e-6
"""Of the central differences, m and rad."""


@dataclass(frozen=True)
class Problem:
    """All that a graph was told: n poses, the first with a prior, m observations of l lines."""

    prior: Float[np.ndarray, "3"]
    prior_cov: Float[np.ndarray, "3 3"]
    odometry: Float[np.ndarray, "o 3"]
    odometry_cov: Float[np.ndarray, "o 3 3"]
    seen: Float[np.ndarray, "m 5"]
    """(alpha, r, C_alpha_alpha, C_alpha_r, C_r_r), robot frame."""
    seen_from: Int[np.ndarray, " m"]
    line: Int[np.ndarray, " m"]
    anchors: Float[np.ndarray, "l 2"]

    @classmethod
    def of(cls, record: Record) -> "Problem":
        """Take the problem out of a graph's record, from the pose on that saw the first wall."""
        told = [(row, each) for row, line in enumerate(record.lines.values()) for each in line.observations]
        return cls(
            record.frame.pose_world,
            record.frame.cov,
            np.array([odometry.motion for odometry in record.motions]),
            np.array([odometry.cov for odometry in record.motions]),
            np.array([each.seen for _, each in told]),
            np.array([each.pose for _, each in told]),
            np.array([row for row, _ in told]),
            np.array([line.anchor for line in record.lines.values()]),
        )

    def solve(
        self, poses: Float[np.ndarray, "n 3"], lines: Float[np.ndarray, "l 2"], rounds: int = 30
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "l 2"], Float[np.ndarray, "s s"]]:
        """Return poses, lines (alpha, d about their anchors) and the covariance of all, from a first guess.

        The noise of a observation depends a little on the solution: each round takes it from the one before.
        """
        poses, lines = poses.copy(), lines.copy()
        for _ in range(rounds):
            information, gradient = self._normal_equations(poses, lines)
            root = cho_factor(information)
            step = -cho_solve(root, gradient)
            poses += step[: poses.size].reshape(-1, 3)
            lines += step[poses.size :].reshape(-1, 2)
            if np.abs(step).max() < 1e-9:
                break
        return poses, lines, np.asarray(cho_solve(root, np.eye(len(step))))

    def _normal_equations(
        self, poses: Float[np.ndarray, "n 3"], lines: Float[np.ndarray, "l 2"]
    ) -> tuple[Float[np.ndarray, "s s"], Float[np.ndarray, " s"]]:
        n, each = len(poses), np.arange(len(self.odometry))
        size = poses.size + lines.size
        information, gradient = np.zeros((size, size)), np.zeros(size)
        alpha, r, along, cross, across = self.seen.T
        t0, anchors = cross / along, self.anchors[self.line]

        def prior(x: np.ndarray) -> np.ndarray:
            return _wrapped(x - self.prior, 2)

        def moved(x: np.ndarray) -> np.ndarray:
            (c, s), shift = (np.cos(x[:, 2]), np.sin(x[:, 2])), x[:, 3:5] - x[:, :2]
            ahead = np.stack([c * shift[:, 0] + s * shift[:, 1], c * shift[:, 1] - s * shift[:, 0]], axis=-1)
            return _wrapped(np.column_stack([ahead, x[:, 5] - x[:, 2]]) - self.odometry, 2)

        def turn(x: np.ndarray) -> np.ndarray:
            return np.asarray(_wrapped((alpha - x[:, 3] + x[:, 2])[:, None], 0)[:, 0])

        def sighted(x: np.ndarray) -> np.ndarray:
            away = anchors - x[:, :2]
            predicted = x[:, 4] + np.cos(x[:, 3]) * away[:, 0] + np.sin(x[:, 3]) * away[:, 1]
            return np.column_stack([turn(x), r * np.cos(turn(x)) - t0 * np.sin(turn(x)) - predicted])

        here = np.column_stack([poses[self.seen_from], lines[self.line]])
        noise = np.zeros((len(here), 2, 2))
        noise[:, 0, 0] = along
        noise[:, 1, 1] = (across - cross * t0) * (np.cos(turn(here)) - t0 * np.sin(turn(here)) / r) ** 2
        of_lines = 3 * n + 2 * self.line[:, None] + np.arange(2)
        parts: list[tuple[Callable[[np.ndarray], np.ndarray], np.ndarray, np.ndarray, np.ndarray]] = [
            (prior, poses[:1], np.arange(3)[None], self.prior_cov[None]),
            (moved, np.hstack([poses[:-1], poses[1:]]), 3 * each[:, None] + np.arange(6), self.odometry_cov),
            (sighted, here, np.hstack([3 * self.seen_from[:, None] + np.arange(3), of_lines]), noise),
        ]
        for error, x, columns, cov in parts:
            e, A, weights = error(x), _derivative(error, x), np.linalg.inv(cov)
            np.add.at(information, (columns[:, :, None], columns[:, None, :]), A.swapaxes(1, 2) @ weights @ A)
            np.add.at(gradient, columns, np.einsum("mij,mik,mk->mj", A, weights, e))
        return information, gradient


def _wrapped(errors: np.ndarray, column: int) -> np.ndarray:
    errors[:, column] = (errors[:, column] + np.pi) % (2 * np.pi) - np.pi
    return errors


def _derivative(error: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Return d error / d x, row by row, by central differences."""
    steps = STEP * np.eye(x.shape[1])
    return np.stack([(error(x + step) - error(x - step)) / (2 * STEP) for step in steps], axis=-1)


def differences(graph: Graph) -> dict[str, float]:
    """Return how far a graph's present estimates are from the independent solution, at most.

    `sigma_share` is the largest relative error of the sigmas of the last pose and the lines, `covariance` the largest
    error of their joint covariance in units of the sigmas.
    """
    record, problem = graph.record, Problem.of(graph.record)
    belief = graph.belief
    joint, shown = belief.joint(belief.ids), np.flatnonzero([line.shown for line in record.lines.values()])
    # The graph's origin is the pose that saw the first wall; lines are in its frame.
    lines = lines_to_world(graph.lines(), record.frame.pose_world)
    lines[:, 1] -= np.sum(normals(lines[:, 0]) * problem.anchors, axis=-1)
    _, of_poses = np.unique(record.steps, return_index=True)
    found = graph.trajectory()[of_poses][len(record.lead) :]
    poses, truth, cov = problem.solve(found, lines)
    off, lines_off = np.abs(wrap(poses - found)), np.abs(wrap(truth - lines)[shown])
    of_lines = 3 * len(poses) + 2 * shown[:, None] + np.arange(2)
    index = np.concatenate([3 * len(poses) - 3 + np.arange(3), of_lines.ravel()])
    cov = cov[np.ix_(index, index)]
    sigma = np.sqrt(np.diag(cov))
    return {
        "place_mm": 1e3 * float(np.hypot(off[:, 0], off[:, 1]).max()),
        "heading_deg": float(np.rad2deg(off[:, 2].max())),
        "line_mm": 1e3 * float(lines_off[:, 1].max()),
        "line_deg": float(np.rad2deg(lines_off[:, 0].max())),
        "sigma_share": float(np.abs(np.sqrt(np.diag(joint.cov)) / sigma - 1.0).max()),
        "covariance": float(np.abs((joint.cov - cov) / np.outer(sigma, sigma)).max()),
    }


@dataclass(frozen=True)
class GraphStudy:
    """Replay one recorded run with the graph and print how far it is from the independent solution."""

    world: str = "rooms"
    """A bundled world or a file."""
    seed: int = 2
    """Of the run."""
    association: Association = "true"
    """Whose matches: the graph's own gate, or the truth."""
    perfect_extraction: bool = True
    """True lines with noise drawn from exactly the stated covariance, in place of what was fitted."""

    def run(self) -> None:
        """Print a row for the graph as the run leaves it, one linearised anew, and one for the optimum of the batch."""
        run = record(TrialConfig(self.world, "full-ekf", seed=self.seed))
        options = ReplayOptions(self.association, self.perfect_extraction)
        table = Table(title=f"{self.world}, seed {self.seed}, {self.association} association")
        for column in ("", "pose mm", "deg", "line mm", "deg", "sigma", "covariance"):
            table.add_column(column)
        for words, name, prepare in (
            ("as the run leaves it", "graph", lambda graph: None),
            ("linearised anew", "graph", lambda graph: graph.relinearise()),
            ("batch", "graph-batch", lambda graph: None),
        ):
            graph = replay(run, name, options).scenario.backend
            assert isinstance(graph, Graph)
            prepare(graph)
            table.add_row(words, *(f"{value:.4f}" for value in differences(graph).values()))
        plain_console().print(table)


if __name__ == "__main__":
    run_study(GraphStudy)
