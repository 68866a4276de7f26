"""Cost of one predict and one update with ten lines seen, beside a bare rank-k update of the same size."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.linalg.blas import dsyrk

from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.robot import Odometry

SEEN = 10
EKFS = [name for name in BACKENDS if name.endswith("-ekf")]


def step_of(name: str, lines: int) -> tuple[Any, Callable[[], None]]:
    """Return a back end that knows so many lines, all correlated, and one step that sees ten of them."""
    rng = np.random.default_rng(0)
    alpha, r = rng.uniform(-np.pi, np.pi, lines), rng.uniform(1.0, 4.0, lines)
    t0 = rng.uniform(-1.0, 1.0, lines)
    turn = np.tile(np.eye(2), (lines, 1, 1))
    turn[:, 1, 0] = t0
    cov = turn @ np.diag([1e-4, 1e-5]) @ turn.swapaxes(1, 2)
    seen_lines = np.stack([alpha, r], axis=-1)
    backend = BACKENDS[name].make(np.zeros(3), np.diag([1e-4, 1e-4, 1e-6]))
    ids = backend.grow(seen_lines, cov, r[:, None] * normals(alpha) + t0[:, None] * directions(alpha))
    rows = np.sort(rng.choice(lines, SEEN, replace=False))
    seen = Observations(ids[rows], seen_lines[rows], cov[rows])
    odometry = Odometry(np.zeros(3), np.diag([1e-5, 1e-6, 1e-5]))

    def step() -> None:
        backend.predict(odometry)
        backend.update(seen, seen)

    return backend, step


@pytest.mark.parametrize("lines", [50, 200, 1000])
def test_bare_rank_k(benchmark: BenchmarkFixture, lines: int) -> None:
    """One triangle of a symmetric rank-20 update, in place: the least that an update can cost."""
    size = 3 + 2 * lines
    W = np.asfortranarray(1e-6 * np.random.default_rng(0).standard_normal((size, 2 * SEEN)))
    P = np.eye(size, order="F")
    benchmark(lambda: dsyrk(-1.0, W, beta=1.0, c=P, lower=1, overwrite_c=1))


@pytest.mark.parametrize("lines", [50, 200, 1000])
@pytest.mark.parametrize("name", EKFS)
def test_one_step(benchmark: BenchmarkFixture, name: str, lines: int) -> None:
    """A predict and an update; the full filter is to be near the bare update when it is large.

    The C++ EKF-SLAM of Debian's mrpt-apps takes 0.3 ms at 50 landmarks, and 13 ms at 202.
    """
    _, step = step_of(name, lines)
    benchmark(step)


@pytest.mark.parametrize("lines", [50, 200, 1000])
def test_asking_for_the_joint_of_ten_lines(benchmark: BenchmarkFixture, lines: int) -> None:
    """A fresh belief, and the joint covariance that gating asks for."""
    backend, _ = step_of("full-ekf", lines)
    far = Odometry(np.zeros(3), 1e-9 * np.eye(3))

    def ask() -> None:
        backend.predict(far)
        belief = backend.belief
        belief.joint(belief.ids[:SEEN])

    benchmark(ask)
