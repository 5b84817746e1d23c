"""Levels of the nearest surfaces written out, their parts keywords, to put bugs into (HSS Sec. 4, Eq. 2)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.vectors.spec import Array, Arrays

PLANES = ("position", "depth", "normal", "radiance", "area", "pixel")
VECTORS = ("position", "normal", "radiance")
GRAZING = 1e-12  # least cosine that an area is divided by


class Surface(NamedTuple):
    """What the area of each texel is made of."""

    z: Array  # depth
    facing: Array  # -n . d, d the ray of depth 1
    ray: Array  # length of d
    pixels: Array  # that the texel covers
    pixel_area: float  # at depth 1
    half: tuple[float, float]  # tangents of half the angles of view


def area_of(s: Surface) -> Array:
    """Return the surface of texels, Eq. 2."""
    return np.asarray(s.pixels * s.pixel_area * s.z**2 / np.maximum(np.abs(s.facing), GRAZING))


def covered(size: tuple[int, int], number: int, row: Array, column: Array, whole: tuple[bool, bool]) -> Array:
    """Return how many pixels texels of a level cover; `whole`: the picture's rim cuts no rows, no columns."""
    side = 1 << number
    down, across = (side if all_ else np.clip(n - at * side, 0, side) for n, at, all_ in
                    zip(size, (row, column), whole, strict=True))
    return np.asarray(down * across * np.ones_like(row))


def chosen(
    depth: Array, pixel: Array, side: int, width: int, *, rule: str = "nearest", tie: str = "centre",
    kept: Callable[[Array, Array], Array] | None = None, void: bool = False, next_row: bool = False,
) -> tuple[Array, Array, Array]:
    """Return row and column of the finer texel that each texel keeps, and where none is there."""
    (h, w), (rows, columns) = (-(-n // side) for n in depth.shape), depth.shape
    i, j = np.indices((h, w))[..., None] * side + np.array(np.divmod(np.arange(side**2), side))[:, None, None]
    inside = (i < rows) & ((j < columns) | next_row) & (i * columns + j < depth.size)
    inside &= True if kept is None else kept(*np.divmod(np.arange(side**2), side))
    i, j = np.divmod(np.where(inside, i * columns + j, 0), columns)
    z, place = depth[i, j], pixel[i, j]
    seen = inside & np.isfinite(z)
    order = {"nearest": z, "farthest": -z, "first": np.broadcast_to(np.arange(side**2), z.shape)}[rule]
    order = np.where(inside if rule == "first" else seen, order, -1.0 if void else np.inf)
    order = np.where(inside, order, np.inf)
    off = np.abs(2 * (place % width) + 1 - width)
    keys = {"centre": (place, off), "upper left": (place,), "last": (-place,), "edge": (place, -off)}[tie]
    best = np.lexsort((*keys, order), axis=-1)[..., :1]
    y, x = (np.take_along_axis(a, best, -1)[..., 0] for a in (i, j))
    return y, x, ~np.take_along_axis(seen, best, -1)[..., 0]


def first_level(
    arrays: Arrays, view: Projection, number: int, *, choice: dict[str, Any] | None = None, row_at: float = 0.5,
    column_at: float = 0.5, of_texel: bool = False, signs: tuple[int, int] = (1, 1), unit: bool = False,
    world: bool = False, flat: bool = False, area: Callable[[Surface], Array] = area_of,
    area_of_it: bool = True, radiance: Callable[[Array, Array], Array] | None = None, light_of: str = "chosen",
    normal_of: str = "chosen", pixel: Callable[..., Array] | None = None, whole: tuple[bool, bool] = (False, False),
) -> dict[str, Array]:
    """Return the planes of the first level, in float64, with a bug; `area_of_it`: the area is that of wrong places."""
    size = view.height, view.width
    depth, normal, albedo, light = (np.asarray(arrays[name], np.float64) for name in (
        "gbuffer.depth", "gbuffer.normal", "gbuffer.albedo", "direct.irradiance"))
    y, x, none = chosen(depth, np.arange(depth.size).reshape(size), 1 << number, size[1], **(choice or {}))
    row, column = (np.asarray(at) for at in np.indices(y.shape))
    corner = np.minimum(row << number, size[0] - 1), np.minimum(column << number, size[1] - 1)
    z = np.where(none, 0.0, np.where(np.isfinite(depth[y, x]), depth[y, x], 0.0))
    frame, half = np.asarray(arrays["camera.frame"], np.float64)[0], np.asarray(arrays["camera.half"], np.float64)

    def ray(v: Any, u: Any, up: tuple[int, int] = (1, 1)) -> Array:
        a, b = (2 * u / size[1] - 1) * up[1], (2 * v / size[0] - 1) * up[0]
        across, down, ahead = (one[:, None, None] for one in frame)
        return np.asarray(ahead + a * half[0] * across + b * half[1] * down)

    right = ray(y + 0.5, x + 0.5)
    if of_texel:
        side = 1 << number
        d = ray((row + 0.5) * side, (column + 0.5) * side)
    else:
        d = ray(y + row_at, x + column_at, signs)
    d = d / np.sqrt((d**2).sum(axis=0)) if unit else d
    d = right / z.clip(1e-12) if flat else d
    position = z * d
    if world:
        position = position + np.where(none, 0.0, 1.0) * view.origin[0][:, None, None]
        d = position / np.where(none, 1.0, z)
    up = normal[:, *(corner if normal_of == "corner" else (y, x))]
    lit = corner if light_of == "corner" else (y, x)
    at = d if area_of_it else right
    surface = Surface(z, np.where(none, 1.0, (up * at).sum(axis=0)), np.sqrt((at**2).sum(axis=0)),
                      covered(size, number, row, column, whole), float(4 * half[0] * half[1] / depth.size),
                      (float(half[0]), float(half[1])))
    reflected = (radiance or (lambda share, power: share * power / np.pi))(albedo[:, *lit], light[:, *lit])
    made = {"position": position, "normal": up, "radiance": reflected, "area": area(surface),
            "depth": depth[y, x], "pixel": y * size[1] + x if pixel is None else pixel(y, x, row, column)}
    return _void(made, none)


def coarser_level(
    arrays: Arrays, index: int, number: int, size: tuple[int, int], *, choice: dict[str, Any] | None = None,
    means: tuple[str, ...] = (), area: Callable[[Array, Array, Array], Array] | None = None, summed: bool = False,
    whole: tuple[bool, bool] = (False, False), finer_whole: tuple[bool, bool] = (False, False),
    pixel: Callable[..., Array] | None = None, first: tuple[str, ...] = (),
) -> dict[str, Array]:
    """Return the planes of a level from those of the finer one, in float64, with a bug.

    `means`, `first`: planes that are means of the four, or those of the upper left one; `area` by that of the finer
    texel, and pixels of both.
    """
    fine = {key: np.asarray(arrays[f"level{index - 1}.{key}"]) for key in PLANES}
    fine |= {key: fine[key].astype(np.float64) for key in PLANES if key != "pixel"}
    y, x, none = chosen(fine["depth"], fine["pixel"], 2, size[1], **(choice or {}))
    row, column = (np.asarray(at) for at in np.indices(y.shape))
    made = {key: fine[key][..., y, x] for key in PLANES}
    to = covered(size, number, row, column, whole)
    of = covered(size, number - 1, y, x, finer_whole)
    made["area"] = made["area"] * to / np.maximum(of, 1) if area is None else area(made["area"], to, of)
    for key in first:
        made[key] = fine[key][..., row * 2, column * 2]
    seen = [(i, j, (i < fine["depth"].shape[0]) & (j < fine["depth"].shape[1])) for i, j in (
        (row * 2 + k // 2, column * 2 + k % 2) for k in range(4))]
    parts = [(np.minimum(i, fine["depth"].shape[0] - 1), np.minimum(j, fine["depth"].shape[1] - 1), known)
             for i, j, known in seen]
    parts = [(i, j, known & np.isfinite(fine["depth"][i, j])) for i, j, known in parts]
    count = np.maximum(sum(np.asarray(known, int) for _, _, known in parts), 1)
    for key in means:
        made[key] = sum(np.where(known, fine[key][..., i, j], 0.0) for i, j, known in parts) / count
    if summed:
        made["area"] = np.asarray(sum(np.where(known, fine["area"][i, j], 0.0) for i, j, known in parts))
    if pixel is not None:
        made["pixel"] = pixel(y, x, row, column)
    return _void(made, none)


def _void(made: dict[str, Array], none: Array) -> dict[str, Array]:
    """Return planes as they are without surface where there is none."""
    return {key: np.where(none, {"depth": np.inf, "pixel": -1}.get(key, 0), array) for key, array in made.items()}
