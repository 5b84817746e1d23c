"""Stages of the mip levels of what a camera sees: nearest surfaces, sample areas (Soler et al. 2009, Eq. 2, Sec. 4).

Level 0 of a case is the first one that light is gathered at; its texels cover 2^n x 2^n pixels, n a fact of the case.
"""

from typing import Any

import numpy as np

from refgi.literal import hssil_levels as literal
from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.levels import levels, next_level
from refgi.sssil.pyramid.view import Level
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Bug, Spec
from refgi.vectors.stages.buffers import VECTOR

EQ2 = "HSS Eq. 2 with tan(f / 2) (E-HSS-03), dP = 4^k pixels (E-HSS-06)"
CLOSEST = "HSS Sec. 4: the closest of four, with its own position, normal and colour (E-HSS-09)"
EYE = "positions are relative to the eye, z times the ray of depth 1 through the pixel's centre (E-HSS-10)"
PLANES = ("position", "depth", "normal", "radiance", "area", "pixel")
VECTORS = ("position", "normal", "radiance")
PICTURE = ("gbuffer.depth", "gbuffer.normal", "gbuffer.albedo", "direct.irradiance", "camera.frame", "camera.half")


def add_levels(recipe: Recipe, view: Projection, first: int, count: int, downsample: str = "closest") -> None:
    """Add `count` levels, from level `first` on, with positions, normals, radiance and areas.

    Texels are the closest of finer ones, or means of them all or of their radiance alone.
    """
    if downsample == "closest":
        _add_first(recipe, view, first)
        for index in range(1, count):
            _add_coarser(recipe, view, first, index)
        return
    from refgi.vectors.stages.averaged_levels import add_averaged

    add_averaged(recipe, view, (first, count), downsample == "average")


def level_of(arrays: Arrays, index: int, number: int, real: Any) -> Level:
    """Return the level among arrays; what is not among them is 0."""
    shape = next(arrays[f"level{index}.{key}"] for key in PLANES if f"level{index}.{key}" in arrays).shape[-2:]
    planes = {key: np.zeros((3, *shape) if key in VECTORS else shape) for key in PLANES}
    planes |= {key: arrays[f"level{index}.{key}"] for key in PLANES if f"level{index}.{key}" in arrays}
    return Level(number, **{key: np.ascontiguousarray(array, np.int32 if key == "pixel" else real)
                            for key, array in planes.items()})


def level_names(index: int, *keys: str) -> tuple[str, ...]:
    """Return the names of a level's arrays."""
    return tuple(f"level{index}.{key}" for key in keys)


def picture_reads() -> dict[str, str]:
    """Return what the literal form of a first level reads."""
    return dict(zip(("depth", "normal", "albedo", "irradiance", "frame", "half"), PICTURE, strict=True))


def level_reads(index: int, *keys: str) -> dict[str, str]:
    """Return what a literal form reads of a level."""
    return {{"position": "place"}.get(key, key): f"level{index}.{key}" for key in keys}


def _add_first(recipe: Recipe, view: Projection, first: int) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        return _named(0, first_level_of(arrays, view, first, real, "closest"))

    form = Form(literal.first_level, picture_reads(), level_names(0, *PLANES), {"number": first})
    cut = first > 0 and any(size % (1 << first) for size in (view.height, view.width))
    lists = ("first_level", "first_level/places", *(("first_level/several", "first_level/several/places") if first else
                                                    ()), *(("first_level/cut",) if cut else ()))
    recipe.add("level0", f"nearest surface to each texel of {1 << first} x {1 << first} pixels, what it reflects and "
               "the surface that the texel stands for", run, PICTURE, level_specs(0, view), paper=f"{CLOSEST}; {EQ2}",
               exact=(PICTURE[0],), bugs=(*form.bugs(*lists), *_in_world(form, view)), variants=(form,))


def _in_world(form: Form, view: Projection) -> tuple[Bug, ...]:
    """Return bugs of places in the world, with areas of them or of the right places; the stage reads no eye."""
    cause = "positions lie in the world, not relative to the eye: the camera's origin is added"

    def run(arrays: Arrays, real: Any) -> dict[str, Array]:
        made = dict(form(arrays, real))
        seen = made["level0.pixel"] >= 0
        return {**made, "level0.position": made["level0.position"] + seen * view.origin[0][:, None, None]}

    def with_area(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        seen, n = made["level0.pixel"] >= 0, made["level0.normal"]
        z = np.where(seen, made["level0.depth"], 1)
        rays = (made["level0.position"] - seen * view.origin[0][:, None, None]) / z, made["level0.position"] / z
        right, wrong = (np.abs((n * d).sum(axis=0)) for d in rays)
        return {**made, "level0.area": made["level0.area"] * np.where(seen, right, 1) / np.where(seen, wrong, 1)}

    return Bug(cause, with_area, EYE), Bug(cause, run, EYE)


def _add_coarser(recipe: Recipe, view: Projection, first: int, index: int) -> None:
    number, size = first + index, (view.height, view.width)

    def run(arrays: Arrays, real: Any) -> Arrays:
        return _named(index, next_level(level_of(arrays, index - 1, number - 1, real), size))

    form = Form(literal.coarser_level, level_reads(index - 1, *PLANES), level_names(index, *PLANES),
                {"number": number, "size": size})
    cut = size[0] % (1 << number) > 0, size[1] % (1 << number) > 0
    lists = ("coarser_level", *(("coarser_level/cut",) if any(cut) else ()),
             *(f"coarser_level/cut {name}" for name, one in zip(("rows", "columns"), cut, strict=True) if one))
    fine = level_names(index - 1, *PLANES)
    recipe.add(f"level{index}", "the nearest of four texels of the finer level, or of the two or one that there are",
               run, fine, level_specs(index, view), paper=f"{CLOSEST}; {EQ2}", exact=(fine[1],),
               bugs=form.bugs(*lists), variants=(form,))


def _named(index: int, level: Level) -> dict[str, Array]:
    return {f"level{index}.{key}": getattr(level, key) for key in PLANES}


def first_level_of(arrays: Arrays, view: Projection, first: int, real: Any, downsample: str) -> Level:
    """Return the first level of a picture among arrays."""
    projection = view._replace(frame=np.asarray(arrays[PICTURE[4]], np.float64),
                               half=np.asarray(arrays[PICTURE[5]], np.float64))
    depth, normal, albedo, light = (np.ascontiguousarray(arrays[name], real) for name in PICTURE[:4])
    return levels(depth, normal, albedo, light, projection, first, 1, downsample)[0]


def level_specs(index: int, view: Projection) -> dict[str, Spec]:
    """Return what the planes of a level are."""
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
