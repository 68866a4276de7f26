"""What a bias of ranges does to walls that are seen at a slant: the loop of `ranges.bias`."""

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled


@compiled
def bows(
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, " k"],
    sigmas_m: Float[np.ndarray, " k"],
    lines: Float[np.ndarray, "s 2"],
    beams: Int[np.ndarray, "s 2"],
    noise_sigmas: float,
) -> Float[np.ndarray, "s 4"]:
    """Return what the beams of each segment tell of a bias, and what it does to the segment.

    Its information 1/m^2 and its score 1/m; by how much a bias turns the line, rad/m, and moves it outwards, m/m.
    """
    sums = np.zeros((len(lines), 4))
    sums[:, 3] = 1.0
    for s in range(len(lines)):
        alpha, r = lines[s, 0], lines[s, 1]
        cc, cs, ss, c1, s1, one, ce, se, e1 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        count = (beams[s, 1] - beams[s, 0]) % len(ranges_m) + 1
        for i in range(count):
            k = (beams[s, 0] + i) % len(ranges_m)
            off = bearings_rad[k] - alpha
            p = r / np.cos(off)
            e = ranges_m[k] - p
            if not abs(e) <= noise_sigmas * sigmas_m[k]:
                continue  # it is not the wall's
            # The derivatives of p by the line, in any two parameters that span it.
            weight, x, y = sigmas_m[k] ** -2, p * p * np.cos(off), p * p * np.sin(off)
            cc += weight * x * x
            cs += weight * x * y
            ss += weight * y * y
            c1 += weight * x
            s1 += weight * y
            one += weight
            ce += weight * x * e
            se += weight * y * e
            e1 += weight * e
        det = cc * ss - cs * cs
        if det > 1e-12 * cc * ss:
            u, v = (ss * c1 - cs * s1) / det, (cc * s1 - cs * c1) / det
            sums[s, 0] = one - u * c1 - v * s1
            sums[s, 1] = e1 - u * ce - v * se
            # Of 1/p = a cos + b sin, a = 1/r and b = 0: the line with the bias has a - u, b - v.
            sums[s, 2], sums[s, 3] = -r * v, r * r * u
    return sums
