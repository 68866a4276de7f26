"""Archives that hold something else than they should are told apart before their numbers are read."""

import io
import os
import tokenize
import zipfile
import zlib

import numpy as np
import pytest

from chainslam.sim.logs import archive
from chainslam.sim.logs.archive import ArchiveError, read_archive

LAYOUT = {"ranges": "float s k", "time": "float s"}


def npz(path, **arrays):
    np.savez_compressed(path, **({"ranges": np.ones((3, 2)), "time": np.arange(3)} | arrays))
    return path


def member(shape, content=b"", descr="<f8"):
    """The bytes of an array that says of itself what it likes."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"shape": shape, "fortran_order": False, "descr": descr})
    return stream.getvalue() + content


def zipped(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members:
            file.writestr(name, content)
    return path


def test_arrays_come_back_as_they_were_in_one_type_and_order(tmp_path):
    ranges = np.asfortranarray(np.arange(6.0).reshape(3, 2)).astype(">f4")
    path = npz(tmp_path / "a.npz", ranges=ranges, extra=np.array([1 + 2j]), some=np.array([True]), word="naïve")
    found = read_archive(path, LAYOUT, {"some": "bool n", "none": "int", "word": "text"})
    assert found.keys() == {"ranges", "time", "some", "word"}
    whole = read_archive(npz(tmp_path / "b.npz", none=np.zeros(0, dtype=np.uint8)), {"time": "int s", "none": "int n"})
    assert {array.dtype for array in whole.values()} == {np.dtype(np.int64)}
    np.testing.assert_array_equal(found["ranges"], ranges)
    assert {found[name].dtype for name in LAYOUT} == {np.dtype(np.float64)}
    assert str(found["word"]) == "naïve"
    assert read_archive(path.read_bytes(), LAYOUT).keys() == LAYOUT.keys()


@pytest.mark.parametrize(
    ("arrays", "found"),
    [
        ({"ranges": np.ones((3, 2, 1))}, r"ranges of shape \(3, 2, 1\), not \(s, k\)"),
        ({"time": np.float64(3)}, r"time of shape \(\), not \(s\)"),
        ({"time": np.arange(4)}, "where s is 3"),
        ({"time": np.array(["a", "b", "c"])}, "time of type <U1, not float"),
        ({"time": np.array([1j, 2j, 3j])}, "time of type complex128"),
        ({"time": np.array([b"1", b"2", b"3"])}, r"time of type \|S1"),
        ({"time": np.array([object()] * 3)}, "time of type object"),
        ({"time": np.array([(1, 2)] * 3, dtype="i4,i4")}, "time of type"),
        ({"time": np.array(["2020-01-01"] * 3, dtype="M8[D]")}, "time of type datetime64"),
        ({"time": np.array([2**63] * 3, dtype=np.uint64)}, None),
    ],
)
def test_another_layout_is_told(tmp_path, arrays, found):
    path = npz(tmp_path / "a.npz", **arrays)
    if found is None:
        assert read_archive(path, LAYOUT)["time"][0] == 2.0**63
        with pytest.raises(ArchiveError, match="beyond 64 bits"):
            read_archive(path, {"time": "int s"})
    else:
        with pytest.raises(ArchiveError, match=found):
            read_archive(path, LAYOUT)


def test_nothing_is_unpickled(tmp_path):
    class Trap:
        def __reduce__(self):
            return (os.mkdir, (str(tmp_path / "sprung"),))

    path = npz(tmp_path / "a.npz", other=np.array([Trap()], dtype=object))
    assert read_archive(path, LAYOUT).keys() == LAYOUT.keys()
    with pytest.raises(ArchiveError, match="other of type object"):
        read_archive(path, LAYOUT, others="float")
    assert not (tmp_path / "sprung").exists()


def test_sizes_are_judged_by_the_headers_alone(tmp_path, monkeypatch):
    huge = zipped(tmp_path / "a.npz", [("ranges.npy", member((10**9, 10**9))), ("time.npy", member((10**9,)))])
    with pytest.raises(ArchiveError, match="more than 1024 MiB"):
        read_archive(huge, LAYOUT)
    bomb = zipped(tmp_path / "b.npz", [("time.npy", member((3,), bytes(10**7)))])
    with pytest.raises(ArchiveError, match="other contents than its header says"):
        read_archive(bomb, {"time": "float s"})
    short = zipped(tmp_path / "c.npz", [("time.npy", member((3,), bytes(23)))])
    with pytest.raises(ArchiveError, match="other contents than its header says"):
        read_archive(short, {"time": "float s"})
    monkeypatch.setattr(archive, "LIMIT_BYTES", 100)
    with pytest.raises(ArchiveError, match="more than"):
        read_archive(npz(tmp_path / "d.npz"), LAYOUT)


@pytest.mark.parametrize("shape", [(-1,), "(" * 5000, (2**70,), ("a",), None], ids=lambda s: repr(s)[:9])
def test_absurd_headers_are_told(tmp_path, shape):
    if isinstance(shape, str):
        text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(6000).encode()
    else:
        text = repr({"descr": "<f8", "fortran_order": False, "shape": shape}).ljust(200).encode()
    content = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text
    with pytest.raises(ArchiveError):
        read_archive(zipped(tmp_path / "a.npz", [("time.npy", content)]), {"time": "float s"})


NO_HEADERS = {
    ValueError: "{}",
    TypeError: "{1: 2, 'a': 3}",
    SyntaxError: "  {}\n {}",
    tokenize.TokenError: "(",
    RecursionError: "-" * 3000 + "1",
    MemoryError: "-" * 9000 + "1",
}
"""By what numpy raises of them; of the last two it may be either."""


@pytest.mark.parametrize("kind", NO_HEADERS, ids=lambda kind: kind.__name__)
def test_whatever_numpy_cannot_read_of_a_header_is_told_in_the_same_words(tmp_path, kind):
    text = NO_HEADERS[kind].encode()
    content = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text
    with pytest.raises((kind, RecursionError, MemoryError)):
        np.lib.format.read_array(io.BytesIO(content))
    with pytest.raises(ArchiveError, match="time without the header of an array"):
        read_archive(zipped(tmp_path / "a.npz", [("time.npy", content)]), {"time": "float s"})


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_what_is_no_archive_of_arrays_is_told(tmp_path):
    whole = npz(tmp_path / "whole.npz").read_bytes()
    np.save(tmp_path / "one.npy", np.arange(3))
    broken = bytearray(whole)
    broken[60] ^= 0xFF
    contents = {
        "empty": b"",
        "text": b"not an archive",
        "array": (tmp_path / "one.npy").read_bytes(),
        "short": whole[: len(whole) // 2],
        "broken": bytes(broken),
    }
    for content in contents.values():
        with pytest.raises(ArchiveError):
            read_archive(content, LAYOUT)
    with pytest.raises(ArchiveError, match="time twice"):
        read_archive(zipped(tmp_path / "a.npz", [("time.npy", member((0,)))] * 2), {"time": "float s"})
    with pytest.raises(ArchiveError, match="no ranges"):
        read_archive(zipped(tmp_path / "b.npz", [("time.npy", member((0,)))]), LAYOUT)
    os.mkfifo(tmp_path / "pipe")
    for place, found in (
        (tmp_path, "a folder"),
        (tmp_path / "pipe", "not a regular file"),
        (tmp_path / "nowhere", "No such"),
    ):
        with pytest.raises(OSError, match=found):
            read_archive(place, LAYOUT)


@pytest.mark.parametrize("letter", [0x110000, 0xD800, 0xDFFF], ids=hex)
def test_letters_that_do_not_exist_are_told(tmp_path, letter):
    beyond = member((1,), letter.to_bytes(4, "little"), "<U1")
    with pytest.raises(ArchiveError, match="word of invalid characters"):
        read_archive(zipped(tmp_path / "a.npz", [("word.npy", beyond)]), {"word": "text n"})


def test_no_array_has_less_than_no_rows(tmp_path):
    """Its bytes, below zero, would let a larger array through."""
    text = repr({"descr": "<f8", "fortran_order": False, "shape": (-1,)}).ljust(200).encode()
    content = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text
    with pytest.raises(ArchiveError, match="of shape"):
        read_archive(zipped(tmp_path / "a.npz", [("time.npy", content)]), {"time": "float s"})


def changed(content, at, value):
    """The same bytes with two others at a place of the only member's local header and of its entry in the directory."""
    entry = content.index(b"PK\x01\x02")
    found = bytearray(content)
    for first in (at, entry + at + 2):
        found[first : first + 2] = value.to_bytes(2, "little")
    return bytes(found)


def deflated(tmp_path):
    return zipped(tmp_path / "a.npz", [("time.npy", member((300,), np.arange(300.0).tobytes()))]).read_bytes()


def bad_block(content):
    """The first block of the deflated member is of a kind that there is not."""
    found, first = bytearray(content), 30 + len("time.npy")
    found[first] |= 0b110
    return bytes(found)


def cut_short(content):
    """More is promised of the member, in the directory and in the array's header, than the file holds."""
    promised, stored = member((10_000,)), io.BytesIO()
    with zipfile.ZipFile(stored, "w", zipfile.ZIP_STORED) as file:
        file.writestr("time.npy", promised)
    found = bytearray(stored.getvalue())
    entry = found.index(b"PK\x01\x02")
    for first in (entry + 20, entry + 24):
        found[first : first + 4] = (len(promised) + 80_000).to_bytes(4, "little")
    return bytes(found)


BREAKS = {
    zipfile.BadZipFile: lambda content: b"PK" + content[:20],
    zlib.error: bad_block,
    RuntimeError: lambda content: changed(content, 6, 1),
    NotImplementedError: lambda content: changed(content, 8, 99),
    EOFError: cut_short,
}


@pytest.mark.parametrize("kind", BREAKS, ids=lambda kind: kind.__name__)
def test_whatever_zipfile_cannot_read_is_told_in_the_same_words(tmp_path, kind):
    content = BREAKS[kind](deflated(tmp_path))
    # Pythons that look for bombs refuse a member that reaches into the directory before they read it.
    kinds = (kind, zipfile.BadZipFile) if kind is EOFError else kind
    with pytest.raises(kinds), zipfile.ZipFile(io.BytesIO(content)) as file:
        file.read("time.npy")
    with pytest.raises(ArchiveError, match="archive of arrays"):
        read_archive(content, {"time": "float s"})


def test_an_archive_without_its_first_bytes_is_told(tmp_path):
    path = npz(tmp_path / "a.npz")
    path.write_bytes(path.read_bytes()[62:])
    with pytest.raises(ArchiveError, match="archive of arrays"):
        read_archive(path.read_bytes(), LAYOUT)
    with pytest.raises(OSError, match="Invalid argument"):
        read_archive(path, LAYOUT)
