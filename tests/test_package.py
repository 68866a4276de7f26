"""Wheel and source archive: each holds all that a run outside the checkout needs."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
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


def test_what_is_installed_runs_outside_the_checkout(wheel, tmp_path):
    venv.create(tmp_path / "venv", with_pip=False)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(tmp_path / "venv")}))
    run(
        sys.executable,
        "-m",
        "pip",
        "--quiet",
        "install",
        "--no-deps",
        "--no-index",
        "--target",
        packages,
        wheel,
        cwd=tmp_path,
    )
    # The dependencies are those of this environment; its editable chainslam comes after the one just installed.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    python, code = (
        tmp_path / "venv" / "bin" / "python",
        "import sys; from chainslam.experiments.commands.cli import main; sys.exit(main())",
    )
    env = {"OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
    assert {path.name for path in packages.iterdir() if path.is_dir()} == {"chainslam", f"{wheel.name[:15]}.dist-info"}
    for room in ROOMS:  # a user's own packages of these names are not ours
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text("raise ImportError('not ours')\n")
    assert "paper-fig8" in run(python, "-c", code, "worlds", cwd=tmp_path, **env)
    assert run(python, "-c", code, "--version", cwd=tmp_path, **env).startswith("chainslam ")
    run(python, "-c", code, "explore", "paper-fig8", "--max-steps", "20", "--out", "run", cwd=tmp_path, **env)
    assert (tmp_path / "run" / "map.png").is_file()
    run(python, "-c", code, "report", "run", cwd=tmp_path, **env)
    assert (tmp_path / "run" / "report.html").is_file()
    assert all((packages / "chainslam" / room / "py.typed").is_file() for room in ROOMS)
    said = run(
        python, "-c", "import chainslam; print(chainslam.__file__, len(chainslam.load('run').map))", cwd=tmp_path, **env
    )
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
        "import chainslam\nfrom chainslam.slam.robot import Scan\nreveal_type(chainslam.explore)\nreveal_type(Scan.take)\n"
    )
    python = ("--python-executable", tmp_path / "venv" / "bin" / "python")
    said = run(sys.executable, "-m", "mypy", "--cache-dir", tmp_path, *python, "use.py", cwd=tmp_path, PYTHONPATH="")
    assert "-> chainslam.experiments.library.runs.Run" in said
    assert "Any" not in said.splitlines()[1]
