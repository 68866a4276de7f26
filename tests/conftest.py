"""What all tests share."""

import jaxtyping
import pytest


@pytest.fixture
def _unchecked():
    """Run without the shape checks that pytest adds, where a whole mission is driven."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
