"""Stages of the mip levels of what a camera sees: nearest surfaces, sample areas (Soler et al. 2009, Eq. 2, Sec. 4).

Level 0 of a case is the first one that light is gathered at; its texels cover 2^n x 2^n pixels, n a fact of the case.
"""

from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.levels import levels, next_level
from refgi.sssil.pyramid.view import Level
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import VECTOR

PLANES = ("position", "depth", "normal", "radiance", "area", "pixel")
EQ2 = "HSS Eq. 2 with tan(f / 2) (E-HSS-03), dP = 4^k pixels (E-HSS-06)"
CLOSEST = "HSS Sec. 4: the closest of four, with its own position, normal and colour (E-HSS-09)"


def add_levels(recipe: Recipe, view: Projection, first: int, count: int) -> None:
    """Add `count` levels of the closest texels, from level `first` on, with positions, normals, radiance and areas."""
    _add_first(recipe, view, first)
    for index in range(1, count):
        _add_coarser(recipe, view, first, index)


def level_of(arrays: Arrays, index: int, number: int, real: Any) -> Level:
    """Return the level among arrays; what is not among them is 0."""
    shape = next(arrays[f"level{index}.{key}"] for key in PLANES if f"level{index}.{key}" in arrays).shape[-2:]
    planes = {key: np.zeros((3, *shape) if key in ("position", "normal", "radiance") else shape) for key in PLANES}
    planes |= {key: arrays[f"level{index}.{key}"] for key in PLANES if f"level{index}.{key}" in arrays}
    return Level(number, **{key: np.ascontiguousarray(array, np.int32 if key == "pixel" else real)
                            for key, array in planes.items()})


def level_names(index: int, *keys: str) -> tuple[str, ...]:
    """Return the names of a level's arrays."""
    return tuple(f"level{index}.{key}" for key in keys)


def _add_first(recipe: Recipe, view: Projection, first: int) -> None:
    reads = ("gbuffer.depth", "gbuffer.normal", "gbuffer.albedo", "direct.irradiance", "camera.frame", "camera.half")

    def run(arrays: Arrays, real: Any, downsample: str = "closest", number: int = first) -> Arrays:
        projection = view._replace(frame=np.asarray(arrays[reads[4]], np.float64),
                                   half=np.asarray(arrays[reads[5]], np.float64))
        depth, normal, albedo, light = (np.ascontiguousarray(arrays[name], real) for name in reads[:4])
        return _named(0, levels(depth, normal, albedo, light, projection, number, 1, downsample)[0])

    def picked(rule: str) -> Run:
        return lambda a, r: _picked(run(a, r, number=0), 0, 1 << first, rule)

    rays = _Rays(view)
    area = {"one pixel": lambda made: made["level0.area"] / 4**first,
            "tan f": lambda made: made["level0.area"] * 4 / np.prod(1 - np.square(view.half)),
            "beta": lambda made: made["level0.area"] * rays.facing(made, 0),
            "distance": lambda made: made["level0.area"] * rays.lengths(made, 0) ** 2}
    place = {"corner": lambda made: rays.through_corners(made, 0), "world": lambda made: rays.in_the_world(made, 0),
             "centre": lambda made: rays.through_centres(made, 0, first)}
    several = (
        Bug("the farthest pixel of a texel is kept", picked("farthest"), CLOSEST),
        Bug("the upper left pixel of a texel is kept", picked("first"), CLOSEST),
        Bug("positions, normals and radiance are means", lambda a, r: run(a, r, "average"), CLOSEST),
        Bug("radiance is the mean over the texel", lambda a, r: run(a, r, "closest_average"), CLOSEST),
        Bug("the area is that of one pixel", _with(run, "area", area["one pixel"]), EQ2),
        Bug("positions lie on the ray through the texel's centre", _with(run, "position", place["centre"]),
            "E-HSS-09"),
    ) if first else ()
    recipe.add("level0", f"nearest surface to each texel of {1 << first} x {1 << first} pixels, what it reflects and "
               "the surface that the texel stands for", run, reads, _specs(0, view), paper=f"{CLOSEST}; {EQ2}",
               exact=(reads[0],), bugs=(
                   *several,
                   Bug("tan f in place of tan(f / 2)", _with(run, "area", area["tan f"]), "E-HSS-03"),
                   Bug("the cosine at the surface is missing in the area", _with(run, "area", area["beta"]), EQ2),
                   Bug("the area is computed of the distance, not of the depth",
                       _with(run, "area", area["distance"]), EQ2),
                   Bug("pixel centres lie at 0 instead of 1/2", _with(run, "position", place["corner"]), "E-HSS-10"),
                   Bug("positions are not relative to the eye", _with(run, "position", place["world"]), ""),
                   Bug("radiance is not divided by pi", writing(run, level0__radiance=lambda a: a * np.pi),
                       "L = albedo/pi E"),
                   Bug("the albedo is left out", reading(run, gbuffer__albedo=np.ones_like), "L = albedo/pi E"),
                   Bug("depth is the distance from the eye", _with(run, "depth", lambda made: (
                       made["level0.depth"] * rays.lengths(made, 0))), "axial depth (E-HSS-02)"),
               ))


def _add_coarser(recipe: Recipe, view: Projection, first: int, index: int) -> None:
    number, shape = first + index, (view.height, view.width)

    def run(arrays: Arrays, real: Any) -> Arrays:
        return _named(index, next_level(level_of(arrays, index - 1, number - 1, real), shape))

    def picked(rule: str) -> Run:
        return lambda a, r: _picked(_named(0, level_of(a, index - 1, number - 1, r)), index, 2, rule)

    def scaled(made: Arrays, factor: float) -> Array:
        """Return areas as `factor` times those of the texel that was kept."""
        full = np.asarray(made[f"level{index}.area"])
        rows, columns = (np.minimum(1 << number, size - (np.arange(n) << number)) for size, n in
                         zip(shape, full.shape, strict=True))
        return np.asarray(full * factor * 4.0**number / (rows[:, None] * columns))

    rays, fine = _Rays(view), level_names(index - 1, *PLANES)
    cut = any(size % (1 << number) for size in shape)
    bugs = [
        Bug("the farthest of four texels is kept", picked("farthest"), CLOSEST),
        Bug("the upper left of four texels is kept", picked("first"), CLOSEST),
        Bug("areas are not four times those of the finer level", _with(run, "area", lambda made: (
            made[f"level{index}.area"] / 4), index), EQ2),
        Bug("positions lie on the ray through the texel's centre", _with(
            run, "position", lambda made: rays.through_centres(made, index, number), index), "E-HSS-09"),
        Bug("radiance is the mean of four texels", picked("mean"), CLOSEST),
    ]
    bugs += [Bug("texels that the picture's edge cuts count as whole ones",
                 _with(run, "area", lambda made: scaled(made, 1.0), index), EQ2)] if cut else []
    recipe.add(f"level{index}", "the nearest of four texels of the finer level, or of the two or one that there are",
               run, fine, _specs(index, view), paper=f"{CLOSEST}; {EQ2}", exact=(fine[1],), bugs=tuple(bugs))


class _Rays:
    """Rays of a camera's pixels, for likely bugs of positions and areas."""

    def __init__(self, view: Projection) -> None:
        self.shape, self.origin = (view.height, view.width), view.origin[0]
        self.across, self.down, self.ahead = (a * h for a, h in zip(view.frame[0], (*view.half, 1.0), strict=True))

    def lengths(self, made: Arrays, index: int) -> Array:
        depth, place = (np.asarray(made[f"level{index}.{key}"], np.float64) for key in ("depth", "position"))
        far = np.sqrt((place**2).sum(axis=0))
        return np.asarray(np.divide(far, depth, out=np.ones_like(far), where=np.isfinite(depth)))

    def facing(self, made: Arrays, index: int) -> Array:
        depth, place, normal = (np.asarray(made[f"level{index}.{key}"], np.float64) for key in
                                ("depth", "position", "normal"))
        return np.asarray(-(place * normal).sum(axis=0) / np.where(np.isfinite(depth), depth, 1.0))

    def in_the_world(self, made: Arrays, index: int) -> Array:
        place = np.asarray(made[f"level{index}.position"])
        return np.asarray(np.where(np.isfinite(made[f"level{index}.depth"]), place + self.origin[:, None, None], 0))

    def through_corners(self, made: Arrays, index: int) -> Array:
        row, column = np.divmod(np.maximum(made[f"level{index}.pixel"], 0), self.shape[1])
        return self._at(made, index, row, column)

    def through_centres(self, made: Arrays, index: int, number: int) -> Array:
        row, column = np.indices(made[f"level{index}.depth"].shape)
        return self._at(made, index, (row + 0.5) * 2**number, (column + 0.5) * 2**number)

    def _at(self, made: Arrays, index: int, row: Array, column: Array) -> Array:
        x, y = 2 * column / self.shape[1] - 1, 2 * row / self.shape[0] - 1
        depth = np.asarray(made[f"level{index}.depth"])
        z = np.where(np.isfinite(depth), depth, 0)
        three = (vector[:, None, None] for vector in (self.across, self.down, self.ahead))
        across, down, ahead = three
        return np.asarray(z * (ahead + x * across + y * down))


def _with(run: Run, key: str, change: Any, index: int = 0) -> Run:
    """Return a stage one of whose planes is made of all that it writes."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        return made | {f"level{index}.{key}": change(made)}

    return altered


def _picked(fine: Arrays, index: int, side: int, rule: str) -> Arrays:
    """Return the level of which each texel is the "farthest" or "first" of side x side finer ones, or has their mean.

    `fine` is named as level 0; the result as level `index`.
    """
    blocks = {key: _blocks(np.asarray(fine[f"level0.{key}"]), side) for key in PLANES}
    depth = blocks["depth"]
    seen = np.isfinite(depth)
    order = np.where(seen, -depth if rule == "farthest" else depth, np.inf)
    chosen = np.zeros(order.shape[:2], np.int64) if rule == "first" else order.argmin(axis=2)
    made = {key: np.take_along_axis(block, np.broadcast_to(chosen[..., None], (*block.shape[:-1], 1)), axis=-1)[..., 0]
            for key, block in blocks.items()}
    made["area"] = made["area"] * side * side
    if rule == "mean":
        made["radiance"] = blocks["radiance"].sum(axis=-1) / np.maximum(seen.sum(axis=-1), 1)
    made["depth"] = np.where(made["pixel"] < 0, np.inf, made["depth"])
    return {f"level{index}.{key}": array for key, array in made.items()}


def _blocks(array: Array, side: int) -> Array:
    """Return (..., h, w, side * side) of (..., H, W); beyond the edge its last texels again."""
    rows, columns = (-size % side for size in array.shape[-2:])
    array = np.pad(array, [(0, 0)] * (array.ndim - 2) + [(0, rows), (0, columns)], mode="edge")
    h, w = (size // side for size in array.shape[-2:])
    parts = array.reshape(*array.shape[:-2], h, side, w, side)
    return np.asarray(np.moveaxis(parts, -3, -2).reshape(*array.shape[:-2], h, w, side * side))


def _named(index: int, level: Level) -> dict[str, Array]:
    return {f"level{index}.{key}": getattr(level, key) for key in PLANES}


def _specs(index: int, view: Projection) -> dict[str, Spec]:
    sheet, empty = "row, column", "; 0 without surface"
    specs = {
        "position": Spec(f"xyz, {sheet}", "m", f"surface point, from the eye{empty}", "axes of the world"),
        "depth": Spec(sheet, "m", "depth along the view direction; inf without surface"),
        "normal": Spec(f"xyz, {sheet}", VECTOR, f"its normal, on the side that is seen{empty}", "world"),
        "radiance": Spec(f"rgb, {sheet}", "W/m^2/sr", f"diffusely reflected direct light{empty}", "linear RGB",
                         "L = albedo/pi E"),
        "area": Spec(sheet, "m^2", f"ds, surface that the texel stands for{empty}", paper=EQ2),
        "pixel": Spec(sheet, "1", "pixel that was kept, row * columns + column; of equally near ones that nearest to "
                      "the vertical centre line, then the upper, then the left; -1 without surface", tier="T0",
                      index_of=(view.height, view.width)),
    }
    return {f"level{index}.{key}": specs[key] for key in PLANES}
