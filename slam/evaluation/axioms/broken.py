"""How an axiom tells that it does not hold: what was expected and what was found."""

import numpy as np
from jaxtyping import Float, Shaped

from ...estimation.backend import Backend, Joint


class BrokenError(AssertionError):
    """An axiom does not hold."""


def expect(holds: bool | np.bool_, expected: str, found: object) -> None:
    """Raise BrokenError where something does not hold."""
    if not holds:
        raise BrokenError(f"expected {expected}, found {found}")


def expect_same(
    now: Shaped[np.ndarray, "..."], then: Shaped[np.ndarray, "..."], what: str, within: float = 0.0
) -> None:
    """Raise BrokenError where two arrays differ by more."""
    same = now.shape == then.shape
    off = float(np.abs(now - then).max(initial=0.0)) if same else float("inf")
    expect(off <= within, f"{what} the same to {within:.0e}", f"{off:.1e} between them" if same else "other sizes")


def everything(backend: Backend) -> Joint:
    """Return the Gaussian of pose and all lines."""
    return backend.belief.joint(backend.belief.ids)


def expect_sound(backend: Backend) -> None:
    """Raise BrokenError where the joint covariance is none, or says something else than the belief."""
    belief = backend.belief
    expect(bool(np.all(np.diff(belief.ids) > 0)), "ids in ascending order", belief.ids.tolist())
    joint = belief.joint(belief.ids)
    expect_same(joint.cov, joint.cov.T, "the joint covariance and its transpose", 1e-14 * np.abs(joint.cov).max())
    sigmas = np.sqrt(np.maximum(np.diag(joint.cov), 0.0))
    expect(bool(np.all(sigmas > 0)), "variances above zero", float(np.diag(joint.cov).min()))
    least = float(np.linalg.eigvalsh(joint.cov / np.outer(sigmas, sigmas)).min())
    expect(least > 0, "a positive definite joint covariance", f"a least eigenvalue of {least:.1e} in units of sigmas")
    expect_same(joint.mean[:3], belief.pose_world, "the belief's pose and that of its joint")
    expect_same(joint.mean[3:].reshape(-1, 2), belief.means, "the belief's lines and those of its joint")
    expect_same(joint.cov[:3, :3], belief.pose_cov, "the belief's pose covariance and that of its joint")
    expect_same(joint.anchors, belief.anchors, "the belief's anchors and those of its joint")


def volume(cov: Float[np.ndarray, "s s"]) -> float:
    """Return the log of the uncertainty's volume, which no change of the error's coordinates alters."""
    return float(np.linalg.slogdet(cov)[1])
