"""How texels of reflective shadow maps become pixel lights (SII Sec. 3.1, 3.5): importance, points, texels, lights.

Symbols: T texels of a map, N its lights; u, v a point of the unit square, u along columns, v along rows downwards;
w weight of the warp (refgi.literal.warp); Phi_t flux of a texel, Phi_i of a light, W; P exponent of a lobe, O openness.
Maps of one lamp (six of a cube) are stacked along rows; a texel is row * columns + column. Lists hold one array a lamp.
"""

from typing import Any

import numpy as np

BELOW_1 = 1 - 2.0**-24  # the largest float32 below 1
GRAZING_LAMP = 1e-3  # least cosine between a texel's normal and its lamp


def importance(
    flux: Any, lobe_flux: Any = None, lobe_exponent: Any = None, peaked: bool = False, openness: Any = None,
    floor: float = 0.05,
) -> Any:
    """Return the importance (h, w) of texels for the warp, W: Phi, of lobes times their peak, times 1 - O (Sec. 3.5).

    Flux is (3, h, w), its largest channel counts; `peaked`: with the lobes' peak; openness (h, w), or None to leave it.
    """
    gain = (lobe_exponent + 1) / 2 if peaked else 1  # E-SII-09: a lobe's peak over a diffuse light's, printed as P
    total = flux if lobe_flux is None else flux + gain * lobe_flux
    largest = total.max(axis=0)
    return largest if openness is None else largest * np.maximum(floor, 1 - openness)  # E-SII-09: a floor


def halton_points(counts: Any, shifts: Any, number: int) -> Any:
    """Return the points (N, 2) of map `number`: Halton's in bases 2 and 3 from index 0 on, shifted modulo 1 (Sec. 3.1).

    Each map has a sequence of its own: counts[k] points, shifted by shifts[k].
    """
    k = np.arange(counts[number])
    inverse = np.stack([radical_inverse(k, 2), radical_inverse(k, 3)], axis=1)
    points = (inverse + shifts[number]) % 1
    return np.minimum(points, BELOW_1)


def radical_inverse(index: Any, base: int) -> Any:
    """Return whole numbers with their digits mirrored at the point: d_0 / b + d_1 / b^2 + .. of d_0 + d_1 b + .."""
    value, place = np.zeros(len(index)), 1.0
    while index.any():
        digit, index, place = index % base, index // base, place / base
        value = value + digit * place
    return value


def grid_points(n: int) -> Any:
    """Return the centres (n n, 2) of n x n cells of the unit square, row by row (Sec. 3.1)."""
    centre = (np.arange(n) + 0.5) / n
    u, v = np.tile(centre, n), np.repeat(centre, n)
    return np.stack([u, v], axis=1)


def texels(
    points: Any, counts: Any, number: int, maps: int, rows: int, columns: int, density_weight: Any = 1.0
) -> Any:
    """Return the texels (N,) that points fall on, and T/N w: for how many texels each stands (Sec. 3.1, Eq. 6).

    `maps` of `rows` x `columns` are stacked; map `number` has counts[number] lights.
    """
    u, v = points.T
    height = maps * rows
    column = np.minimum(np.floor(u * columns), columns - 1).astype(np.int64)
    row = np.minimum(np.floor(v * height), height - 1).astype(np.int64)
    texel = row * columns + column
    T, N = height * columns, counts[number]
    w = density_weight * np.ones(len(points), points.dtype)
    return texel, T / N * w


def pixel_lights(
    texel: Any, weight: Any, position: Any, normal: Any, flux: Any, lobe_flux: Any = None, lobe_axis: Any = None,
    lobe_exponent: Any = None,
) -> Any:
    """Return the lights of all maps, in the order of maps and points: place, normal, flux (3, N), texel and map (N,).

    With lobes (3, N) flux, (3, N) axis and (N,) exponent stand before texel and map. All arguments are lists.
    """
    sent = flux if lobe_flux is None else [one + lobe for one, lobe in zip(flux, lobe_flux, strict=True)]
    bright = [one.max(axis=0).ravel()[at] > 0 for one, at in zip(sent, texel, strict=True)]
    listed = np.flatnonzero(np.concatenate(bright))  # texels without flux are no lights
    number = np.concatenate([np.full(len(at), k) for k, at in enumerate(texel)])[listed]
    chosen = np.concatenate(texel)[listed]
    w = np.concatenate(weight)[listed]
    p = look_up(position, number, chosen)
    m = look_up(normal, number, chosen)
    phi = w * look_up(flux, number, chosen)  # Phi_i = T/N w Phi_t
    lobes: Any = ()
    if lobe_flux is not None:
        lobe = w * look_up(lobe_flux, number, chosen)
        axis = look_up(lobe_axis, number, chosen)
        exponent = look_up(lobe_exponent, number, chosen)
        lobes = lobe, axis, exponent
    return p, m, phi, *lobes, chosen, number


def look_up(planes: Any, number: Any, texel: Any) -> Any:
    """Return what texels (n,) of maps `number` (n,) hold, (3, n) or (n,), of planes (3, h, w) or (h, w), one a map."""
    values = np.zeros((*planes[0].shape[:-2], len(texel)), planes[0].dtype)
    for k, plane in enumerate(planes):
        here = number == k
        columns = plane.shape[-1]
        row, column = np.divmod(texel[here], columns)
        values[..., here] = plane[..., row, column]
    return values


def footprints(
    position: Any, normal: Any, texel: Any, number: Any, solid_angle: Any, drawn: Any, weight: Any, lamp: Any,
    near: Any,
) -> Any:
    """Return the area (N,) that each light stands for, m^2: A = Omega d^2 / cos of its texel, times T/N w.

    By lamps: solid angle (h, w) sr, texels drawn and their T/N w, place (3,) where near[k], else direction (3,): then a
    texel has an area across the light in place of a solid angle, and no d^2.
    """
    area = np.zeros(len(texel), position.dtype)
    for k in range(len(lamp)):
        here = number == k
        away = lamp[k][:, None] - position[:, here] if near[k] else -lamp[k][:, None] + 0 * position[:, here]
        d = np.sqrt((away**2).sum(axis=0))
        cosine = np.maximum(np.abs((away * normal[:, here]).sum(axis=0)) / d, GRAZING_LAMP)
        stands_for = dict(zip(drawn[k].tolist(), weight[k], strict=True))  # T/N w of a texel
        w = np.array([stands_for[t] for t in texel[here].tolist()], position.dtype)
        angle = solid_angle[k].ravel()[texel[here]]
        square = d**2 if near[k] else 1
        area[here] = angle * square / cosine * w
    return area
