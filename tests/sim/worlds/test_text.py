"""Names and labels are text: whatever bytes a file holds, what comes in can be printed, drawn and written."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.sim.worlds import WorldError, load
from chainslam.sim.worlds.text import LONGEST, name_of, printable

BOX = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0]]
STRANGE = "\ufffd"
CASES = {
    "surrogate": ("a\ud800b", f"a{STRANGE}b"),
    "escape": ("\x1b[2Jroom\x07", f"{STRANGE}[2Jroom{STRANGE}"),
    "c1 control": ("\x9b31mroom", f"{STRANGE}31mroom"),
    "lines": ("a\r\n b\tc", "a b c"),
    "written backwards": ("a\u202eb", f"a{STRANGE}b"),
    "not in XML": ("a\uffffb\x00", f"a{STRANGE}b{STRANGE}"),
    "other scripts": ("会议室 Süd ½ 👩\u200d🔬", "会议室 Süd ½ 👩\u200d🔬"),
    "mathematics": (r"$\alpha{$", r"$\alpha{$"),
}


@pytest.mark.parametrize("case", CASES)
def test_text_is_made_printable(case):
    given_text, shown = CASES[case]
    assert printable(given_text) == shown
    assert name_of(given_text) == shown


@settings(max_examples=200, deadline=None, database=None)
@given(st.text(st.characters(), max_size=100))
def test_any_name_is_one_line_that_utf8_holds(text):
    name = name_of(text)
    assert name.encode()
    assert "\n" not in name
    assert 0 < len(name) <= LONGEST
    assert not any(ord(c) < 32 or 127 <= ord(c) < 160 for c in name)
    assert name_of(name) == name


def _label(tmp_path, text: str) -> list[str]:
    plan = {"walls": BOX, "start": [4, 3], "labels": {text: [1, 1]}}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [w[:2], w[2:]]}}
        for w in BOX
    ]
    features.append(
        {"type": "Feature", "properties": {"name": text}, "geometry": {"type": "Point", "coordinates": [1, 1]}}
    )
    (tmp_path / "plan.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return [name for kind in ("json", "geojson") for name in load(tmp_path / f"plan.{kind}").labels]


@pytest.mark.parametrize("case", CASES)
def test_labels_are_checked_at_the_door(tmp_path, case):
    given_text, shown = CASES[case]
    assert _label(tmp_path, given_text) == [shown, shown]


def test_labels_in_a_drawing_are_checked_too(tmp_path):
    mark = f'<circle id="label-{"x" * 500}" cx="1" cy="1" r="0.1" fill="none"/>'
    (tmp_path / "a.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg"><rect width="8" height="6" fill="none" stroke="black"/>{mark}</svg>'
    )
    assert [len(name) for name in load(tmp_path / "a.svg").labels] == [LONGEST]


def test_a_file_name_is_text_too(tmp_path):
    path = tmp_path / f"{'room ' * 30}$x$.json"
    path.write_text(json.dumps({"walls": BOX}))
    assert load(path).name == name_of(path.stem)


@pytest.mark.parametrize("name", ["a\udc80", "a\x1b[31m", "a\nb"])
def test_a_file_name_that_cannot_be_shown_is_refused(tmp_path, name):
    path = tmp_path / f"{name}.json"
    path.write_text(json.dumps({"walls": BOX}))
    with pytest.raises(WorldError, match="rename the file"):
        load(path)


def test_messages_never_steer_the_terminal():
    assert str(WorldError("expected a\x1b[2J, found\nb")) == f"expected a{STRANGE}[2J, found b"


def test_too_many_labels_are_refused(tmp_path):
    plan = {"walls": BOX, "labels": {str(i): [1, 1] for i in range(201)}}
    (tmp_path / "a.json").write_text(json.dumps(plan))
    with pytest.raises(WorldError, match="200 named points"):
        load(tmp_path / "a.json")
