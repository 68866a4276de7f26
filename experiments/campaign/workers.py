"""Tasks in local processes: a process that dies costs its task one attempt and no other task anything."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import TypeVar

from joblib import Parallel, delayed
from joblib.externals.loky.backend.resource_tracker import ensure_running
from joblib.externals.loky.process_executor import TerminatedWorkerError

STRIKES = 3
"""A task whose process dies this often is given up."""
Task = TypeVar("Task")
Result = TypeVar("Result")


def on_workers(
    perform: Callable[[Task], Result], lost: Callable[[Task, str], Result], count: int | None = None
) -> Callable[[Iterable[Task]], Iterator[Result]]:
    """Return what performs tasks in `count` processes, or one for each core, and yields each result as it comes.

    A task is taken up only when there is room for it. `lost` gives the result of one whose process died too often.
    """
    workers = count or len(os.sched_getaffinity(0))

    def execute(tasks: Iterable[Task]) -> Iterator[Result]:
        deaf_tracker()
        waiting, strikes = enumerate(tasks), dict[int, int]()
        again: list[tuple[int, Task]] = []
        while True:
            at_work: dict[int, Task] = {}

            def taken(
                at_work: dict[int, Task] = at_work, first: tuple[tuple[int, Task], ...] = tuple(again)
            ) -> Iterator[tuple[int, Task]]:
                for number, task in chain(first, waiting):
                    at_work[number] = task
                    yield number, task

            try:
                parallel = Parallel(workers, return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
                for number, result in parallel(delayed(_numbered)(perform, *each) for each in taken()):
                    del at_work[number]
                    yield result
                return
            except TerminatedWorkerError:
                again = []
                for number, task in at_work.items():
                    strikes[number] = strikes.get(number, 0) + 1
                    if strikes[number] < STRIKES:
                        again.append((number, task))
                    else:
                        yield lost(task, f"its process died {STRIKES} times")

    return execute


def _numbered(perform: Callable[[Task], Result], number: int, task: Task) -> tuple[int, Result]:
    return number, perform(task)


def deaf_tracker() -> None:
    """Start loky's resource tracker deaf to SIGHUP, as it is to Ctrl-C and SIGTERM: it cleans up after its parent.

    Killed with its terminal it would be begun anew, and complain about all that it knows nothing of.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGHUP])
    try:
        ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
