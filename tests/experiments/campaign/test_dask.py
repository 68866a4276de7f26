"""A real scheduler and two worker processes on the loopback: the same table, also when a worker is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from itertools import count
from types import SimpleNamespace
from unittest.mock import MagicMock

import distributed
import pytest
from distributed.comm import CommClosedError

from chainslam.experiments.campaign import cluster as of_dask
from chainslam.experiments.campaign.cluster import on_dask
from chainslam.experiments.campaign.comparison.tables import TIMINGS, trial_row
from chainslam.experiments.campaign.plan import Campaign, trials
from chainslam.experiments.campaign.runner import on_cores, run_campaign
from chainslam.experiments.campaign.store import Store, opened
from chainslam.experiments.commands.cli import main

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


WITHOUT_PACKAGE = """
import sys
class Blind:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "chainslam":
            raise ModuleNotFoundError("No module named 'chainslam'")
sys.meta_path.insert(0, Blind())
"""


@pytest.fixture
def started(tmp_path):
    """Start a scheduler, and return its address, its process and what starts a worker."""
    file, processes = tmp_path / "scheduler.json", []

    def start(kind, *words, **more):
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words, "--no-dashboard"]
        environment = os.environ | more
        processes.append(
            subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
        )
        return processes[-1]

    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
    while not file.exists():
        assert scheduler.poll() is None
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]
    yield address, scheduler, lambda **more: start("worker", address, "--nthreads", "1", "--no-nanny", **more)
    for process in processes:
        process.kill()
        process.wait()


def compared(address, folder, trials=1):
    words = ["--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--modes", "closed"]
    more = ["--trials", str(trials), "--max-steps", "25", "--dask", address, "--out", str(folder)]
    return main(["compare", *words, *more])


def told_in_one_line(capsys, found):
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("chainslam: expected ")
    assert found in line
    assert "finished trials are kept" in line


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_a_scheduler_without_a_worker_is_told(started, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(of_dask, "WAIT_S", 1.0)
    assert compared(started[0], tmp_path / "out") == 1
    told_in_one_line(capsys, "found none in 1 s")


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_a_worker_without_this_package_is_told(started, tmp_path, capsys):
    address, _, worker = started
    (tmp_path / "blind").mkdir()
    (tmp_path / "blind" / "sitecustomize.py").write_text(WITHOUT_PACKAGE)
    worker(PYTHONPATH=str(tmp_path / "blind"))
    assert compared(address, tmp_path / "out") == 1
    told_in_one_line(capsys, "No module named 'chainslam'")


@pytest.mark.long
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("killed", ["scheduler", "worker"])
def test_what_is_finished_is_kept_when_the_cluster_dies(started, tmp_path, capsys, monkeypatch, killed):
    monkeypatch.setattr(of_dask, "WAIT_S", 3.0)
    address, scheduler, worker = started
    victim = {"worker": worker(), "scheduler": scheduler}[killed]
    save = Store.save

    def killing(store, done):
        save(store, done)
        victim.kill()

    monkeypatch.setattr(Store, "save", killing)
    assert compared(address, tmp_path / "out", 6) == 1
    told_in_one_line(capsys, "found it gone" if killed == "scheduler" else "found none in 3 s")
    assert len(list((tmp_path / "out" / "trials").rglob("*.npz"))) >= 1


def test_a_closed_connection_is_a_scheduler_gone_though_the_client_has_not_noticed():
    def closed():
        raise CommClosedError("the stream is closed")
        yield

    client = SimpleNamespace(status="running")
    with pytest.raises(of_dask.ClusterError, match="found it gone"):
        list(of_dask._guarded(client, "tcp://127.0.0.1:1", closed()))


def test_a_connection_that_closes_under_a_result_is_no_worker_without_the_package(monkeypatch):
    def closed():
        raise CommClosedError("the stream is closed")

    client = SimpleNamespace(
        wait_for_workers=lambda count, timeout: None,
        run=lambda asked: {"worker": asked()},
        nthreads=lambda: {"worker": 1},
        submit=lambda *job, pure: MagicMock(result=closed),
    )
    monkeypatch.setattr(of_dask, "_some_done", lambda client, address, futures: futures)
    with pytest.raises(CommClosedError):
        list(of_dask._perform_all(client, "tcp://127.0.0.1:1", print, [None]))
