"""Cost of one prediction and one joint update with ten lines seen, by the size of the map."""

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import normals
from chainslam.slam.robot import Odometry

SEEN = 10


@pytest.mark.parametrize("lines", [50, 200, 1000])
def test_predict_and_update(benchmark: BenchmarkFixture, lines: int) -> None:
    """The robot stands and sees the first ten lines again and again."""
    rng = np.random.default_rng(1)
    pose_cov, cov = np.diag([0.01, 0.01, 0.002]) ** 2, np.tile(np.diag([0.004, 0.004]) ** 2, (lines, 1, 1))
    seen = np.column_stack([rng.uniform(-np.pi, np.pi, lines), rng.uniform(0.5, 4.0, lines)])
    backend = FullEkf(np.zeros(3), pose_cov)
    ids = backend.grow(seen, cov, seen[:, 1:] * normals(seen[:, 0]))
    odometry = Odometry(np.zeros(3), 1e-6 * np.eye(3))
    observed = Observations(ids[:SEEN], seen[:SEEN], cov[:SEEN])

    def step() -> None:
        backend.predict(odometry)
        backend.update(observed, observed)

    benchmark(step)
