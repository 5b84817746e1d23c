"""The range of pixel lights and the sum of the pairs in range (SII Sec. 3.4, Fig. 8, Eq. 7 and 8).

Symbols: I_0 peak intensity of a part of a light, W/sr; B = I(w) / r^2 the irradiance that it causes at most, W/m^2;
I_low the irradiance under which pairs are left out; R_0^2 = I_0 / I_low. The parts of a light, diffuse and lobe, have
each a range of their own: functions return an array for lights without lobes, with lobes the two of both parts.
Receivers are (3, h, w) with triangle_id (h, w), -1 without surface; lights (3, N).
"""

from typing import Any

import numpy as np

from refgi.literal.pairs import lobe_intensity, lobe_norm, pair

PAPER_SHARE = 125 / 768  # of pairs that count at a cut of PAPER_CUT (Fig. 8)
PAPER_CUT = 0.05
LONGEST = 10  # diagonals of what is seen and lights it
TANGENT_POINT = 0.71  # in R_0: the ellipsoids there waste least (E-SII-13)


def sii(
    position: Any, normal: Any, triangle_id: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None, *, drawn: int,
    share: float = PAPER_CUT,
) -> Any:
    """Return the irradiance (3, h, w) of the pairs in range, W/m^2: I_low is a share of the largest I_0 over L^2."""
    lobe = lobe_flux, lobe_axis, lobe_exponent
    seen = position, normal, triangle_id, light_position, light_normal, flux, *lobe
    peak, lobe_peak = one_or_two(peaks(light_normal, flux, *lobe))
    low = low_irradiance(reference_length(*seen, drawn=drawn), peak, lobe_peak, share=share)
    diffuse, glossy = one_or_two(kept(low, *one_or_two(strengths(*seen))))
    return range_sum(diffuse, glossy, *seen, area)


def largest(flux: Any) -> Any:
    """Return the channel that counts for the range."""
    return flux.max(axis=0)


def peaks(normal: Any, flux: Any, lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None) -> Any:
    """Return I_0 (N,) of the parts of lights, W/sr."""
    diffuse = largest(flux) / np.pi
    if lobe_flux is None:
        return diffuse
    norm = lobe_norm((normal * lobe_axis).sum(axis=0), lobe_exponent)
    return diffuse, largest(lobe_flux) * norm


def strengths(
    position: Any, normal: Any, triangle_id: Any, light_position: Any, light_normal: Any, flux: Any,  # noqa: ARG001
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None,
) -> Any:
    """Return B (N, h, w) of the parts of lights, W/m^2; the receiver's cosine, by `normal`, is taken as 1."""
    covered = triangle_id >= 0
    d = position[:, None] - light_position[:, :, None, None]
    r = np.sqrt((d**2).sum(axis=0))
    w = np.divide(d, r, out=np.zeros_like(d), where=r > 0)
    fall = np.divide(1, r**2, out=np.zeros_like(r), where=(r > 0) & covered)
    m = light_normal[:, :, None, None]
    cosine = np.maximum(0, (m * w).sum(axis=0))
    diffuse = (largest(flux) / np.pi)[:, None, None] * cosine * fall
    if lobe_flux is None:
        return diffuse
    shape = lobe_intensity(w, m, lobe_axis[:, :, None, None], lobe_exponent[:, None, None])
    return diffuse, largest(lobe_flux)[:, None, None] * shape * fall


def reference_length(
    position: Any, normal: Any, triangle_id: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, *, drawn: int,
) -> Any:
    """Return L (1,), m: under it a cut of 5 % of the largest I_0 leaves 125 of 768 pairs (Fig. 8; E-SII-11).

    Of N lights `drawn` were chosen, those without flux among them. 1 where nothing is lit.
    """
    covered = triangle_id >= 0
    lobe = lobe_flux, lobe_axis, lobe_exponent
    brightest = np.max(peaks(light_normal, flux, *lobe), initial=0)
    b = np.ravel(strengths(position, normal, triangle_id, light_position, light_normal, flux, *lobe))
    if not b.size:
        return np.ones(1, position.dtype)
    places = np.concatenate([position[:, covered], light_position], axis=1)
    length = LONGEST * np.sqrt((np.ptp(places, axis=1) ** 2).sum())
    left = round(PAPER_SHARE * drawn * np.count_nonzero(covered))
    if 0 < left <= np.count_nonzero(b):
        least = np.sort(b)[-left]
        length = min(length, np.sqrt(PAPER_CUT * brightest / least))
    return np.array([length], position.dtype)


def low_irradiance(length: Any, diffuse_peak: Any, glossy_peak: Any = None, *, share: float) -> Any:
    """Return I_low (1,), W/m^2: a share of the largest I_0 over the square of the length (E-SII-11)."""
    brightest = diffuse_peak.max(initial=0)
    if glossy_peak is not None:
        brightest = max(brightest, glossy_peak.max(initial=0))
    return share * brightest / length**2


def squares(
    low: Any, length: Any, diffuse_peak: Any, glossy_peak: Any = None, *, share: float, per_light: bool = False
) -> Any:
    """Return R_0^2 (N,) of the parts of lights, m^2; `per_light`: I_low is a share of each light's own I_0, as printed.

    All lights then reach equally far (E-SII-11).
    """
    parts = [diffuse_peak] if glossy_peak is None else [diffuse_peak, glossy_peak]
    thresholds = [share * peak / length**2 if per_light else low for peak in parts]
    found = [peak / np.where(peak > 0, one, 1) for peak, one in zip(parts, thresholds, strict=True)]
    return found[0] if glossy_peak is None else tuple(found)


def kept(low: Any, diffuse_strength: Any, glossy_strength: Any = None) -> Any:
    """Return which pairs (N, h, w) of the parts of lights count: B >= I_low, never where B is 0."""
    parts = [diffuse_strength] if glossy_strength is None else [diffuse_strength, glossy_strength]
    counts = [(b >= low[0]) & (b > 0) for b in parts]
    return counts[0] if glossy_strength is None else tuple(counts)


def range_sum(
    diffuse_kept: Any, glossy_kept: Any, position: Any, normal: Any, triangle_id: Any, light_position: Any,
    light_normal: Any, flux: Any, lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None,
    area: Any = None, low: Any = None,  # noqa: ARG001 the masks are what B >= I_low has decided
) -> Any:
    """Return the irradiance (3, h, w) of the pairs that count (N, h, w), W/m^2, without visibility and albedo/pi."""
    x, n = position[:, None], normal[:, None]
    p, m, phi = (one[:, :, None, None] for one in (light_position, light_normal, flux))
    size = 0.0 if area is None else area[:, None, None]
    each = pair(x, n, p, m, phi, None, size)
    total = (each * diffuse_kept).sum(axis=1)
    if lobe_flux is not None:
        lobe = lobe_flux[:, :, None, None], lobe_axis[:, :, None, None], lobe_exponent[:, None, None]
        glossy = pair(x, n, p, m, 0 * phi, lobe, size)
        total = total + (glossy * glossy_kept).sum(axis=1)
    return np.where(triangle_id >= 0, total, 0)


def ellipsoids(exponent: Any) -> Any:
    """Return centre, half width and height (n,) in R_0 of two bounds each of B >= I_low for cos^n: Eq. 8's, tangent's.

    Ellipsoids of revolution about the light's axis, along which half the width lies; the diffuse part has n = 1. The
    tangent one touches the region at x_0 and meets the light. They bound what is drawn, and change no sum.
    """
    n = exponent.astype(np.float64)  # k below falls as 1/n
    # Eq. (8)
    center = (n / (n + 2)) ** ((n + 2) / 4)  # E-SII-12: an exponent, printed as a factor
    # Eq. (7) at the centre
    height = (n / (n + 2)) ** (n / 4) * np.sqrt(2 / (n + 2))
    half_width = np.maximum(center, 1 - center)
    b, x0 = 2 * np.maximum(n, 2) / (np.maximum(n, 2) + 2), TANGENT_POINT  # E-SII-13: F^2 = x g(x)
    g = x0 ** (b - 1) - x0
    k = 1 - (b - 1) * x0 ** (b - 2)  # minus the slope of g
    middle = (x0 + g / k) / 2
    tangent = [np.where(n < 2, old, new) for old, new in (
        (center, middle), (half_width, middle), (height, middle * np.sqrt(k)))]
    return center, half_width, height, *tangent


def stored_surface(position: Any, normal: Any) -> Any:
    """Return what textures keep of receivers (3, h, w): half floats, normals of 8 bits a component (SII Sec. 4)."""
    return in_half(position), in_bytes(normal)


def stored_lights(
    light_position: Any, light_normal: Any, flux: Any, lobe_flux: Any = None, lobe_axis: Any = None,
) -> Any:
    """Return what textures keep of lights (3, N): flux as 256 even shares of the largest of all parts (SII Sec. 6)."""
    place, n = in_half(light_position), in_bytes(light_normal)
    largest = flux.max(initial=0) if lobe_flux is None else max(flux.max(initial=0), lobe_flux.max(initial=0))
    step = (largest or 1) / 255
    phi = np.floor(flux / step + 0.5) * step
    if lobe_flux is None:
        return place, n, phi
    return place, n, phi, np.floor(lobe_flux / step + 0.5) * step, in_bytes(lobe_axis)


def in_half(position: Any) -> Any:
    """Return the nearest half floats, of equally near ones the even."""
    return position.astype(np.float16).astype(position.dtype)


def in_bytes(vectors: Any) -> Any:
    """Return unit vectors of components that are the nearest of 256 from -1 to 1; what is 0 stays 0."""
    code = np.floor((vectors + 1) / 2 * 255 + 0.5)
    read = 2 * code / 255 - 1
    return np.where(vectors.any(axis=0), read / np.sqrt((read**2).sum(axis=0)), 0)


def one_or_two(parts: Any) -> Any:
    """Return what there is of the parts of lights as a pair: None for lobes where there are none."""
    return parts if isinstance(parts, tuple) else (parts, None)
