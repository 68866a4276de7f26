"""Whatever a file holds, load gives a valid World or refuses it: properties over drawn and damaged files."""

import contextlib
import json

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from chainslam.sim.worlds import World, WorldError, load
from tests.sim.worlds.test_bad_input import BOX, NS, ROOM, _geo, _plan

QUICK = settings(
    max_examples=60, deadline=None, database=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def _survives(path, content: bytes) -> None:
    path.write_bytes(content)
    with contextlib.suppress(WorldError):
        world = load(path)
        assert isinstance(world, World)
        assert world.free.is_valid


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-20, 20) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=12,
)
KINDS = st.sampled_from(["LineString", "Polygon", "MultiPolygon", "Feature", "FeatureCollection", "Point", "Ball"])
KEYS = st.sampled_from(["walls", "start", "labels", "type", "coordinates", "features", "geometry", "properties", "crs"])


@QUICK
@given(document=st.dictionaries(KEYS, VALUES | KINDS, max_size=6))
def test_any_json_is_survived(tmp_path, document):
    _survives(tmp_path / "any.json", json.dumps(document).encode())


@QUICK
@given(
    walls=st.lists(st.lists(st.floats(-30, 30), min_size=4, max_size=4), max_size=12),
    ring=st.lists(st.tuples(st.floats(-5, 15), st.floats(-5, 15)), min_size=4, max_size=9),
)
def test_any_scribble_is_survived(tmp_path, walls, ring):
    _survives(tmp_path / "walls.json", json.dumps({"walls": BOX + walls}).encode())
    _survives(tmp_path / "ring.json", json.dumps({"type": "Polygon", "coordinates": [ring]}).encode())
    points = " ".join(f"{x},{y}" for x, y in ring)
    shape = f'<polygon points="{points}"/><polyline points="{points}" stroke="black" fill="none"/>'
    _survives(tmp_path / "ring.svg", f'<svg {NS} data-metres-per-unit="1">{ROOM}{shape}</svg>'.encode())


@QUICK
@given(data=st.data(), suffix=st.sampled_from(["json", "svg", "png", "pgm", "yaml", "geojson"]))
def test_any_damage_is_survived(tmp_path, data, suffix):
    if suffix in ("png", "pgm"):
        image = np.full((40, 40), 255, dtype=np.uint8)
        image[0], image[-1], image[:, 0], image[:, -1] = 0, 0, 0, 0
        Image.fromarray(image).save(tmp_path / f"good.{suffix}")
        good = (tmp_path / f"good.{suffix}").read_bytes()
    else:
        good = {
            "json": _plan(),
            "geojson": _geo("LineString", [[0, 0], [8, 0], [8, 6], [0, 0]]),
            "svg": f'<svg {NS} viewBox="0 0 9 9"><g transform="scale(1.5) rotate(3)">{ROOM}</g></svg>',
            "yaml": "image: good.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\nfree_thresh: 0.2\n",
        }[suffix].encode()
    broken = bytearray(good)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(broken) - 1))
        broken[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    _survives(tmp_path / f"any.{suffix}", bytes(broken))
