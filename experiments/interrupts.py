"""Ctrl-C as a wish to stop: the step in hand is finished, so that map, covariance and log belong together."""

import gc
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def first_interrupt_waits() -> Iterator[Callable[[], None]]:
    """Keep the first Ctrl-C until the yielded function is called, which raises it as KeyboardInterrupt.

    A second one is raised at once, wherever the program is. Outside the main thread nothing is changed, nor where
    Ctrl-C is ignored: a shell script starts so what is to run in the background, whatever is stopped in front of it.
    """
    asked = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked = True
        signal.signal(signal.SIGINT, before)

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    ignored = signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    if ignored or threading.current_thread() is not threading.main_thread():
        yield check
        return
    before = signal.signal(signal.SIGINT, note)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def nothing_half_built_speaks() -> Iterator[None]:
    """Let Ctrl-C leave objects half built in silence: what their finalizers then raise, Python would print.

    Outside the main thread nothing is changed, nor where Ctrl-C does something else than raise KeyboardInterrupt.
    """
    hook, interrupted = sys.unraisablehook, False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        sys.unraisablehook = lambda _: None
        signal.default_int_handler(number, frame)

    other = signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    if other or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if interrupted:
            gc.collect()
        sys.unraisablehook = hook
