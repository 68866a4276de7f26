"""Trials on the workers of a Dask scheduler; every failure of the cluster is reported in one line."""

import logging
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from importlib.metadata import version
from itertools import islice
from time import monotonic
from typing import Any

from ..usage import UsageError, missing
from .plugins import with_own
from .runner import Executor, lost
from .work import Done, Job, perform

WAIT_S = 30.0
"""How long a scheduler may be without workers."""
LOOK_S = 2.0
"""How often it is asked for workers."""
AT_ONCE = 2
"""Jobs queued for each thread of a worker, so that it does not wait for the next one."""


class ClusterError(RuntimeError):
    """A cluster that cannot continue: what was expected, what was found, what to do."""


def on_dask(address: str) -> Executor:
    """Return an executor over the workers of a Dask scheduler; raises UsageError without one.

    The executor raises ClusterError if the scheduler disappears, no worker connects, or a worker cannot run a trial.
    """
    try:
        import distributed
    except ImportError as error:
        raise missing(error) from error
    for name in ("distributed", *(name for name in logging.root.manager.loggerDict if name.startswith("distributed"))):
        # Their messages about a lost connection are replaced by one line of ours.
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        client = distributed.Client(address, timeout=5, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise UsageError(f"expected a Dask scheduler at {address}, found none: start `dask scheduler` first") from error
    performs = with_own(perform)
    return lambda jobs: _guarded(client, address, _perform_all(client, address, performs, jobs))


def program() -> str:
    """Return the version of this package, which every worker that has it can report."""
    return version("chainslam")


def _guarded(client: Any, address: str, performed: Iterator[Done]) -> Iterator[Done]:
    """Run the jobs, and raise ClusterError in place of whatever a failing cluster raises."""
    from distributed.comm import CommClosedError

    try:
        yield from performed
    except (CancelledError, OSError, RuntimeError) as error:
        # The client may go on calling itself running for a while after its connection has closed.
        is_gone = isinstance(error, CommClosedError) or client.status != "running"
        if isinstance(error, ClusterError) or not is_gone:
            raise
        raise ClusterError(
            f"expected the Dask scheduler at {address} to keep running, found it gone: start it and its workers again"
        ) from error


def _perform_all(client: Any, address: str, performs: Callable[[Job], Done], jobs: Iterable[Job]) -> Iterator[Done]:
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    _check(client, address)
    waiting, sent = iter(jobs), dict[Any, Job]()

    def send(count: int) -> None:
        sent.update({client.submit(performs, job, pure=False): job for job in islice(waiting, count)})

    send(AT_ONCE * max(sum(client.nthreads().values()), 1))
    while sent:
        for future in _some_done(client, address, list(sent)):
            job = sent.pop(future)
            try:
                done = future.result()
            except KilledWorker as error:
                done = lost(job, f"its worker died: {error}")
            except (CancelledError, CommClosedError):
                raise
            except Exception as error:  # errors of the trial itself are in its record
                raise _unable(address, error) from error
            send(1)
            yield done


def _check(client: Any, address: str) -> None:
    """Raise ClusterError if no worker connects, or a worker lacks this package."""
    try:
        client.wait_for_workers(1, timeout=WAIT_S)
    except TimeoutError as error:
        raise _alone(address) from error
    try:
        found = set(client.run(program).values())
    except Exception as error:  # a worker's ImportError arrives as a plain Exception
        raise _unable(address, error) from error
    if found != {program()}:
        raise _unable(address, f"version {', '.join(sorted(found))}, not {program()}")


def _some_done(client: Any, address: str, futures: list[Any]) -> list[Any]:
    """Return the finished jobs, waiting for at least one; raises ClusterError without workers for `WAIT_S`."""
    from distributed import wait

    alone_since = None
    while True:
        try:
            with client.as_current():
                return list(wait(futures, timeout=LOOK_S, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            if client.nthreads():
                alone_since = None
                continue
            alone_since = alone_since or monotonic()
            if monotonic() - alone_since > WAIT_S:
                raise _alone(address) from None


def _alone(address: str) -> ClusterError:
    return ClusterError(
        f"expected a worker at the Dask scheduler {address}, found none in {WAIT_S:g} s: start `dask worker {address}`"
    )


def _unable(address: str, why: object) -> ClusterError:
    return ClusterError(
        f"expected workers and a scheduler at {address} with this package, found {why}: install it there"
    )
