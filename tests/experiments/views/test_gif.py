"""A run as an animation: one frame for each step that is shown, from its log alone."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.gif import gif_of
from chainslam.viz import palette
from chainslam.viz.figures.animation import FRAMES, LAST_MS, animated, shown_steps


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--max-steps", "12", "--out", str(folder)]) == 0
    return folder


def frames_of(content):
    """The frames as arrays (h, w, 3)."""
    with Image.open(BytesIO(content)) as animation:
        found = []
        for index in range(animation.n_frames):
            animation.seek(index)
            found.append(np.array(animation.convert("RGB")).astype(int))
        return found, animation.info["duration"]


def pixels(frame, colour):
    """How many pixels are nearly of a colour."""
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(frame - wanted).max(axis=2) < 16).sum())


def test_a_run_moves_from_frame_to_frame_and_stands_at_its_end(run, capsys):
    capsys.readouterr()
    assert main(["report", str(run), "--gif"]) == 0
    assert "run.gif" in capsys.readouterr().out
    frames, last_ms = frames_of((run / "run.gif").read_bytes())
    assert len(frames) == 12
    assert last_ms == LAST_MS
    assert all(np.any(one != other) for one, other in pairwise(frames))
    seen = [pixels(frame, palette.SWEPT) for frame in frames]
    assert seen[-1] > seen[0] > 1000
    assert pixels(frames[-1], palette.OPEN) > pixels(frames[0], palette.OPEN)


def test_the_same_run_gives_the_same_bytes(run):
    assert gif_of(run) == gif_of(run)


def test_a_long_run_shows_its_first_and_last_steps_and_a_bounded_number():
    assert shown_steps(3) == [0, 1, 2]
    assert shown_steps(0) == []
    many = shown_steps(5000)
    assert (many[0], many[-1], len(many)) == (0, 4999, FRAMES)


def test_what_is_no_run_is_refused_in_one_line(run, tmp_path, capsys):
    with pytest.raises(ValueError, match="nothing to animate"):
        animated([], [], "nothing")
    out = tmp_path / "r"
    assert main(["replay", str(run / "log.npz"), "--backend", "block-ekf", "full-ekf", "--out", str(out)]) == 0
    assert main(["report", str(out), "--gif"]) == 2
    assert "name the folder of one run" in capsys.readouterr().err
