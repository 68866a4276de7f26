"""Ctrl-C as a wish to stop: the step in hand is finished, so that map, covariance and log belong together."""

import signal
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
