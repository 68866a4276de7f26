"""The fuzzer sees what it is there to see: tracebacks, silence, dead processes; and goes on with what is left."""

import os

import pytest

from tests.fuzzing import child
from tests.fuzzing.child import run_all


def fails(words):
    raise ZeroDivisionError("a fault of the program")


def dies(words):
    os._exit(3)


def is_silent(words):
    return 2


@pytest.mark.parametrize(
    ("main", "found"),
    [(fails, "a traceback"), (dies, "status None"), (is_silent, "a silent failure"), (None, None)],
)
def test_what_is_not_borne_is_seen_and_the_next_command_has_its_turn(main, found, tmp_path, monkeypatch):
    real = child.main
    monkeypatch.setattr(child, "main", lambda words: main(words) if main and words == ["spoilt"] else real(words))
    folders = [tmp_path / name for name in ("a", "b")]
    for folder in folders:
        folder.mkdir()
    first, second = run_all([(["spoilt"], folders[0]), (["backends"], folders[1])])
    assert (second.status, second.said, second.faults) == (0, "", [])
    if found is None:
        assert (first.status, first.faults) == (2, [])
    else:
        assert any(found in fault for fault in first.faults)
