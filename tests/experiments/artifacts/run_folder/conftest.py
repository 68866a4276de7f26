"""What a run of eight steps leaves that nothing disturbed."""

import jaxtyping
import pytest

from chainslam.experiments.commands.cli import main
from tests.experiments.artifacts.run_folder.striking import WORDS


@pytest.fixture(autouse=True, scope="module")
def _fast():
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """What an undisturbed run of eight steps leaves."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert main([*WORDS, "--max-steps", "8", "--out", str(folder)]) == 0
    return folder
