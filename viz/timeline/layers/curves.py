"""Curves under `/plots`, one for each back end in each plot, and the log of decisions under `/decisions/BACKEND`."""

import numpy as np
import rerun as rr

from chainslam.slam.evaluation.consistency import chi2_band

from ... import palette
from ..block import Block
from ..colours import packed
from ..drawn_step import DrawnStep
from ..recording import RerunRecording
from .map_layers import goal_words

NEES, LOG_NEES, TRACE, PATH, ENDS, LINES, CHAINS, CLOSED, STEP_MS, NIS = (
    *("nees", "nees_log10", "pose_trace", "path_length_m", "open_ends"),
    *("lines", "chains", "closed_chains", "step_ms", "nis"),
)
POSE_BAND = chi2_band(3)
"""The 95 % band of the pose's NEES."""


def curve_style(backend: str, of: str = "", width: float = 1.6) -> rr.SeriesLines:
    """Return the style of a back end's curves; `of` distinguishes two in one plot."""
    return rr.SeriesLines(colors=packed(palette.of_backend(backend)), names=backend + of, widths=width)


class CurvesLayer:
    """One value at each step."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._backend = out, backend
        for plot in (TRACE, PATH, ENDS, LINES, CHAINS, CLOSED, STEP_MS, NIS):
            more = (", closed", 4.0) if plot == CLOSED else ()
            out.fixed(f"/plots/{plot}/{backend}", curve_style(backend, *more))

    def send(self, block: Block) -> None:
        """Send the values of some steps."""
        rows = block.rows
        curves = {
            TRACE: [float(np.trace(row.pose_cov)) for row in rows],
            PATH: [row.path_length_m for row in rows],
            ENDS: [sum(len(chain.open_ends) for chain in row.walls.chains) for row in rows],
            LINES: [len(row.walls.ids) for row in rows],
            CHAINS: [len(row.walls.chains) for row in rows],
            CLOSED: [sum(chain.is_closed for chain in row.walls.chains) for row in rows],
            STEP_MS: [1e3 * row.seconds for row in rows],
            NIS: [row.localisation.nis.squared / max(row.localisation.nis.dof, 1) for row in rows],
        }
        for plot, values in curves.items():
            self._out.values(f"/plots/{plot}/{self._backend}", block.moments, np.array(values, dtype=np.float64))


class DecisionsLayer:
    """Goals and their reasons, blacklisted ends and why, the current behaviour."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity = out, f"/decisions/{backend}"
        self._goal: object = None
        self._doing = ""
        self._noise_factor = 1.0
        self._aside: set[tuple[int, int]] = set()

    def send(self, block: Block) -> None:
        """Send what is new at some steps."""
        lines = [(at, *line) for at, row in enumerate(block.rows) for line in self._news(row)]
        if lines:
            at, words, levels = zip(*lines, strict=True)
            numbered = [f"{block.rows[k].index:4d}  {word}" for k, word in zip(at, words, strict=True)]
            self._out.words(self._entity, block.moments.take(list(at)), numbered, levels)

    def _news(self, row: DrawnStep) -> list[tuple[str, str]]:
        news = [
            (f"blacklisted: open end of wall {end.wall}: {end.reason}", "WARN")
            for end in row.set_aside
            if (end.wall, end.side) not in self._aside
        ]
        self._aside = {(end.wall, end.side) for end in row.set_aside}
        decision, goal = row.decision, row.decision.goal
        said = None if goal is None else (goal.kind, goal.wall, goal.side, goal.reason)
        if goal is not None and said != self._goal:
            news.append((f"{goal_words(goal)}: {goal.reason}", "INFO"))
            if decision.walls_to_follow:
                news.append((f"follow walls {' '.join(map(str, decision.walls_to_follow))}", "INFO"))
        self._goal = said
        news += self._faults(row)
        if row.ended is not None:
            news.append((f"{row.ended}: {decision.words}", "INFO"))
        elif decision.words and decision.words != self._doing:
            # The reason of the goal has its own line.
            why = "" if goal is None else f" ({goal.reason})"
            news.append((decision.words.removesuffix(why), "DEBUG"))
        self._doing = decision.words
        return news

    def _faults(self, row: DrawnStep) -> list[tuple[str, str]]:
        """Return faults that the robot noticed: an unreported motion, more wheel slip than stated."""
        found, news = row.localisation, []
        if found.unstated_motion is not None:
            x, y, turn = found.unstated_motion.motion
            words = f"re-localised: moved by {np.hypot(x, y):.2f} m and {np.degrees(turn):.0f} degrees, unreported"
            news.append((words, "WARN"))
        if found.noise_factor != self._noise_factor:
            news.append((f"the wheels slip {found.noise_factor:g} times as far as stated", "WARN"))
            self._noise_factor = found.noise_factor
        return news
