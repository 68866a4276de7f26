"""Equation (4): r is measured from the world's origin, so that its uncertainty grows with the distance from it."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from chainslam.slam.backends.blocks.block_ekf import BlockEkf
from chainslam.slam.backends.fej_ekf import FejEkf
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.invariant_ekf import InvariantEkf
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.estimation.backend import Belief
from chainslam.slam.estimation.models import innovations
from chainslam.viz import palette
from chainslam.viz.figures.panels import panels

from ..scenario import P0_SIGMAS
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.origin import ShiftedOrigin

FILTERS: dict[str, type[Any]] = {
    "block-ekf": BlockEkf, "full-ekf": FullEkf, "fej-ekf": FejEkf, "invariant-ekf": InvariantEkf
}  # fmt: skip
AWAY_M = (1.0, 3.0, 10.0, 30.0, 100.0)
SEEN = np.array([[0.5 * np.pi, 2.0]])
"""A wall 2 m to the left, along the way from the origin: the lever arm to the origin is the whole distance."""
SEEN_COV = np.diag([np.deg2rad(0.3), 0.003])[None] ** 2
SHIFT_M = 100.0
PREDICTED = f"sigma of r predicted for the sensor, variances alone, {AWAY_M[-1]:g} m, mm"
SAID: Said = {PREDICTED: "grows with x and y"}
RINGS = 2
RING_M = 40.0
VARIANTS = tuple((name, at_wall) for name in FILTERS for at_wall in (False, True))


def numbers(seed: int) -> Numbers:
    """Return the sigmas of one wall, and the results of one ring at two places."""
    return {_variant(*variant): _numbers(variant, [seed]) for variant in VARIANTS}


def _curve(name: str, at_wall: bool) -> Float[np.ndarray, "d 3"]:
    return np.array([sigmas(FILTERS[name], at_wall, away) for away in AWAY_M])


def _numbers(variant: tuple[str, bool], seeds: Iterable[int]) -> dict[str, Value]:
    found, (name, at_wall) = _curve(*variant), variant
    study = ShiftedOrigin(length_m=RING_M, shift_m=(SHIFT_M, 0.0), p0="large")
    rides = np.array([study.ridden(FILTERS[name], at_wall, seed) for seed in seeds])
    return {
        f"sigma of r in the map, {AWAY_M[0]:g} m from the origin, mm": float(found[0, 0]),
        f"sigma of r in the map, {AWAY_M[-1]:g} m, mm": float(found[-1, 0]),
        PREDICTED: float(found[-1, 1]),
        f"the same with covariances, {AWAY_M[-1]:g} m, mm": float(found[-1, 2]),
        f"a ring {SHIFT_M:g} m away: path differs by, m": _worst(rides[:, 2]),
        "pose ANEES beside the origin": _mean(rides[:, 0]),
        f"pose ANEES {SHIFT_M:g} m away": _mean(rides[:, 1]),
    }


def reproduce(seed: int) -> Reproduction:
    """Observe one wall at growing distances from the origin; then drive one ring near the origin and 100 m from it."""
    curves = {variant: _curve(*variant) for variant in VARIANTS}
    return Reproduction(
        "Equation (4): r and the way to the world's origin",
        SAID,
        {_variant(*variant): _numbers(variant, range(seed, seed + RINGS)) for variant in VARIANTS},
        _figure(curves),
        (
            "Anchor `origin` is the paper's line (alpha, r), `wall` attaches r to the wall. One wall is seen once from"
            " a pose with P0 small, along the way from the origin, and predicted for the same pose.",
            f"{RINGS} rings of {RING_M:g} m with P0 large, seeds {seed} to {seed + RINGS - 1}, ridden with the same"
            " observations here and there; a dash is a ride that broke down.",
        ),
    )


def sigmas(kind: type[Any], at_wall: bool, away_m: float) -> Float[np.ndarray, "3"]:
    """Return sigmas of r, mm: in the map, and predicted for the sensor without and with all covariances.

    In the prediction without them only the variances of pose and line count, as in the paper's equation (4).
    """
    position_m, heading_rad = P0_SIGMAS["small"]
    pose = np.array([away_m, 0.0, 0.0])
    backend = kind(pose, np.diag([position_m, position_m, heading_rad]) ** 2, EkfConfig(at_wall=at_wall))
    ids = backend.grow(SEEN, SEEN_COV, np.array([[0.0, 2.0]]))
    belief: Belief = backend.belief
    joint = belief.joint(ids)
    model = innovations(belief.pose_world, belief.anchors, belief.means, SEEN, SEEN_COV)
    by_state = np.concatenate([model.H_pose[0, 1], model.H_line[0, 1]])
    alone = by_state**2 @ np.diag(joint.cov)
    whole = by_state @ joint.cov @ by_state
    return 1e3 * np.sqrt(np.maximum([joint.cov[4, 4], alone, whole], 0.0))


def _variant(name: str, at_wall: bool) -> str:
    return f"{name}, {'wall' if at_wall else 'origin'}"


def _worst(values: Float[np.ndarray, " n"]) -> float | None:
    return float(values.max()) if np.all(np.isfinite(values)) else None


def _mean(values: Float[np.ndarray, " n"]) -> float | None:
    return float(values.mean()) if np.all(np.isfinite(values)) else None


def _figure(curves: dict[tuple[str, bool], Float[np.ndarray, "d 3"]]) -> Figure:
    titles = ("σ of r in the map", "predicted for the sensor, variances alone", "predicted, with covariances")
    figure, axes = panels("Equation (4): one wall, seen once, ever farther from the world's origin", 1, 3, (3.7, 3.2))
    for column, (one, title) in enumerate(zip(axes, titles, strict=True)):
        for turn, ((name, at_wall), found) in enumerate(curves.items()):
            # Most curves coincide: the first ones are drawn wide, so that they remain visible below the last.
            width = 7.5 - 1.8 * (turn // 2)
            one.plot(
                AWAY_M, found[:, column], "--" if at_wall else "-", linewidth=width, color=palette.of_backend(name)
            )
            one.plot([], [], "--" if at_wall else "-", color=palette.of_backend(name), label=_variant(name, at_wall))
        one.set_xscale("log")
        one.set_yscale("log")
        one.set_ylim(1.0, 1e3)
        one.set_xlabel("way to the origin, m", fontsize=8)
        one.set_title(title, fontsize=8, loc="left")
    axes[0].set_ylabel("mm", fontsize=8)
    axes[0].legend(frameon=False, fontsize=7)
    return figure
