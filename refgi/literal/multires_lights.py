"""Light at subsplats, and lists of subsplats that each light refines by itself (AMS Sec. 3.3.1, 3.4, 4: Nichols 2009).

Symbols: E irradiance, W/m^2; x, n point and normal that a subsplat is evaluated at; T threshold of a light's lists;
a of Eq. 3; level, row i, column j of a cell, side 2^level pixels.
"""

from typing import Any

import numpy as np

from refgi.literal.pairs import irradiance, pair
from refgi.literal.vpl import facing, shadowed_sum, visible

# subsplats of all lights: where they are evaluated, their light


def points(
    position: Any, normal: Any, triangle_id: Any, level: Any, row: Any, column: Any, pixel: Any, mean: bool
) -> tuple[Any, Any]:
    """Return point and normal (3, n) that each subsplat is evaluated at (Sec. 3.4; E-AMS-11: the paper does not say).

    Its representative pixel's, or for `mean` those of the cell's mean surface.
    """
    y, x = np.divmod(pixel, triangle_id.shape[1])
    point, up = position[:, y, x], normal[:, y, x]
    if mean:
        shown, cells = triangle_id >= 0, list(zip(level, row, column, strict=True))
        point = np.stack([inside(position, shown, *cell).mean(axis=1) for cell in cells], axis=1)
        up = np.stack([inside(normal, shown, *cell).mean(axis=1) for cell in cells], axis=1)
        up = up / np.sqrt((up**2).sum(axis=0))
    return point, up


def inside(plane: Any, shown: Any, level: int, i: int, j: int) -> Any:
    """Return the pixels (3, m) of a cell that show a surface."""
    side = 1 << level
    rows, columns = slice(i * side, (i + 1) * side), slice(j * side, (j + 1) * side)
    return plane[:, rows, columns][:, shown[rows, columns]]


def subsplat_irradiance(
    point: Any, point_normal: Any, light_position: Any, light_normal: Any, flux: Any, lobe_flux: Any = None,
    lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None,
) -> Any:
    """Return E (3, n) of all pixel lights at subsplats, without albedo/pi (Eq. 2; E-AMS-02: flux is reflected flux)."""
    x, n, surface = point[:, None], point_normal[:, None], np.zeros((1, point.shape[1]), np.int32)
    # Eq. (2)
    total = irradiance(x, n, surface, light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, area)
    return total[:, 0]


# the same under shadow rays: faces, what each subsplat sees, the sum of that


def subsplat_facing(vertices: Any, faces: Any, point_normal: Any, triangle_id: Any, pixel: Any) -> Any:
    """Return the normals (3, n) of the faces that subsplats lie on, on the side of theirs."""
    return facing(vertices, faces, point_normal, triangle_id.ravel()[pixel])


def lights_seen(
    vertices: Any, faces: Any, point: Any, point_normal: Any, triangle_id: Any, pixel: Any, face_normal: Any,
    light_position: Any, light_normal: Any,
) -> Any:
    """Return V (N, n): which lights reach which subsplats."""
    own = triangle_id.ravel()[pixel]
    return visible(vertices, faces, point, point_normal, own, face_normal, light_position, light_normal)


def seen_irradiance(
    point: Any, point_normal: Any, seen: Any, light_position: Any, light_normal: Any, flux: Any, lobe_flux: Any = None,
    lobe_axis: Any = None, lobe_exponent: Any = None,
) -> Any:
    """Return E (3, n) of the lights that each subsplat sees (N, n), without albedo/pi (Eq. 2 with V)."""
    x, n, surface = point[:, None], point_normal[:, None], np.zeros((1, point.shape[1]), np.int32)
    lights = light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent
    return shadowed_sum(x, n, surface, seen[:, None], *lights)[:, 0]


# the same under soft shadows: those of pictures, on a picture of one row


def one_row(position: Any, normal: Any, triangle_id: Any, pixel: Any) -> tuple[Any, Any, Any]:
    """Return position and normal (3, 1, n) and triangle (1, n) of the pixels of subsplats, a picture of one row."""
    point, up = points(position, normal, triangle_id, None, None, None, pixel, mean=False)
    return point[:, None], up[:, None], triangle_id.ravel()[None, pixel]


def of_row(irradiance: Any) -> Any:
    """Return E (3, n) of a picture of one row."""
    return irradiance[:, 0]


# lists of each light: samples at quadrants decide


def samples(
    position: Any, normal: Any, pixels: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None,
) -> list[Any]:
    """Return E (N, 3, h_l, w_l) of each light alone at the representative pixel of each cell, 0 without surface.

    Lists of levels 0 to top. Lights are (3, N).
    """
    made = []
    p, m, phi = light_position[:, :, None, None], light_normal[:, :, None, None], flux[:, :, None, None]
    lobe = None if lobe_flux is None else (lobe_flux[:, :, None, None], lobe_axis[:, :, None, None],
                                           lobe_exponent[:, None, None])
    disc = 0.0 if area is None else area[:, None, None]
    for pixel in pixels:
        x, n = (plane.reshape(3, -1)[:, pixel][:, None] for plane in (position, normal))
        # Eq. (2)
        each = pair(x, n, p, m, phi, lobe, disc)
        made.append(np.where(pixel >= 0, np.moveaxis(each, 1, 0), 0))
    return made


def splits(
    pixels: Any, sampled: Any, finest: int, threshold: float, form: str, start: Any = None
) -> list[Any]:
    """Return which cells of levels 1 to top each light's list splits, (N, h_l, w_l) bool (AMS Sec. 3.3.1).

    E-AMS-07: T is "relative", a share of the largest sample that the light has taken so far; "absolute", W/m^2; or of
    the "brightest", a share of the largest sum of all lights at the coarsest cells, over their number. `start`: level,
    row and column of a list whose coarser cells are split in any case (Sec. 6). False where the list does not come to
    a cell.
    """
    top, shown = len(sampled) - 1, [pixel >= 0 for pixel in pixels]
    relative, refined = form == "relative", refined_by(start, shown)
    if form == "brightest":
        threshold = threshold * sampled[top].sum(axis=0).max() / len(sampled[top])
    split = [np.zeros((len(sample), *sample.shape[2:]), bool) for sample in sampled]
    visited = split[top] | shown[top]
    largest = largest_sample(sampled[top], visited)
    for level in range(top, finest, -1):
        children, known = sampled[level - 1], shown[level - 1]
        asked = doubled(visited, known.shape) & known
        largest = np.maximum(largest, largest_sample(children, asked))
        limit = (threshold * largest)[:, None, None, None] if relative else threshold
        most = quadrants(np.where(known, children, -np.inf), -np.inf).max(axis=0)
        least = quadrants(np.where(known, children, np.inf), np.inf).min(axis=0)
        differ = (most - least > limit).any(axis=1)
        split[level] = visited & (differ | refined[level])
        visited = doubled(split[level], known.shape) & known
    return split[1:]


def refined_by(start: Any, planes: Any) -> list[Any]:
    """Return which cells (h_l, w_l) a list of subsplats (level, row, column) refines: all that are coarser than one."""
    refined = [np.zeros_like(plane) for plane in planes]
    for level, row, column in zip(*start, strict=True) if start is not None else ():
        for coarser in range(level + 1, len(planes)):
            refined[coarser][row >> (coarser - level), column >> (coarser - level)] = True
    return refined


def largest_sample(sample: Any, visited: Any) -> Any:
    """Return the largest channel (N,) of the samples that each light has taken at a level."""
    return np.where(visited[:, None], sample, 0).max(axis=(1, 2, 3), initial=0)


def doubled(plane: Any, shape: Any) -> Any:
    """Return the value of the coarser cell for each cell of a level of so many rows and columns."""
    return plane.repeat(2, axis=-2).repeat(2, axis=-1)[..., : shape[0], : shape[1]]


def quadrants(plane: Any, beyond: Any) -> Any:
    """Return the four cells of the finer level in each cell, (4, ..., h_l, w_l); `beyond` the picture's border."""
    odd = [(0, 0)] * (plane.ndim - 2) + [(0, plane.shape[-2] % 2), (0, plane.shape[-1] % 2)]
    whole = np.pad(plane, odd, constant_values=beyond)
    return np.stack([whole[..., i::2, j::2] for i in (0, 1) for j in (0, 1)])


def lists(pixels: Any, sampled: Any, split_levels: Any) -> tuple[Any, ...]:
    """Return where each light's list begins (N + 1,), level, row and column (n,) of all its subsplats, E (3, n) there.

    `split_levels`: levels 1 to top. Light by light, coarsest level first, row by row.
    """
    top = len(sampled) - 1
    first, cells, light = [0], [np.zeros((0, 3), np.int64)], [np.zeros((3, 0), sampled[0].dtype)]
    for k in range(len(sampled[0])):
        for level in range(top, -1, -1):
            shown = pixels[level] >= 0
            reached = doubled(split_levels[level][k], shown.shape) if level < top else np.full_like(shown, True)
            split = split_levels[level - 1][k] if level > 0 else np.full_like(shown, False)
            row, column = np.nonzero(reached & shown & ~split)
            cells.append(np.stack([np.full_like(row, level), row, column], axis=1))
            light.append(sampled[level][k][:, row, column])
        first.append(sum(map(len, cells)))
    level, row, column = np.concatenate(cells).T
    return np.array(first), level, row, column, np.concatenate(light, axis=1)


# pictures: surface detail, twice the width and height


def detail(light: Any, position: Any, normal: Any, triangle_id: Any, camera: Any, a: float) -> Any:
    """Return E (3, h, w) darkened where surfaces turn away from the camera at (1, 3), 0 without surface (Sec. 4.3).

    E-AMS-11: cosmetic; the factor lies in [1 - a, 1].
    """
    away = camera[0][:, None, None] - position
    r = np.sqrt((away**2).sum(axis=0))
    v = np.divide(away, r, out=np.zeros_like(away), where=r > 0)
    cosine = np.where(r > 0, np.maximum(0, (v * normal).sum(axis=0)), 1)
    # Eq. (3)
    factor = a * cosine + 1 - a
    return np.where(triangle_id >= 0, light * factor, 0)


def halved(light: Any, triangle_id: Any, covered: Any) -> Any:
    """Return E (3, h, w) of a picture rendered at twice the width and height (AMS Sec. 4), where `covered` (h, w).

    The mean of those of four pixels that show a surface; where none does the mean of the pixels around.
    """
    four = np.stack([light[:, i::2, j::2] for i in (0, 1) for j in (0, 1)])
    shown = np.stack([triangle_id[i::2, j::2] >= 0 for i in (0, 1) for j in (0, 1)])
    mean = mean_of_shown(four, shown)
    near = np.stack([np.pad(mean, ((0, 0), (1, 1), (1, 1)))[:, i : i + covered.shape[0], j : j + covered.shape[1]]
                     for i in range(3) for j in range(3)])
    near_shown = np.stack([np.pad(shown.any(axis=0), 1)[i : i + covered.shape[0], j : j + covered.shape[1]]
                           for i in range(3) for j in range(3)])
    picture = np.where(shown.any(axis=0), mean, mean_of_shown(near, near_shown))
    return np.where(covered, picture, 0)


def mean_of_shown(light: Any, shown: Any) -> Any:
    """Return the mean over the first axis of those that show a surface, 0 if none does; light (k, 3, h, w)."""
    count = shown.sum(axis=0)
    return np.where(shown[:, None], light, 0).sum(axis=0) / np.maximum(count, 1).astype(light.dtype)
