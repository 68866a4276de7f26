"""A run whose estimator finds no solution any more ends as failed, with all that it has computed."""

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.without_truth.smoothing import smooth
from chainslam.experiments.trial import run_trial
from chainslam.slam.backends.graph.isam import Isam
from chainslam.slam.robot import ScannerSpec


@pytest.mark.parametrize("backend", ["graph", "graph-batch"])
def test_a_run_that_no_solver_can_go_on_with_keeps_all_its_results(backend, monkeypatch):
    push = Isam._push

    def fails(self):
        if sum(len(line.observations) for line in self._record.lines.values()) > 150:
            raise RuntimeError("Indeterminate linear system detected")
        return push(self)

    monkeypatch.setattr(Isam, "_push", fails)
    result = run_trial(TrialConfig("rooms", backend, seed=1, max_steps=200))
    assert result.summary["status"] == "failed"
    assert result.summary["reason"].startswith("ContradictionError: expected a least-squares solution of")
    assert result.log is not None
    assert result.summary["steps"] == len(result.log) >= 10
    assert result.summary["lost_steps"] >= 2
    assert result.summary["pose_anees"] > 0.0
    assert result.summary["lines"] > 0
    assert len(result.scenario.backend.belief.ids) > 0
    assert len(result.scenario.backend.trajectory()) >= len(result.log)


class Broken:
    """A smoother that does not even tell what it believes."""

    @property
    def belief(self):
        raise RuntimeError("no solution")

    def finish(self):
        raise RuntimeError("no solution")

    predict = update = grow = merge = remove = finish


def test_a_smoother_that_broke_down_costs_no_results():
    assert smooth(Broken(), None, np.zeros(3, dtype=bool), ScannerSpec()) is None
