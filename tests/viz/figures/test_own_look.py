"""Figures are the same whatever a user has set for matplotlib's."""

import os
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest

from chainslam.viz.figures.maps import saved
from chainslam.viz.figures.plots import NeesCurve, draw_nees

CURVE = NeesCurve("full-ekf", np.linspace(0.0, 2.0, 20), np.linspace(0.1, 2.0, 20), np.ones((2, 20)))


def drawn():
    return saved(draw_nees([CURVE]), "svg")


@pytest.mark.parametrize("seed", range(4))
def test_settings_of_the_user_change_no_figure_and_stay(seed):
    plain = drawn()
    rng = np.random.default_rng(seed)
    wild = {
        "font.size": float(rng.uniform(5, 40)),
        "axes.facecolor": str(rng.choice(["red", "#123456"])),
        "lines.linewidth": float(rng.uniform(5, 9)),
        "svg.fonttype": "none",
        "axes.grid": True,
        "savefig.bbox": "tight",
        "text.usetex": bool(seed % 2),
        "axes.spines.top": False,
        "figure.dpi": 33.0,
    }
    with mpl.rc_context(wild):
        assert drawn() == plain
        assert mpl.rcParams["font.size"] == wild["font.size"]


def test_a_backend_that_is_not_there_is_left_to_those_who_ask_for_it():
    code = (
        "import os, chainslam.viz.figures, matplotlib;"
        " print(os.environ['MPLBACKEND'], matplotlib.rcParams['backend'].lower())"
    )
    backends = {"module://not_there.backend": "agg", "svg": "svg"}
    for backend, taken in backends.items():
        environment = {**os.environ, "MPLBACKEND": backend, "PYTHONPATH": os.getcwd()}
        found = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        assert found.stdout.split()[:1] == [backend], found.stderr
        assert taken in found.stdout.split()[1] or "not_there" in backend
