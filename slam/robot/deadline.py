"""Calls that may never return, on a thread of their own: whoever waits can act meanwhile, and gives up in time."""

import threading
import time
import weakref
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

Answer = TypeVar("Answer")


class Watched:
    """Makes calls one after another, all on one thread; a call that was given up leaves that thread behind."""

    def __init__(self) -> None:
        self._asked: SimpleQueue[Any] | None = None
        self._told: SimpleQueue[Any] = SimpleQueue()

    def call(self, ask: Callable[[], Answer], wait_s: float, every_s: float, meanwhile: Callable[[], None]) -> Answer:
        """Return what a call returns or raise what it raises; call `meanwhile` every so many seconds until then.

        Raises TimeoutError where it does not return in time.
        """
        if self._asked is None:
            self._begin()
        assert self._asked is not None
        asked, until = self._asked, time.monotonic() + wait_s
        self._asked = None
        asked.put(ask)
        try:
            while True:
                try:
                    answer, error = self._told.get(timeout=min(every_s, max(until - time.monotonic(), 0.0)))
                    break
                except Empty:
                    meanwhile()
                    if time.monotonic() >= until:
                        raise TimeoutError from None
        except BaseException:
            asked.put(None)
            raise
        self._asked = asked
        if error is not None:
            raise error
        return answer

    def _begin(self) -> None:
        self._asked, self._told = SimpleQueue(), SimpleQueue()
        threading.Thread(target=_answer, args=(self._asked, self._told), daemon=True).start()
        weakref.finalize(self, self._asked.put, None)


def _answer(asked: "SimpleQueue[Any]", told: "SimpleQueue[Any]") -> None:
    """Make the calls that are asked for, until None comes."""
    while (ask := asked.get()) is not None:
        try:
            told.put((ask(), None))
        except BaseException as error:
            told.put((None, error))
        del ask
