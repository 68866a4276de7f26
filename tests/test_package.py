"""Wheel and source archive: each holds all that a run outside the checkout needs."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("slam", "explore", "sim", "viz", "experiments")
pytestmark = pytest.mark.long


def run(*words, cwd, **env):
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, capture_output=True, text=True, env=os.environ | env, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The files under version control, elsewhere: nothing that lies about here gets into a package."""
    copy = tmp_path_factory.mktemp("sources")
    listed = run("git", "ls-files", "--cached", "--others", "--exclude-standard", cwd=ROOT).splitlines()
    for name in listed:
        if (ROOT / name).is_file() or (ROOT / name).is_symlink():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy / name, follow_symlinks=False)
    return copy


def wheel_of(folder, out):
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index")
    run(*pip, "--wheel-dir", out, folder, cwd=out)
    return next(out.glob("*.whl"))


@pytest.fixture(scope="module", params=["from the checkout", "from the source archive"])
def wheel(request, sources, tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    if request.param == "from the checkout":
        return wheel_of(sources, out)
    words = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    run(sys.executable, "-c", words, out, cwd=sources)
    with tarfile.open(next(out.glob("*.tar.gz"))) as archive:
        archive.extractall(out, filter="data")
    return wheel_of(next(folder for folder in out.iterdir() if folder.is_dir()), out)


def installed(folder, *wheels):
    """Return where packages are in a new environment that holds these, and what runs its Python outside a checkout."""
    venv.create(folder / "venv", with_pip=False)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder / "venv")}))
    pip = (sys.executable, "-m", "pip", "--quiet", "install", "--no-deps", "--no-index")
    run(*pip, "--target", packages, *wheels, cwd=folder)
    # The dependencies are those of this environment; its editable chainslam comes after the one just installed.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    python = folder / "venv" / "bin" / "python"
    return packages, partial(run, python, cwd=folder, OMP_NUM_THREADS="1", PYTHONPATH="")


def test_what_is_installed_runs_outside_the_checkout(wheel, tmp_path):
    packages, python = installed(tmp_path, wheel)
    code = "import sys; from chainslam.experiments.commands.cli import main; sys.exit(main())"
    there = {path.name for path in packages.iterdir() if path.is_dir()} - {"bin"}
    assert there == {"chainslam", f"{wheel.name[:15]}.dist-info"}
    for room in ROOMS:  # a user's own packages of these names are not ours
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text("raise ImportError('not ours')\n")
    assert "paper-fig8" in python("-c", code, "worlds")
    assert python("-c", code, "--version").startswith("chainslam ")
    python("-c", code, "explore", "paper-fig8", "--max-steps", "20", "--out", "run")
    assert (tmp_path / "run" / "map.png").is_file()
    python("-c", code, "report", "run")
    assert (tmp_path / "run" / "report.html").is_file()
    assert all((packages / "chainslam" / room / "py.typed").is_file() for room in ROOMS)
    said = python("-c", "import chainslam; print(chainslam.__file__, len(chainslam.load('run').map))")
    assert Path(said.split()[0]).is_relative_to(packages)
    assert int(said.split()[1]) > 0
    assert (packages / "../../../bin/chainslam").resolve().is_file() or (packages / "bin" / "chainslam").is_file()


def test_editors_see_the_types_of_what_is_installed_for_development(sources, tmp_path):
    venv.create(tmp_path / "venv", with_pip=False)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(tmp_path / "venv")}))
    pip = (sys.executable, "-m", "pip", "--quiet", "install", "--no-deps", "--no-index", "--no-build-isolation")
    run(*pip, "--target", packages, "--editable", sources, cwd=tmp_path)
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    (tmp_path / "use.py").write_text(
        "import chainslam\nfrom chainslam.slam.robot import Scan\n"
        "reveal_type(chainslam.explore)\nreveal_type(Scan.within)\n"
        "run = chainslam.explore('paper-fig4')\n"
        "reveal_type(run.summary['pose_anees'])\nreveal_type(run.steps['pose_nees'])\n"
    )
    python = ("--python-executable", tmp_path / "venv" / "bin" / "python")
    said = run(sys.executable, "-m", "mypy", "--cache-dir", tmp_path, *python, "use.py", cwd=tmp_path, PYTHONPATH="")
    assert "-> chainslam.experiments.library.runs.Run" in said
    _, scan, score, column, _ = said.splitlines()
    assert "Any" not in scan
    assert score.endswith('"float | None"')
    assert "numpy.dtype[numpy.float64]" in column


def test_a_package_of_a_stranger_is_compared_with_ours_and_its_results_are_reported_without_it(sources, tmp_path):
    stranger = tmp_path / "plugin"
    shutil.copytree(ROOT / "examples" / "plugin", stranger)
    packages, python = installed(tmp_path, wheel_of(sources, tmp_path), wheel_of(stranger, stranger))
    code = "import sys; from chainslam.experiments.commands.cli import main; sys.exit(main())"
    assert "cautious-ekf" in python("-c", code, "backends")
    (tmp_path / "room.walls").write_text("0 0 6 0\n6 0 6 4\n6 4 0 4\n0 4 0 0\n3 0 3 2.5\n")
    named = ("--worlds", "room.walls", "--backends", "cautious-ekf", "full-ekf", "--strategies", "farthest")
    own = ("--set", "backend_options.own.CautiousConfig.times=3", "--plugin", ROOT / "examples" / "own_backend.py")
    python("-c", code, "compare", *named, *own, "--trials", "2", "--max-steps", "9", "--jobs", "2", "--out", "campaign")
    for left in packages.glob("cautious_slam*"):
        shutil.rmtree(left)
    assert "cautious-ekf" not in python("-c", code, "backends")
    python("-c", code, "report", "campaign")
    page = (tmp_path / "campaign" / "report.html").read_text()
    assert "cautious-ekf" in page
    assert "farthest" in page
