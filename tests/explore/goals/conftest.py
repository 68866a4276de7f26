"""The explorer's two kinds of errand as scripts, and a place for them."""

import pytest

from chainslam.explore.goals import explorer as module
from tests.explore.goals.scripted import Scripted


@pytest.fixture
def scripted(monkeypatch):
    """The two kinds of errand, each a script."""
    made = []
    kinds = {name: type(name, (Scripted,), {"made": made}) for name in ("EndErrand", "PlaceErrand")}
    for name, kind in kinds.items():
        monkeypatch.setattr(module, name, kind)
    return kinds, made


@pytest.fixture
def scene(scene_of):
    return scene_of(3)
