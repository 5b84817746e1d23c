"""One pixel light at one receiver, and their sum (SII Sec. 3, Eq. 2 and 3).

Symbols: x, n receiver and its normal; p, m pixel light and its normal; w unit direction from p to x; r its distance;
flux Phi (3,) W; lobe: flux, axis, exponent P; A the surface that a light stands for, m^2. A bounds a pair near its
light as a disc of that area does; without it, as printed, nothing does.
"""

from functools import cache
from typing import Any

import numpy as np

LEAST_SHARE = 1e-12  # of a lobe above the surface: of less nothing leaves


def irradiance(
    position: Any, normal: Any, triangle_id: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None,
) -> Any:
    """Sum all pixel lights at every receiver: E (3, h, w), W/m^2, without visibility and albedo/pi (SII Eq. 2).

    Receivers are (3, h, w), 0 where triangle_id < 0; lights (3, N). `area` (N,) bounds each pair as a disc does.
    """
    x, n = position.reshape(3, 1, -1), normal.reshape(3, 1, -1)
    p, m, phi = light_position[:, :, None], light_normal[:, :, None], flux[:, :, None]
    lobe = None if lobe_flux is None else (lobe_flux[:, :, None], lobe_axis[:, :, None], lobe_exponent[:, None])
    each = pair(x, n, p, m, phi, lobe, 0.0 if area is None else area[:, None])
    total = each.sum(axis=1)
    return np.where(triangle_id >= 0, total.reshape(position.shape), 0)


def occluded(irradiance: Any, openness: Any) -> Any:
    """Return E (3, h, w), W/m^2, under ambient occlusion: times the openness O (h, w) of each receiver (SII Sec. 7)."""
    return openness * irradiance


def pairs(
    position: Any, normal: Any, light_position: Any, light_normal: Any, flux: Any, lobe_flux: Any = None,
    lobe_axis: Any = None, lobe_exponent: Any = None,
) -> Any:
    """Return E (3, 1, n), W/m^2, of light k (3, n) at receiver k (3, 1, n) alone (SII Eq. 2)."""
    x, n = position[:, 0], normal[:, 0]
    lobe = None if lobe_flux is None else (lobe_flux, lobe_axis, lobe_exponent)
    each = pair(x, n, light_position, light_normal, flux, lobe)
    return each[:, None]


def pair(x: Any, n: Any, p: Any, m: Any, flux: Any, lobe: Any = None, area: Any = 0.0) -> Any:
    """Return E, W/m^2, of lights at receivers, for all pairs that the arrays broadcast to (SII Eq. 2)."""
    d = x - p
    r = np.sqrt((d**2).sum(axis=0))
    w = np.divide(d, r, out=np.zeros_like(d), where=r > 0)
    received = np.maximum(0, -(n * w).sum(axis=0))
    sent = np.maximum(0, (m * w).sum(axis=0))
    square = r**2 + area / np.pi  # a disc of area A has the form factor A / (pi r^2 + A) on its axis
    fall = np.divide(1, square, out=np.zeros_like(square), where=r > 0)  # E-SII-02: unit directions and r^2
    term = sent * received * fall
    # Eq. (2)
    total = flux / np.pi * term
    if lobe is not None:
        total = total + lobe[0] * lobe_intensity(w, m, *lobe[1:]) * received * fall
    return total


def lobe_intensity(w: Any, m: Any, axis: Any, exponent: Any) -> Any:
    """Return c cos^P, 1/sr, of lobes of unit flux along w; nothing leaves below the surface (SII Eq. 3)."""
    cosine = (axis * w).sum(axis=0)
    # Eq. (3)
    power = np.where(cosine < 0, 0, np.maximum(0, cosine) ** exponent)  # also where P = 0
    return np.where((m * w).sum(axis=0) > 0, lobe_norm((m * axis).sum(axis=0), exponent) * power, 0)


def lobe_norm(cosine: Any, exponent: Any) -> Any:
    """Return c = (P + 1) / (2 pi K), 1/sr, 0 where nothing leaves (E-SII-03); `cosine`: between axis and normal."""
    share = lobe_share(np.clip(cosine, -1, 1), exponent)
    return np.where(share > LEAST_SHARE, (exponent + 1) / (2 * np.pi) / np.maximum(share, LEAST_SHARE), 0)


def lobe_share(cosine: Any, exponent: Any) -> Any:
    """Return K: the share of the integral of cos^P around an axis that lies above a surface, theta off its normal.

    Around the axis, at the angle a off it, the azimuths with cos theta cos a + sin theta sin a cos phi > 0 lie above.
    A sine substitution on each side of the bend at a = pi/2 - theta makes the integrand smooth (Gauss-Legendre).
    """
    theta, exponent = np.broadcast_arrays(np.arccos(cosine.astype(np.float64)), exponent)
    node, weight = nodes()
    turn, weight = np.pi / 2 * (node + 1), np.pi / 2 * weight
    edge = (np.pi / 2 - theta)[..., None]
    share = np.zeros(theta.shape)
    for low, high in ((np.zeros_like(edge), edge), (np.abs(edge), np.full_like(edge, np.pi / 2))):
        a = low + (high - low) / 2 * (1 - np.cos(turn))
        da = (high - low) / 2 * np.sin(turn) * weight
        level = np.cos(theta)[..., None] * np.cos(a)
        azimuth = 2 * np.arccos(np.clip(-level / np.maximum(np.sin(theta)[..., None] * np.sin(a), 1e-300), -1, 1))
        part = azimuth * np.cos(a) ** exponent[..., None] * np.sin(a) * da
        share += np.where(high > low, part, 0).sum(axis=-1)
    return share * (exponent + 1) / (2 * np.pi)


@cache
def nodes() -> Any:
    """Return nodes in -1 to 1 and weights of Gauss-Legendre quadrature."""
    return np.polynomial.legendre.leggauss(400)
