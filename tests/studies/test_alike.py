"""Two versions of the code that drive alike: found by their drives, and their rows count as rows of one."""

import json
import shutil

import pytest

from chainslam.experiments.usage import UsageError
from studies.runner import alike, rows
from studies.runner.alike import ROOMS, AlikeStudy, driven, unpack
from studies.runner.rows import HERE, append, fingerprint, read


def with_a_change(folder, path, piece, other):
    """A copy of the code in which one piece is another."""
    for room in ROOMS:
        shutil.copytree(HERE / room, folder / room, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    source = (folder / path).read_text()
    assert piece in source
    (folder / path).write_text(source.replace(piece, other))


@pytest.fixture(autouse=True)
def forgotten():
    rows.newer_names.cache_clear()
    yield
    rows.newer_names.cache_clear()


def test_a_version_that_senses_otherwise_drives_otherwise(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    with_a_change(tmp_path, "sim/lidar.py", "sigma_m: Deviation = 0.010", "sigma_m: Deviation = 0.011")
    theirs, ours = driven([tmp_path, HERE], 1, [])
    assert all(own["digest"] != their["digest"] for own, their in zip(ours, theirs, strict=True))
    assert len({(own["backend"], own["strategy"], own["world"], own["odometry"]) for own in ours}) > 30


@pytest.mark.parametrize(("status", "digests"), [(0, ("a", "a")), (1, ("a", "b"))])
def test_versions_that_drive_alike_are_noted_and_others_are_told(tmp_path, monkeypatch, capsys, status, digests):
    monkeypatch.setattr(
        alike, "unpack", lambda _, folder: with_a_change(folder, "sim/chance.py", "import", "import abc\nimport")
    )
    drive = {"world": "hall", "backend": "ukf", "strategy": "frontier", "scans": 7}
    monkeypatch.setattr(alike, "driven", lambda *_: [[drive | {"digest": each}] for each in digests])
    out = tmp_path / "alike.jsonl"
    assert AlikeStudy("before", out=out).run() == status
    told = capsys.readouterr().out
    if status:
        assert "another drive: hall, ukf, frontier" in told
        assert not out.exists()
    else:
        noted = json.loads(out.read_text())
        assert noted["code"] == fingerprint() != noted["as"]
        assert "1 of 1 drives are the same, 7 scans" in told


def test_the_same_code_is_not_driven(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(alike, "driven", lambda *_: pytest.fail("was driven"))
    monkeypatch.setattr(alike, "unpack", lambda _, folder: with_a_change(folder, "sim/chance.py", "import", "import"))
    assert AlikeStudy("before", out=tmp_path / "alike.jsonl").run() == 0
    assert "same code" in capsys.readouterr().out


def test_what_is_no_version_and_code_that_does_not_run_are_refused(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match="expected a version of this code, found no-such-thing"):
        unpack("no-such-thing", tmp_path)
    with_a_change(tmp_path, "sim/lidar.py", "import", "imports")
    with pytest.raises(UsageError, match="found exit status 1"):
        driven([tmp_path], 1, [])


def test_rows_of_a_version_by_which_this_one_drives_alike_are_rows_of_this_one(tmp_path, monkeypatch):
    names = tmp_path / "alike.jsonl"
    older = [{"code": "second", "as": "first"}, {"code": fingerprint(), "as": "second"}, {"code": "x", "as": "y"}]
    names.write_text("".join(json.dumps(each) + "\n" for each in older))
    monkeypatch.setattr(rows, "ALIKE", names)
    out = tmp_path / "rows.jsonl"
    out.write_text("".join(json.dumps({"code": code, "k": code}) + "\n" for code in ("first", "second", "other", "y")))
    append(out, [{"k": "now"}])
    assert [row["k"] for row in read(out)] == ["first", "second", "now"]
    assert [row["code"] for row in read(out, any_code=True)] == [fingerprint()] * 2 + ["other", "x", fingerprint()]
