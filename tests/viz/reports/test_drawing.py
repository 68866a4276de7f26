"""A drawing from a file that anybody may have made, inside a page."""

import pytest

from chainslam.viz.reports.drawing import drawing

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4 3">'
BAD = {
    "a script": "<script>alert(1)</script>",
    "an event": '<path d="M0,0 L1,1" onclick="alert(1)"/>',
    "an address": '<image href="http://example.org/x.png"/><a href="javascript:alert(1)"><path d="M0,0"/></a>',
    "a style": "<style>@import url(http://example.org/x.css);</style>",
    "a foreign object": "<foreignObject><body onload='alert(1)'/></foreignObject>",
    "a fill from elsewhere": '<circle r="1" fill="url(http://example.org/x)"/>',
}


def test_shapes_and_words_are_shown_as_they_are():
    shown = drawing(
        f'{HEAD}<path d="M0,0 L1,2" stroke="#123456"/><text x="1">6.5 &lt; 7</text></svg>'.encode(), "a wall"
    )
    assert 'viewBox="0 0 4 3"' in shown.svg
    assert 'd="M0,0 L1,2" stroke="#123456"' in shown.svg
    assert "6.5 &lt; 7</text>" in shown.svg
    assert shown.caption == "a wall"


@pytest.mark.parametrize("inside", BAD.values(), ids=BAD)
def test_what_could_run_or_fetch_is_left_out(inside):
    shown = drawing(f"{HEAD}{inside}</svg>".encode(), "").svg
    assert not [word for word in ("script", "alert", "example.org", "onclick", "onload", "style") if word in shown]


@pytest.mark.parametrize(
    "data",
    [b"", b"<svg", b"<html/>", b"<svg/>", b'<!DOCTYPE x [<!ENTITY a "b">]><svg viewBox="0 0 1 1">&a;</svg>',
     f"{HEAD}{'<g>' * 20000}{'</g>' * 20000}</svg>".encode()],
    ids=["nothing", "cut short", "a page", "no view box", "entities", "nested too deep"],
)  # fmt: skip
def test_what_is_no_drawing_is_none(data):
    assert drawing(data, "") is None
