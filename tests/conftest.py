"""What all tests share."""

import signal

import jaxtyping
import pytest
from hypothesis import settings

# A kernel that is not in the cache yet compiles at its first example; no test is about time.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session", autouse=True)
def _interruptible():
    """Let Ctrl-C interrupt tests and what they start, though a shell script began them in the background (`&`)."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def _unchecked():
    """Run without the shape checks that pytest adds, where a whole mission is driven."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
