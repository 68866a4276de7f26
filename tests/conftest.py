"""What all tests share."""

import signal
import time
from pathlib import Path

import jaxtyping
import pytest
from hypothesis import settings

# A kernel that is not in the cache yet compiles at its first example; no test is about time.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

BEGAN = pytest.StashKey[float]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what bounds the time of a run."""
    parser.addoption("--minutes", type=float, help="tests that have not begun after so many minutes are skipped")


def pytest_configure(config: pytest.Config) -> None:
    """Note when the run began."""
    config.stash[BEGAN] = time.monotonic()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what begins too late: on a slow machine a run that ends tells more than one that is cut off."""
    minutes = item.config.getoption("--minutes")
    if minutes is not None and time.monotonic() - item.config.stash[BEGAN] > 60.0 * minutes:
        pytest.skip(f"{minutes:g} minutes are over")


@pytest.fixture(scope="session", autouse=True)
def _interruptible():
    """Let Ctrl-C interrupt tests and what they start, though a shell script began them in the background (`&`)."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


WHOLE_RUNS = [
    Path(__file__).parent / place
    for place in (
        "explore/missions", "explore/floor/test_fence.py", "library", "studies", "experiments/artifacts",
        "experiments/campaign", "experiments/commands", "experiments/replays", "experiments/runs",
        "experiments/terminal", "experiments/test_range_errors_of_runs.py", "experiments/views/test_pictures.py",
        "experiments/views/test_player.py", "experiments/views/test_run_page.py", "experiments/views/test_timelines.py",
    )
]  # fmt: skip
"""Tests whose time goes into whole runs: the parts of a run are tested with shape checks elsewhere."""


@pytest.fixture(scope="module", autouse=True)
def _whole_runs_unchecked(request):
    """Leave out the shape checks that pytest adds, which are a third of the time of a run."""
    jaxtyping.config.update("jaxtyping_disable", any(request.path.is_relative_to(each) for each in WHOLE_RUNS))
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def _unchecked():
    """Run without the shape checks that pytest adds, where a whole mission is driven."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)
