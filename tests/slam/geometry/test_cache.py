"""Where machine code is kept: in the user's cache, else in a folder of the user's own that the next start finds."""

import stat
import tempfile

import pytest

from chainslam.slam.geometry import compiled


@pytest.fixture
def at(tmp_path, monkeypatch):
    """Return what gives the folder anew, as another process would find it."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(compiled.atexit, "register", lambda *args, **kwargs: None)

    def found(wanted):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(wanted))
        compiled.cache.cache_clear()
        return compiled.cache()

    yield found
    monkeypatch.undo()
    compiled.cache.cache_clear()


def unwritable(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "nowhere").symlink_to(tmp_path / "nowhere")
    return ["/proc/y", tmp_path / "file", tmp_path / "file" / "below", tmp_path / "nowhere", "/dev/null/x"]


def test_what_can_be_written_is_taken(at, tmp_path):
    assert at(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert compiled.is_users_own()


def test_else_it_is_one_private_folder_at_every_start(at, tmp_path, caplog):
    found = {at(wanted) for wanted in unwritable(tmp_path)}
    assert len(found) == 1
    (home,) = found
    assert home.parent == tmp_path
    assert stat.S_IMODE(home.stat().st_mode) == 0o700
    assert not compiled.is_users_own()
    compiled._tell_once.__wrapped__()
    assert f"kept in {home}, since /dev/null/x cannot be written" in caplog.text


@pytest.mark.parametrize("way", ["open to all", "a link", "a file"])
def test_a_folder_that_others_may_have_filled_is_left_alone(way, at, tmp_path, caplog):
    home = compiled._private()
    if way == "open to all":
        home.mkdir()
        home.chmod(0o777)
    elif way == "a link":
        (tmp_path / "theirs").mkdir(mode=0o700)
        home.symlink_to(tmp_path / "theirs")
    else:
        home.write_text("")
    assert at("/proc/y") not in (home, home.resolve())
    compiled._tell_once.__wrapped__()
    assert "at every start: /proc/y cannot be written; let NUMBA_CACHE_DIR name" in caplog.text
