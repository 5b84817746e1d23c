"""Stages of crown sampling: shifted points, offsets and weights of samples, sum of their light (HSS Sec. 3.1, 3.2).

The points of a level are one Kronecker sequence (u, v): u says how far from the receiver, 2 pi v in which direction.
Each texel of a tile adds its own shift modulo 1. The random start of the shifts is given.
"""

from typing import Any

import numpy as np

from refgi.literal import hssil_crown as literal
from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.settings import replaced
from refgi.sssil.crown.gather import gather
from refgi.sssil.crown.pattern import PHASES, tile_offsets
from refgi.sssil.crown.points import key_shift, level_key, pixel_key, row_key, sample_points, tile_shifts
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Bug, Spec
from refgi.vectors.stages.crown_sets import CROWN, add_every_texel, add_mirrored
from refgi.vectors.stages.levels import level_names, level_of

EQ4 = "HSS Eq. 4 with its pi (E-HSS-04): pi cos R^2 / (r^2 + R^2), R^2 = cos' ds / pi"
AREA = "E-HSS-06"
SENDER = ("position", "normal", "radiance", "area")
BELOW_1 = 1.0 - 2.0**-24
POINTS = Spec("sample, (u, cos 2 pi v, sin 2 pi v)", "1", "points that all texels share")


def add_samples(
    recipe: Recipe, sampling: SamplingSettings, index: int, shape: tuple[int, int], radius: float
) -> None:
    """Add shifts, offsets and weights of the samples of a level with some rows and columns."""
    inner, crown = sampling.counts(index)
    name, one = f"samples{index}", (1, 1)
    tile = {"row": (shape[0], PHASES), "interleaved": (sampling.tile, sampling.tile), "pixel": shape}.get(
        sampling.pattern, one)
    points, shifts = f"{name}.points", f"{name}.shifts"
    recipe.facts[name] = {"disc": inner, "crown": crown, "radius": radius, "tile": list(tile),
                          "pattern": sampling.pattern, "density": sampling.density, "steps": [FIRST_STEP, SECOND_STEP]}
    if sampling.pattern == "all":
        add_every_texel(recipe, index, radius, _specs(name))
        return
    key = level_key(sampling.seed, sampling.first_level + index)
    if sampling.pattern == "pixel":
        own = np.array([[key_shift(pixel_key(row_key(key, row), column)) for column in range(shape[1])]
                        for row in range(shape[0])])
        recipe.give(shifts, np.minimum(own, BELOW_1), Spec("row, column, uv", "1", "random numbers: what each texel "
                                                          "adds to u and v, modulo 1"))
        _add_points(recipe, name, inner, crown)
    else:
        recipe.give(f"{name}.shift", np.minimum(key_shift(key), BELOW_1), Spec(
            "uv", "1", "random numbers: shift of the tile's first texel" if tile != one else "random numbers: shift of "
            "all points"))
        if sampling.pattern == "fixed":
            add_mirrored(recipe, index, (inner, crown), (radius, sampling.density), _specs(name))
            return
        _add_shifts(recipe, name, (inner, crown), tile)

    def run(arrays: Arrays, real: Any) -> Arrays:
        offsets, weight = tile_offsets(np.ascontiguousarray(arrays[points], real), inner,
                                       np.ascontiguousarray(arrays[shifts], real), radius, sampling.density)
        return {f"{name}.offsets": offsets, f"{name}.weight": weight}

    form = Form(literal.crown_samples, {"points": points, "shifts": shifts}, (*_specs(name),),
                {"inner": inner, "radius": radius, "density": sampling.density})
    kinds = ("", f"/{sampling.density}", *(("/disc", f"/{sampling.density} disc") if inner else ()))
    recipe.add(name, "texels around a receiver that are its samples, and how many texels each stands for", run,
               (points, shifts), _specs(name), paper=CROWN, bugs=form.bugs(*(f"crown_samples{one}" for one in kinds)),
               variants=(form,))


def _specs(name: str) -> dict[str, Spec]:
    return {f"{name}.offsets": Spec("row modulo tile, column modulo tile, sample, (right, down)", "1",
                                    "texels from the receiver to the sample, the disc's first", tier="T0"),
            f"{name}.weight": Spec("row modulo tile, column modulo tile, sample; 1: all alike", "1",
                                   "texels of this level that a sample stands for", paper="E-HSS-06")}


def add_gather(recipe: Recipe, settings: HssilSettings, index: int) -> None:
    """Add the light that each texel of a level receives of its samples."""
    name, number = f"gather{index}.irradiance", settings.sampling.first_level + index
    samples = f"samples{index}.offsets", f"samples{index}.weight"
    planes = level_names(index, *SENDER)
    plain = replaced(settings, {"sampling.pattern": "interleaved"})

    def run(arrays: Arrays, real: Any) -> Arrays:
        chosen = _in_phases(np.asarray(arrays[samples[0]], np.int32), np.asarray(arrays[samples[1]], real))
        return {name: gather(level_of(arrays, index, number, real), index, plain, samples=chosen)}

    form = Form(literal.gather, {**{key: f"level{index}.{key}" for key in SENDER}, "offsets": samples[0],
                                 "weight": samples[1]}, (name,))
    recipe.facts[name.split(".")[0]] = {"form_factor": settings.senders.form_factor}
    recipe.add(name.split(".")[0], "irradiance of a level's texels by their samples, those outside the picture, on "
               "nothing or on the texel itself left out", run, (*planes, *samples), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance by this level; 0 without surface", "linear RGB",
                              EQ4)}, paper=f"HSS Eq. 1; {EQ4}", exact=(planes[0],), variants=(form,), bugs=(
                       *form.bugs("gather"), *_parts_left_out(form, settings.sampling.counts(index)[0]),
                       *_scaled_again(form, index)))


def _parts_left_out(form: Form, inner: int) -> tuple[Bug, ...]:
    """Return bugs of disc and crown as a whole; the first `inner` samples are those of the disc."""
    def only(part: slice) -> Bug:
        """Return a sum over a part of the samples."""
        names = (form.reads[key].replace(".", "__") for key in ("offsets", "weight"))
        cut = dict(zip(names, (lambda a: a[..., part, :], lambda a: a[..., part]), strict=True))
        left = "disc are left out: the crown" if part.start else "crown are left out: the disc"
        return Bug(f"the samples of the {left} alone", reading(form, **cut), "HSS Sec. 3.2")

    return (only(slice(inner, None)), only(slice(inner))) if inner else ()


def _scaled_again(form: Form, index: int) -> tuple[Bug, ...]:
    """Return bugs of 4^k, which areas of level k have already."""
    area, light = (name.replace(".", "__") for name in (form.reads["area"], form.writes[0]))
    return (Bug("areas are scaled by 4^k a second time", writing(form, **{light: lambda a: a * 4.0**index}),
                AREA),
            Bug("areas are divided by 4^k: a coarse texel counts as one of the first level",
                reading(form, **{area: lambda a: a / 4.0**index}), AREA)) if index else ()


def _in_phases(offsets: Array, weight: Array) -> tuple[Array, Array]:
    """Return samples by column modulo a power of two, as the kernel takes them; where each texel has its own."""
    more = (1 << (offsets.shape[1] - 1).bit_length()) - offsets.shape[1]
    wide = [np.pad(one, [(0, 0), (0, more if one.shape[1] > 1 else 0), *[(0, 0)] * (one.ndim - 2)])
            for one in (offsets, weight)]
    return np.ascontiguousarray(wide[0]), np.ascontiguousarray(wide[1])


def _add_points(recipe: Recipe, name: str, inner: int, crown: int) -> None:
    form = Form(literal.sample_points, {}, (f"{name}.points",), {"inner": inner, "crown": crown})
    kinds = ("", "/alone", *(("/disc",) if inner else ()))
    recipe.add(f"points of {name}", "points of the sequence, j steps from 1/2, the disc's then the crown's; modulo 1, "
               "in double precision", lambda arrays, real: {f"{name}.points": sample_points(inner, crown)},  # noqa: ARG005
               (), {f"{name}.points": POINTS}, paper=CROWN,
               bugs=form.bugs(*(f"sample_points{one}" for one in kinds)), variants=(form,))


def _add_shifts(recipe: Recipe, name: str, counts: tuple[int, int], tile: tuple[int, int]) -> None:
    inner, crown = counts

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
        start = np.asarray(arrays[f"{name}.shift"], np.float64)
        return {f"{name}.points": sample_points(inner, crown),
                f"{name}.shifts": np.minimum(tile_shifts(start, tile, crown), BELOW_1)}

    form = Form(literal.points_and_shifts, {"start": f"{name}.shift"}, (f"{name}.points", f"{name}.shifts"),
                {"inner": inner, "crown": crown, "rows": tile[0], "columns": tile[1]})
    lists = ("sample_points", "tile_shifts", "points_and_shifts",
             *(("sample_points/disc", "tile_shifts/disc") if inner else ()),
             *(("tile_shifts/oblong",) if tile[0] != tile[1] else ()))
    recipe.add(f"shifts of {name}", "points of the sequence, j steps from 1/2, the disc's then the crown's; texel n of "
               "the tile, row by row, is shifted by n times the crown's number of steps more; all modulo 1, in double "
               "precision", run, (f"{name}.shift",), {
                   f"{name}.points": POINTS,
                   f"{name}.shifts": Spec("row of the tile, column of the tile, uv", "1",
                                          "what each texel of a tile adds to u and v, modulo 1"),
               }, paper=CROWN, exact=(f"{name}.shift",), bugs=form.bugs(*lists), variants=(form,))
