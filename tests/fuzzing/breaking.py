"""Ways to break a file: its bytes, its JSON, its arrays, or what stands in its place."""

import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Rng = np.random.Generator
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2, 7, 10**9, -(10**9), 10**17, 0.5, -0.0, 1e-300, 1e300, -1e300, 5e-324),
    *(
        "",
        "x",
        "0",
        "full-ekf",
        "paper-fig8",
        "../../x",
        "a\x1b[31m",
        "\ud800",
        "\x00",
        "$\\alpha{$",
        "é" * 50,
        "x" * 9999,
    ),
    *([], {}, [[]], [None], {"a": 1}, [1, 2, 3], [[0.0, 0.0]], {"value": None}),
)
WHOLE = (
    *(b"", b"[]", b"{}", b"null", b"0", b'"x"', b"NaN", b'{"campaign": null}', b'{"format": 1}', b'{"format": null}'),
    *(b"[" * 100_000, b'{"a":' * 5000, b'{"format": 1' + b"0" * 400 + b"}", b'{"format": -Infinity}', b"\xff\xfe\x00"),
    *(b'{"format": 1, "trial": []}', b'{"format": 1, "campaign": []}', b'{"format": 1, "merged": []}', b"\x93NUMPY"),
    *(
        b'{"format": 1, "merged": null, "worlds_sha256": {}}',
        bytes(100_000),
        b"PK\x03\x04",
        b"PAR1" + bytes(50) + b"PAR1",
    ),
)


def broken(rng: Rng, path: Path) -> None:
    """Break a file in one way or, at times, in a few."""
    kinds = [_bytes, _whole, _place]
    if path.suffix in (".json", ".geojson"):
        kinds += [_json] * 9
    if path.suffix == ".npz":
        kinds += [_arrays] * 9
    pick(rng, kinds)(rng, path)


def pick(rng: Rng, items: Any) -> Any:
    """Return one of some things."""
    return items[int(rng.integers(len(items)))]


def _whole(rng: Rng, path: Path) -> None:
    path.write_bytes(pick(rng, WHOLE))


def _bytes(rng: Rng, path: Path) -> None:
    content = bytearray(path.read_bytes())
    ways: list[Callable[[], Any]] = [
        lambda: content.__delitem__(slice(int(rng.integers(len(content) + 1)), None)),
        lambda: content.extend(rng.bytes(50)),
        lambda: content.__setitem__(slice(0, 0), rng.bytes(10)),
    ]
    if content:
        at = int(rng.integers(len(content)))
        ways += [
            lambda: content.__setitem__(slice(at, at + 1), bytes([int(rng.integers(256))])),
            lambda: content.__delitem__(slice(at, at + int(rng.integers(1, 100)))),
            lambda: content.__setitem__(slice(at, at + 40), rng.bytes(40)),
            lambda: content.__setitem__(slice(at, at), content[at : at + 200]),
        ]
    for _ in range(int(rng.integers(1, 4))):
        pick(rng, ways)()
    path.write_bytes(content)


def _place(rng: Rng, path: Path) -> None:
    """Put something else than a file where it was."""
    path.unlink()
    ways: list[Callable[[], Any]] = [
        lambda: None,
        path.mkdir,
        lambda: path.symlink_to(path),
        lambda: path.symlink_to("nothing"),
        lambda: path.symlink_to("/dev/zero"),
        lambda: path.symlink_to("/proc/self/mem"),
        lambda: path.symlink_to("a" * 300),
        lambda: os.mkfifo(path),
    ]
    pick(rng, ways)()


def _json(rng: Rng, path: Path) -> None:
    said = json.loads(path.read_text())
    for _ in range(int(rng.choice([1, 1, 1, 2, 5]))):
        said = changed(rng, said)
    text = json.dumps(said)
    if rng.random() < 0.1:
        text = text.replace("0", pick(rng, ["NaN", "1e999", "9" * 400, "-Infinity", "1e-999", "[" * 2000]), 1)
    path.write_text(text)


def changed(rng: Rng, value: Any) -> Any:
    """Return a JSON value with something in it changed: near the top or deep down, with like chances."""
    if isinstance(value, dict | list) and value and rng.random() < 0.85:
        keys = list(value) if isinstance(value, dict) else range(len(value))
        key = pick(rng, keys)
        act = rng.random()
        if act < 0.7:
            value[key] = changed(rng, value[key])
        elif act < 0.85:
            del value[key]
        elif isinstance(value, dict):
            value[str(pick(rng, ("more", "", "trial", "format", key + "x")))] = value[key]
        else:
            value.append(value[key])
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.3:
        return value * pick(rng, (-1, 0, 2, 1e3, 1e-3)) + pick(rng, (0, 1, -1))
    return json.loads(json.dumps(pick(rng, VALUES)))


def _arrays(rng: Rng, path: Path) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    name = pick(rng, sorted(arrays))
    value = arrays[name]
    if rng.random() < 0.1:
        _crafted(rng, path, arrays, name)
        return
    numbers = value.dtype.kind in "fiub"
    ways: list[Callable[[], Any]] = [
        lambda: None,
        lambda: np.float64(1.0),
        lambda: value[..., None],
        lambda: value.ravel()[:-1],
        lambda: np.zeros((0,) * max(value.ndim, 1)),
        lambda: np.full(value.shape, "words"),
        lambda: np.full(value.shape, b"words"),
        lambda: np.full(value.shape, None),
        lambda: np.full(value.shape, 1j),
        lambda: np.full(value.shape, np.datetime64("2020-01-01")),
        lambda: value.T,
        lambda: np.broadcast_to(np.int8(1), value.shape).copy(),
        lambda: np.full(value.shape, True),
    ]
    if numbers:
        many = np.array(value, dtype=np.float64)
        ways += [
            lambda: 0 * many,
            lambda: -many,
            lambda: many * pick(rng, (1e-300, 1e-9, 0.1, 2, 1e3, 1e9, 1e300)),
            lambda: many + pick(rng, (1e-9, 0.01, 1, -1, 1e6)),
            lambda: many + rng.normal(size=value.shape) * pick(rng, (1e-6, 0.01, 1, 100)),
            lambda: many[::-1] if value.ndim else many,
            lambda: _one(rng, many, pick(rng, (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e18, 1e300))),
            lambda: _one(rng, many, pick(rng, (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e18, 1e300))),
            lambda: _one(rng, many, float(rng.normal())),
            lambda: value.astype(pick(rng, ("f2", "f4", ">f8", "i8", "i1", "u8", "g"))),
        ]
    with np.errstate(all="ignore"):
        made = pick(rng, ways)()
    if made is None and rng.random() < 0.5:
        arrays["another"] = np.array([None])
    elif made is None:
        del arrays[name]
    else:
        arrays[name] = made
    np.savez_compressed(path, **arrays)


def _one(rng: Rng, many: np.ndarray, number: float) -> np.ndarray:
    if many.size:
        many.flat[int(rng.integers(many.size))] = number
    return many


def _crafted(rng: Rng, path: Path, arrays: dict[str, np.ndarray], name: str) -> None:
    """Write one array whose header says what it likes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for other, value in arrays.items():
            stream = io.BytesIO()
            if other == name:
                shape = pick(rng, ("(1000000000, 1000000000)", "(-1,)", "(" * 3000, "(0,)", "(3,", "None", "(2**70,)"))
                descr = pick(rng, ("'<f8'", "'|O'", "'<U1'", "[('a', '<f8')]", "'f8', 'x': 1", "''", "'V99999999999'"))
                text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
                version = pick(rng, (b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x09"))
                size = len(text).to_bytes(2 if version == b"\x01\x00" else 4, "little")
                stream.write(b"\x93NUMPY" + version + size + text + bytes(int(pick(rng, (0, 8, 10**7)))))
            else:
                np.save(stream, value)
            archive.writestr(f"{other}.npy", stream.getvalue())
