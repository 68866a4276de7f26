"""The first page of the site plays stored runs in a browser, without a network."""

import json
import re
import shutil
import subprocess
import sys
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

ROOT = Path(__file__).parents[2]
WORLDS = ("paper-fig9", "apartment", "random-1")
FILMS = {name: json.loads((ROOT / "docs" / "films" / f"{name}.json").read_text()) for name in WORLDS}
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
WITNESS = """<meta http-equiv="Content-Security-Policy" content="default-src 'self' data: 'unsafe-inline'"><script>
const wrong = [], fetched = [], seen = {};
// A browser without a screen paints when it likes, under virtual time hardly ever.
window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now() - 30), 16); // as old as frames are
window.cancelAnimationFrame = clearTimeout;
addEventListener("error", e => wrong.push(String(e.message || e.target.src)), true);
addEventListener("securitypolicyviolation", e => fetched.push(e.blockedURI));
const one = kind => document.querySelector(`.player ${kind}`);
const all = kind => [...document.querySelectorAll(`.player ${kind}`)];
const state = () => ({
  map: one(".map").toDataURL(), lens: one(".lens").toDataURL(), curve: one(".nees").toDataURL(),
  place: one("output").textContent, button: one("button").textContent,
  estimator: one("fieldset label:has(:checked)").textContent,
  told: Object.fromEntries(all(".told div").map(row => [...row.children].map(cell => cell.textContent))),
});
const key = name => one("[type=range]").dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true }));
const scrub = step => { one("[type=range]").value = step; one("[type=range]").dispatchEvent(new Event("input")); };
const colours = canvas => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
};
addEventListener("load", () => {
  seen.drawn = all("canvas").map(colours);
  seen.ms = performance.now();
  seen.wide = document.documentElement.scrollWidth - innerWidth;
  seen.end = state();
  scrub(40); seen.scrubbed = state();
  key("ArrowRight"); seen.stepped = state();
  key("Home"); seen.home = state();
  scrub(40); key("z"); seen.near = state();
  key("z"); all("[type=radio]")[1].click(); seen.other = state();
  one("select").value = 2; one("select").dispatchEvent(new Event("change")); seen.world = state();
  key("Home"); key(" "); seen.playing = state();
  setTimeout(() => { seen.later = state(); key(" "); seen.paused = state();
    scrub(40); seen.before = state(); key(" ");
    setTimeout(() => { seen.resumed = state(); document.title = JSON.stringify({ ...seen, wrong, fetched }); }, 20);
  }, 1000);
  document.title = JSON.stringify({ ...seen, wrong, fetched });
});
</script>"""


def test_the_films_are_small_and_hold_every_estimator():
    assert sum((ROOT / "docs" / "films" / f"{name}.json").stat().st_size for name in WORLDS) < 400_000
    for film in FILMS.values():
        assert [run["backend"] for run in film["runs"]] == ["block-ekf", "full-ekf", "invariant-ekf", "graph"]


def test_the_figures_of_the_first_page_are_those_of_its_films():
    text = " ".join((ROOT / "docs" / "index.md").read_text().split())
    block = {name: film["runs"][0] for name, film in FILMS.items()}
    others = [run for film in FILMS.values() for run in film["runs"][1:]]
    for name, words in (
        ("paper-fig9", "in 7 of 100 steps of `paper-fig9`, where its pose ANEES is 430,"),
        ("random-1", "in 24 of 100 in the random building, where it is 244,"),
        ("apartment", "in 91 of 100 in the small apartment, where it is 1.31;"),
    ):
        share, anees = re.search(r"in (\d+) of 100.* is ([\d.]+)[,;]", words).groups()
        assert words in text
        assert (int(share), float(anees)) == (round(100 * block[name]["in_band"]), float(f"{block[name]['anees']:.3g}"))
    assert "the other three lie there in 76 or more." in text
    assert min(round(100 * run["in_band"]) for run in others) == 76


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Where the built site is served, on this machine alone, with a witness in its first page."""
    site = tmp_path_factory.mktemp("site")
    words = ["-m", "sphinx", "-q", "-E", "-d", str(site / ".doctrees"), str(ROOT / "docs"), str(site)]
    subprocess.run([sys.executable, *words], check=True)
    page = (site / "index.html").read_text()
    (site / "index.html").write_text(re.sub("<head>", lambda found: found.group() + WITNESS, page, count=1))

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *words):
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=site))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/index.html"
    server.shutdown()
    server.server_close()


def seen(address, folder, width, *more):
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", f"--user-data-dir={folder / 'profile'}"]
    flags += [f"--window-size={width},900", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", *more]
    done = subprocess.run([BROWSER, *flags, address], capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr
    told = json.loads(re.search(r"<title>(.*?)</title>", done.stdout).group(1))
    assert (told["wrong"], told["fetched"]) == ([], [])
    return told


def shown(value):
    return str(round(value)) if value >= 100 else f"{value:#.3g}"


@pytest.mark.long
@pytest.mark.parametrize("width", [390, 1280])
def test_the_first_picture_is_there_at_once_and_every_control_changes_it(address, tmp_path, width):
    told = seen(address, tmp_path, width)
    print(f"{width} px: first picture after {told['ms']:.0f} ms")
    assert told["ms"] < 3000
    assert min(told["drawn"]) > 10
    assert told["wide"] <= 0
    film = FILMS["paper-fig9"]
    end, scrubbed, near, other, world = (told[name] for name in ("end", "scrubbed", "near", "other", "world"))
    for now, run, at in (
        (end, 0, -1),
        (scrubbed, 0, 40),
        (told["stepped"], 0, 41),
        (told["home"], 0, 0),
        (other, 1, 40),
    ):
        run = film["runs"][run]
        assert now["estimator"] == run["backend"]
        assert now["told"]["NEES now"] == shown(run["nees"][at])
        assert now["told"]["pose ANEES"] == shown(run["anees"])
        assert now["told"]["steps in the band"] == f"{shown(100 * run['in_band'])} %"
        assert now["place"] == f"step {film['steps'][at] + 1}, {film['path_m'][at]:.1f} m"
    assert world["told"]["pose ANEES"] == shown(FILMS["random-1"]["runs"][1]["anees"])
    for one, then in ((end, scrubbed), (scrubbed, other), (other, world)):
        assert all(one[picture] != then[picture] for picture in ("map", "lens", "curve"))
    assert near["map"] != scrubbed["map"]
    assert near["lens"] == scrubbed["lens"]


@pytest.mark.long
def test_it_plays_and_pauses_by_the_keyboard(address, tmp_path):
    told = seen(address, tmp_path, 1280, "--virtual-time-budget=4000")
    playing, later, paused = (told[name] for name in ("playing", "later", "paused"))
    assert ("Pause" in playing["button"], "Play" in paused["button"]) == (True, True)
    steps = [int(re.search(r"step (\d+)", now["place"]).group(1)) for now in (playing, later, paused)]
    assert steps[0] == 1 < steps[1] == steps[2]
    assert playing["map"] != later["map"]
    assert told["resumed"]["place"] == told["before"]["place"]  # a first frame older than the key leads not back
