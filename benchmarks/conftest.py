"""Linear algebra on one thread, as the command line has it, and no checks of shapes, which cost more than the loops."""

from collections.abc import Iterator

import jaxtyping
import pytest

import chainslam.experiments  # noqa: F401  # before scipy is loaded: a second thread waits for its turn on a busy machine


@pytest.fixture(autouse=True)
def _unchecked() -> Iterator[None]:
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
