"""Slow literal twin of the light of pixel lights at receivers: SII Eq. 2 and 3 as docs/radiometry has them, float64.

    E_i(x) = Phi_i / pi <n_i w> <n_x -w> / r^2,
    E_i(x) = Phi_i (P + 1) / (2 pi K) <r_i w>^P [n_i w > 0] <n_x -w> / r^2 with a lobe.
"""

import math

import numpy as np
from scipy.special import betainc


def contributions(position, normal, lights, *, offset=0.0, least=0.0):
    """Return E (N, n, 3) of N lights at receivers (n, 3) each.

    `offset` is how far lights lie behind their surface, `least` what their distance counts as at least, m.
    """
    result = np.zeros((lights.position.shape[1], len(position), 3))
    for i in range(len(result)):
        up = lights.normal[:, i].astype(float)
        away = position - (lights.position[:, i] - offset * up)
        r = np.sqrt((away * away).sum(axis=1))
        w = away / r[:, None]
        cos_x, cos_i = np.maximum(0, -(normal * w).sum(axis=1)), w @ up
        term = cos_x / np.maximum(r, least) ** 2
        # Eq. (2)
        result[i] = (term * np.maximum(0, cos_i) / math.pi)[:, None] * lights.flux[:, i].astype(float)
        if lights.lobe_flux is not None and lights.lobe_flux[:, i].any():
            # Eq. (3)
            result[i] += (term * lobe(w, up, lights, i))[:, None] * lights.lobe_flux[:, i].astype(float)
    return result


def lobe(w, up, lights, i):
    """Return (P + 1) / (2 pi K) <r w>^P above the surface."""
    axis, exponent = lights.lobe_axis[:, i].astype(float), float(lights.lobe_exponent[i])
    axis = axis / np.linalg.norm(axis)
    norm = (exponent + 1) / (2 * math.pi * share_above(up @ axis, exponent))
    return norm * np.maximum(0, w @ axis) ** exponent * (w @ up > 0)


def share_above(cosine, exponent):
    """Return K(theta, P) = 1 - I_{sin^2 theta}((P + 1) / 2, 1 / 2) / 2, for theta > pi / 2 one less K(pi - theta)."""
    half = betainc((exponent + 1) / 2, 0.5, 1 - cosine * cosine) / 2
    return np.where(cosine >= 0, 1 - half, half)
