"""Area lights of clustered visibility: boxes, k-means over pixel lights, rectangles, their light (VAL Sec. 4, 5, 6).

Symbols: N pixel lights, M clusters; x, n place and normal of a light, c, n_c of a cluster; C(i), `of`, the cluster of
light i; Delta the size of a cluster's rectangle; E_m irradiance of its lights, V_m the share of it that is visible.
"""

from typing import Any

import numpy as np

from refgi.literal.pairs import pair

UPRIGHT = 0.999  # |y| of a normal from which a map's up is -z
FLAT = 1e-5  # of a cluster's radius: a narrower rectangle is a line
NO_MEAN = 1e-9  # a shorter mean of unit normals has no direction
NO_SPREAD = 1e-9  # of the whole: as little more spread along one axis than another has no direction
RUNS = 3  # of lights next to each other that a pixel takes where they are dealt out by cluster


def visible_extent(position: Any, triangle_id: Any) -> Any:
    """Return the box of what pixels see, m: position (3, h, w), triangle_id (h, w), -1 without surface."""
    seen = position[:, triangle_id >= 0]
    return box(seen)


def illuminated_extent(map_positions: Any, map_fluxes: Any, map_lobe_fluxes: Any = None) -> Any:
    """Return the box, m, of what reflects light in any light's map: a list of (3, h, w) of all maps each."""
    lobes = map_fluxes if map_lobe_fluxes is None else map_lobe_fluxes
    lit = [flux.any(axis=0) | lobe.any(axis=0) for flux, lobe in zip(map_fluxes, lobes, strict=True)]
    reflecting = [place[:, here] for place, here in zip(map_positions, lit, strict=True)]
    return box(np.concatenate(reflecting, axis=1))


def box(points: Any) -> Any:
    """Return least and greatest of each coordinate, (3,), of points (3, n)."""
    least, greatest = points.min(axis=1), points.max(axis=1)
    return least, greatest


def kmeans_start(position: Any, normal: Any, count: int) -> Any:
    """Return centres and normals (3, M) at which clusters begin: those of light floor(k N / M) (Sec. 5.2, 6)."""
    n, k = position.shape[1], np.arange(count)
    first = k * n // count
    return position[:, first], normal[:, first]


def kmeans_assign(
    position: Any, normal: Any, illuminated: Any, center: Any, axis: Any, distance: str, w_x: float = 0.7,
    w_a: float = 0.3,
) -> Any:
    """Return C(i) of each light (N,), the lowest index of equally near clusters, and its distance (Sec. 5.1).

    `distance` is "raw", in metres and radians as printed; "normalised", in shares of the illuminated box's diagonal and
    of pi; or "squared", of which alone means are the minimum (E-VAL-11).
    """
    away = position[:, :, None] - center[:, None]
    dx = np.sqrt((away**2).sum(axis=0))
    side = illuminated[1] - illuminated[0]
    diagonal = np.sqrt((side**2).sum())
    along = (normal[:, :, None] * axis[:, None]).sum(axis=0)
    across = np.linalg.norm(np.cross(normal[:, :, None], axis[:, None], axis=0), axis=0)
    angle = np.arctan2(across, along)
    if distance == "raw":
        d = w_x * dx + w_a * angle  # Sec. 5.1: d = w_x dx + w_alpha dalpha
    elif distance == "squared":
        turned = ((normal[:, :, None] - axis[:, None]) ** 2).sum(axis=0)
        d = w_x * (dx / diagonal) ** 2 + w_a * turned
    else:
        d = w_x * dx / diagonal + w_a * angle / np.pi
    of = d.argmin(axis=1)
    least = d[np.arange(len(of)), of]
    return of, least


def kmeans_means(position: Any, normal: Any, of: Any, center: Any, axis: Any) -> Any:
    """Return the means (3, M) of each cluster's lights: places, m, and unit normals; without lights it stays."""
    center, axis = center.copy(), axis.copy()
    for k in range(center.shape[1]):
        own = of == k
        if own.any():
            x, n = position[:, own], normal[:, own]
            mean = n.mean(axis=1)
            length = np.linalg.norm(mean)
            center[:, k] = x.mean(axis=1)
            axis[:, k] = mean / length if length > NO_MEAN else axis[:, k]
    return center, axis


def kmeans_rounds(
    position: Any, normal: Any, illuminated: Any, center: Any, axis: Any, distance: str, w_x: float, w_a: float,
    rounds: int,
) -> Any:
    """Return centres and normals (3, M), and C(i) (N,), after rounds until no light changes its cluster (Sec. 5.1)."""
    of = kmeans_assign(position, normal, illuminated, center, axis, distance, w_x, w_a)[0]
    for _ in range(rounds):
        before = of
        center, axis = kmeans_means(position, normal, of, center, axis)
        of = kmeans_assign(position, normal, illuminated, center, axis, distance, w_x, w_a)[0]
        if (of == before).all():
            break
    return center, axis, of


def kmeans_each(position: Any, normal: Any) -> Any:
    """Return centres, unit normals and C(i) where M = N: each light is a cluster, coincident ones too."""
    length = np.sqrt((normal**2).sum(axis=0))
    of = np.arange(position.shape[1])
    return position, normal / length, of


def areas(position: Any, center: Any, normal: Any, of: Any, axes: str, extent: str, unbiased: bool) -> Any:
    """Return the rectangle around each cluster's lights, projected along its normal (Sec. 6, E-VAL-10).

    Frames of maps (M, 3, 3); axes of rectangles (M, 2, 3), the map's ("fixed"), along the lights' spread ("pca") or of
    least area ("min_area"); sides, and middles from the centres (2, M), m; Delta (M,), m, the "root" of both sides'
    product, the "longer" or the "shorter"; distances of the farthest lights (M,), m; numbers of lights (M,).
    """
    frame, count = map_frames(normal), center.shape[1]
    along, members = frame[:, :2].copy(), np.bincount(of, minlength=count)
    side, offset, radius = np.zeros_like(center[:2]), np.zeros_like(center[:2]), np.zeros_like(center[0])
    for k in np.flatnonzero(members):
        away = position[:, of == k] - center[:, k, None]
        radius[k] = np.sqrt((away**2).sum(axis=0)).max()
        flat = frame[k, :2] @ away
        turn = 0.0 if axes == "fixed" else turn_of_spread(flat) if axes == "pca" else turn_of_least_area(flat)
        right, down = frame[k, :2]
        along[k] = np.cos(turn) * right + np.sin(turn) * down, np.cos(turn) * down - np.sin(turn) * right
        st = along[k] @ away
        low, high = st.min(axis=1), st.max(axis=1)
        side[:, k], offset[:, k] = high - low, (low + high) / 2
    side = np.where(side < FLAT * radius, 0, side)
    if unbiased:  # E-VAL-10: n lights span (n - 1) / (n + 1) of a side on average
        side = side * ((members + 1) / np.maximum(members - 1, 1)).astype(side.dtype)
    sizes = {"root": np.sqrt(side[0] * side[1]), "longer": side.max(axis=0), "shorter": side.min(axis=0)}
    delta = sizes[extent]
    return frame, along, side, offset, delta, radius, members


def map_frames(normal: Any) -> Any:
    """Return frames (M, 3, 3) of maps that look along normals (3, M): rows right, down, forward."""
    forward = normal.T
    up = np.where(np.abs(forward[:, 1:2]) < UPRIGHT, (0, 1, 0), (0, 0, -1)).astype(normal.dtype)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right, axis=1, keepdims=True)
    down = np.cross(forward, right)
    return np.stack([right, down, forward], axis=1)


def turn_of_spread(flat: Any) -> Any:
    """Return the angle from the first axis to that of the greatest variance of points (2, n)."""
    s, t = flat - flat.mean(axis=1, keepdims=True)
    difference, product, total = (s * s - t * t).sum(), (2 * s * t).sum(), (s * s + t * t).sum()
    return np.arctan2(product, difference) / 2 if np.hypot(difference, product) > NO_SPREAD * total else 0.0


def turn_of_least_area(flat: Any) -> Any:
    """Return the angle to a side of the rectangle of least area: an edge of the hull (Freeman and Shapira 1975)."""
    edge = flat[:, None] - flat[:, :, None]  # from point i to point j, (2, i, j)
    length = np.hypot(*edge)
    left = edge[0][..., None] * edge[1][:, None] - edge[1][..., None] * edge[0][:, None]  # of it lies point k
    hull = (length > 0) & (left >= -NO_SPREAD * length.max() ** 2).all(axis=2)
    if not hull.any():
        return 0.0
    c, d = edge[:, hull] / length[hull]
    wide, high = c[:, None] * flat[0] + d[:, None] * flat[1], c[:, None] * flat[1] - d[:, None] * flat[0]
    best = (np.ptp(wide, axis=1) * np.ptp(high, axis=1)).argmin()
    return np.arctan2(d[best], c[best])


def facing(normal: Any, triangle_id: Any, vertices: Any = None, faces: Any = None) -> Any:
    """Return unit normals (3, h, w) of the triangles that pixels see, on the side of the interpolated ones.

    Planes and sides are the triangle's (docs/conventions).
    """
    if vertices is None:
        return normal  # nothing is interpolated
    a, b, c = vertices[faces].swapaxes(0, 1)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    flat = across / np.maximum(length, 1e-30)
    own = np.moveaxis(flat[triangle_id], 2, 0)
    turned = np.where((own * normal).sum(axis=0) < 0, -own, own)
    return np.where(triangle_id >= 0, turned, 0)


def interleaving(of: Any, side: int, assignment: str) -> Any:
    """Return the subset of each light (N,), 0 to n^2 - 1, n = `side` (Sec. 6, E-VAL-13).

    By "index", or by "cluster": runs of lights sorted by their cluster, dealt out over the block as evenly as can be.
    """
    light, count = np.arange(len(of)), side**2
    if assignment == "index":
        subset = light % count
    else:
        runs = count * min(RUNS, max(len(of) // count, 1))
        run = light * runs // len(of)
        place = dithered(side)[run % count]
        subset = place[np.argsort(np.argsort(of, kind="stable"))]
    return subset


def dithered(side: int) -> Any:
    """Return the places of a block in the order of Bayer's dither: halves, quarters and so on cover it evenly."""
    row, column = np.indices((side, side))
    rank = np.zeros((side, side), np.int64)
    for bit in range(side.bit_length()):  # the lowest bits of row and column count most
        rank = 4 * rank + np.array([[0, 2], [3, 1]])[row >> bit & 1, column >> bit & 1]
    return rank.argsort(axis=None)


def parts(
    position: Any, normal: Any, triangle_id: Any, light_position: Any, light_normal: Any, flux: Any, of: Any,
    center: Any, subset: Any = None, side: int = 1, lobe_flux: Any = None, lobe_axis: Any = None,
    lobe_exponent: Any = None, area: Any = None,
) -> Any:
    """Return E_m (M, 3, h, w), W/m^2, of each cluster's lights without visibility (Sec. 4; SII Eq. 2, E-VAL-01).

    A pixel takes the lights of one subset of n^2, n = `side`, each of them n^2 times (Sec. 6, E-VAL-13).
    """
    x, n = position.reshape(3, 1, -1), normal.reshape(3, 1, -1)
    p, m, phi = light_position[:, :, None], light_normal[:, :, None], flux[:, :, None]
    lobe = None if lobe_flux is None else (lobe_flux[:, :, None], lobe_axis[:, :, None], lobe_exponent[:, None])
    each = pair(x, n, p, m, phi, lobe, 0.0 if area is None else area[:, None])
    row, column = np.indices(triangle_id.shape)
    own = row % side * side + column % side
    subset = np.zeros_like(of) if subset is None else subset
    takes = subset[:, None] == own.reshape(-1)
    each = np.where(takes & (triangle_id.reshape(-1) >= 0), each, 0)
    sums = np.stack([each[:, of == k].sum(axis=1) for k in range(center.shape[1])])
    return side**2 * sums.reshape(-1, *position.shape)


def shadowed(irradiance: Any, share: Any) -> Any:
    """Return E (3, h, w), W/m^2, of E_m (M, 3, h, w) and V_m (M, h, w) (Sec. 4)."""
    e, v = irradiance, share[:, None]
    return (e * v).sum(axis=0)  # Sec. 4: L = sum_i L_i V_C(i)
