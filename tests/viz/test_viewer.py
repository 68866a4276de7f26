import contextlib
import json
import os
import signal
import socket
import sys
import time

import pytest

from chainslam.viz import viewer
from chainslam.viz.viewer import Viewer, ViewerError, WebViewer

FAKE = """#!{python}
import json, os, socket, sys, time
with open({log!r}, "w") as stream:
    json.dump([os.getpid(), sys.argv[1:], dict(os.environ)], stream)
if {fails}:
    sys.exit(1)
arguments = sys.argv[1:]
port = "--web-viewer-port" if "--serve-web" in arguments else "--port"
with socket.create_server((arguments[arguments.index("--bind") + 1], int(arguments[arguments.index(port) + 1]))):
    time.sleep(20)
"""


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Put a viewer that only listens in the place of Rerun's, and return what starts it and tells how it was called."""
    log = tmp_path / "called.json"

    def start(files=(), fails=False, make=Viewer):
        script = tmp_path / "rerun"
        script.write_text(FAKE.format(python=sys.executable, log=str(log), fails=fails))
        script.chmod(0o755)
        monkeypatch.setattr(viewer, "_executable", lambda: str(script))
        monkeypatch.setenv("DISPLAY", ":99")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        return make(files)

    yield start, lambda: json.loads(log.read_text())
    if log.exists():
        with contextlib.suppress(ProcessLookupError):
            os.kill(json.loads(log.read_text())[0], signal.SIGTERM)


def test_the_viewer_serves_only_the_loopback_and_finds_no_way_outside(fake, tmp_path):
    start, called = fake
    shown = start([tmp_path / "run.rrd"])
    _, arguments, environment = called()
    assert arguments[arguments.index("--bind") + 1] == "127.0.0.1"
    assert arguments[-1] == str(tmp_path / "run.rrd")
    assert f"127.0.0.1:{arguments[arguments.index('--port') + 1]}/" in shown.url
    assert {environment[name] for name in ("HTTP_PROXY", "https_proxy", "ALL_PROXY")} == {"http://127.0.0.1:9"}
    settings = os.path.join(environment["XDG_CONFIG_HOME"], "rerun", "analytics.json")
    with open(settings) as stream:
        assert '"analytics_enabled": false' in stream.read()
    shown._process.terminate()
    shown._process.wait(10)


def test_a_browser_is_served_on_the_loopback_without_a_display_until_it_is_closed(fake, tmp_path, monkeypatch):
    start, called = fake
    with socket.create_server(("127.0.0.1", 0)) as taken:
        monkeypatch.setattr(viewer, "PAGE_PORT", taken.getsockname()[1])
        shown = start([tmp_path / "run.rrd"], make=WebViewer)
        assert shown.page_port != taken.getsockname()[1]
    monkeypatch.delenv("DISPLAY")
    _, arguments, environment = called()
    assert arguments[arguments.index("--bind") + 1] == "127.0.0.1"
    assert arguments[arguments.index("--web-viewer-port") + 1] == str(shown.page_port)
    assert "--serve-web" in arguments
    assert environment["HTTPS_PROXY"] == "http://127.0.0.1:9"
    assert shown.url == f"http://127.0.0.1:{shown.page_port}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{shown.port}%2Fproxy"
    shown.close()
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", shown.page_port)) != 0


def test_a_viewer_that_ends_at_once_is_told_at_once(fake):
    start, _ = fake
    began = time.monotonic()
    with pytest.raises(ViewerError, match="ended at once"):
        start(fails=True)
    assert time.monotonic() - began < 10


def test_an_absent_viewer_is_named_with_the_way_out(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(ViewerError, match="install rerun-sdk"):
        Viewer()
