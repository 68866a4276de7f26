"""A real scheduler and two worker processes on the loopback: the same table, also when a worker is killed."""

import os
import signal
from itertools import count

import distributed
import pytest

from experiments.campaign.plan import Campaign, trials
from experiments.campaign.runner import on_cores, on_dask, run_campaign
from experiments.campaign.store import opened
from experiments.campaign.tables import TIMINGS, trial_row

CAMPAIGN = Campaign(("paper-fig4",), ("full-ekf",), ("nearest-robot",), 2, max_steps=15)


@pytest.fixture
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=50
    ) as made:
        yield made


def rows(folder, executor):
    with opened(folder, CAMPAIGN) as store:
        run_campaign(store, executor)
        found = [trial_row(store.record(trial)) for trial in trials(CAMPAIGN)]
    return [{key: value for key, value in row.items() if not key.startswith(TIMINGS)} for row in found]


@pytest.mark.filterwarnings("default")  # of the cluster's own threads, at its end
def test_a_cluster_gives_the_same_rows_and_so_does_one_that_loses_a_worker(cluster, tmp_path):
    executor, killed = on_dask(cluster.scheduler_address), count()

    def unlucky(jobs):
        for done in executor(jobs):
            if next(killed) == 0:
                os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
            yield done

    expected = rows(tmp_path / "cores", on_cores(1))
    assert rows(tmp_path / "dask", unlucky) == expected
    assert next(killed) > 1
