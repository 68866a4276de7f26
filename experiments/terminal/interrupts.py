"""Ctrl-C, SIGTERM and SIGHUP as requests to stop: the current step is finished, so that all results are consistent."""

import gc
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

INTERRUPTED = 130
"""The exit status of a command that was asked to stop."""
STOPS = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP"}
"""The signals that request a stop, and their names for the user."""


@contextmanager
def first_interrupt_waits() -> Iterator[Callable[[], None]]:
    """Defer the first signal until the yielded function is called, which raises it as KeyboardInterrupt.

    A second signal acts at once, as usual. Nothing is changed outside the main thread, nor for signals that are
    ignored: shell scripts ignore SIGINT for background jobs, and `nohup` ignores SIGHUP.
    """
    asked: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        _set(before)

    def check() -> None:
        if asked:
            raise KeyboardInterrupt(STOPS[signal.Signals(asked[0])])

    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: handler for number in STOPS if (handler := signal.getsignal(number)) != signal.SIG_IGN}
    try:
        _set(dict.fromkeys(before, note))
        yield check
    finally:
        _set(before)


@contextmanager
def nothing_half_built_speaks() -> Iterator[None]:
    """Suppress messages from finalizers of objects that a signal left half built, which Python would print.

    While the block runs, SIGTERM and SIGHUP also raise KeyboardInterrupt. Nothing is changed outside the main thread,
    nor for signals with a handler of their own.
    """
    hook, interrupted = sys.unraisablehook, False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        sys.unraisablehook = lambda _: None
        raise KeyboardInterrupt(STOPS[signal.Signals(number)])

    usual = (signal.default_int_handler, signal.SIG_DFL)
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: handler for number in STOPS if (handler := signal.getsignal(number)) in usual}
    try:
        _set(dict.fromkeys(before, interrupt))
        yield
    finally:
        _set(before)
        if interrupted:
            gc.collect()
        if before:
            sys.unraisablehook = hook


def too_late() -> None:
    """Ignore the signals from now on: everything is finished, and a late signal would change the exit status."""
    _set(dict.fromkeys(STOPS, signal.SIG_IGN))


def _set(handlers: dict[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
