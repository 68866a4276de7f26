"""Thirteen steps made by hand, and what a campaign keeps of them."""

import numpy as np

from chainslam.experiments.campaign.scores.observer import Observer
from chainslam.experiments.campaign.scores.score import record_of
from chainslam.experiments.trial import TrialResult

N = 13
RNG = np.random.default_rng(12)
TRUE = np.column_stack([1.0 + 0.1 * np.arange(N), 1.0 + 0.02 * np.arange(N) ** 1.5, 0.3 * np.arange(N)])
OFF = np.column_stack([0.1 + 0.05 * RNG.normal(size=(N, 2)), 0.03 * RNG.normal(size=N)])
COVS = np.array([np.diag([0.01, 0.02, 0.003]) * (1.0 + 0.1 * k) for k in range(N)])
PATH = np.linspace(0.0, 12.0, N)
START_COV = np.diag([0.01, 0.01, np.deg2rad(2.0) ** 2])


def result_of(run):
    return TrialResult(run.scenario, run.ending, run.log, run.votes, run.step, run.joint, None, {"world": "square"})


def observer_of(run, **more):
    return Observer(run.votes.truth.walls, lambda index: run.log.face_of_beam[index], **more)


def kept(run, ear=None, **more):
    return record_of(result_of(run), observer_of(run, **more), ear)
