"""Rerun's viewer as a separate process, bound to the loopback interface, without access to the network."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

LOOPBACK = "127.0.0.1"
NOWHERE = f"http://{LOOPBACK}:9"
"""A proxy without a server: the viewer asks an external host for its newest version, with or without analytics."""
PATIENCE_S = 20.0
PORT, PAGE_PORT = 9876, 9090
"""Ports of the recordings and of the page, if they are free: always the same, so that ssh can forward them."""


class ViewerError(RuntimeError):
    """The viewer cannot be shown. The message is one line: what was expected, what was found, what to do."""


class Viewer:
    """A running viewer; it stays open when this program ends."""

    def __init__(self, files: Sequence[Path] = ()) -> None:
        """Start it with some recordings, or empty; raises ViewerError."""
        executable = available()
        self._port = _free_port()
        command = [executable, "--bind", LOOPBACK, "--port", str(self._port), "--hide-welcome-screen", *map(str, files)]
        # A session of its own: Ctrl-C ends the run but not the viewer.
        self._process = subprocess.Popen(
            command, env=_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        self._wait_until_it_listens()

    @property
    def url(self) -> str:
        """Address to which a recording can be sent while it goes on."""
        return f"rerun+http://{LOOPBACK}:{self._port}/proxy"

    def _wait_until_it_listens(self) -> None:
        _wait_for(self._process, self._port)


class WebViewer:
    """A viewer served to browsers on this machine, with some recordings, until it is closed."""

    def __init__(self, files: Sequence[Path]) -> None:
        """Start it; raises ViewerError."""
        executable = _executable()
        self.port, self.page_port = _free_port(PORT), _free_port(PAGE_PORT)
        command = [
            executable, "--bind", LOOPBACK, "--port", str(self.port), "--serve-web",
            "--web-viewer-port", str(self.page_port), *map(str, files),
        ]  # fmt: skip
        self._process = subprocess.Popen(
            command, env=_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        _wait_for(self._process, self.page_port)

    @property
    def url(self) -> str:
        """Address for a browser."""
        source = quote(f"rerun+http://{LOOPBACK}:{self.port}/proxy", safe="")
        return f"http://{LOOPBACK}:{self.page_port}/?url={source}"

    def wait(self) -> None:
        """Return once it has ended."""
        self._process.wait()

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        self._process.wait(PATIENCE_S)


def _wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    """Return once a process listens on a port; raises ViewerError."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if process.poll() is not None:
            break
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.05)
    raise ViewerError(
        "expected Rerun's viewer to open, found that it ended at once: record with --rrd FILE and try `rerun FILE`"
    )


def available() -> str:
    """Return the viewer's path; raises ViewerError if it is not installed, or there is no display."""
    executable = _executable()
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not display:
        raise ViewerError(
            "expected a display for the viewer, found none: record with --rrd FILE and open it where there is one"
        )
    return executable


def _executable() -> str:
    """Return the viewer's path, next to this Python or on the search path."""
    beside = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    found = shutil.which("rerun", path=beside)
    if found is None:
        raise ViewerError("expected Rerun's viewer, found no command `rerun`: install rerun-sdk")
    return found


def _environment() -> dict[str, str]:
    """Return the viewer's environment: no network access, and no analytics."""
    proxies = {name: NOWHERE for name in ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY")}
    proxies |= {name.lower(): value for name, value in proxies.items()}
    settings = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "chainslam" / "viewer"
    try:
        (settings / "rerun").mkdir(parents=True, exist_ok=True)
        (settings / "rerun" / "analytics.json").write_text(
            '{"analytics_enabled": false, "analytics_id": "", "metadata": {}}\n'
        )
    except OSError:
        return os.environ | proxies
    return os.environ | proxies | {"XDG_CONFIG_HOME": str(settings)}


def _free_port(wanted: int = 0) -> int:
    """Return a free port, the preferred one if possible."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, wanted))
        except OSError:
            probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
