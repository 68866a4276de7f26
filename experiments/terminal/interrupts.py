"""Ctrl-C, SIGTERM and SIGHUP as a wish to stop: the step in hand is finished, so that all results belong together."""

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
"""The signals that ask a command to stop, and what a person calls them."""


@contextmanager
def first_interrupt_waits() -> Iterator[Callable[[], None]]:
    """Keep the first of the signals until the yielded function is called, which raises it as KeyboardInterrupt.

    A second one does what it did before, wherever the program is: it stops at once. Outside the main thread nothing
    is changed, nor where a signal is ignored: a shell script starts so what is to run in the background, whatever is
    stopped in front of it, and `nohup` what is to outlive its terminal.
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
    """Let the signals leave objects half built in silence: what their finalizers then raise, Python would print.

    SIGTERM and SIGHUP raise KeyboardInterrupt, too, as long as the block runs. Outside the main thread nothing is
    changed, nor where a signal does something else than it does by itself.
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
    """Ignore the signals from now on: all is done, and one that comes while Python ends would change the status."""
    _set(dict.fromkeys(STOPS, signal.SIG_IGN))


def _set(handlers: dict[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
