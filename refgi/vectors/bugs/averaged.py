"""Levels of means written out, their parts keywords, to put bugs into (HSS Sec. 4)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.vectors.bugs.nearest_texels import PLANES, coarser_level, first_level
from refgi.vectors.spec import Array, Arrays, Bug

MEANS = "HSS Sec. 4: average; docs/methods/hssil"
KEPT = ("position", "depth", "normal", "radiance")
Planes = dict[str, Array]


def finer(arrays: Arrays, view: Projection, index: int) -> Planes:
    """Return the planes of what a level's texels are made of: the level before, or pixels."""
    if index == 0:
        made = first_level(arrays, view, 0)
        return {key: np.where(made["pixel"] < 0, 0, made[key]) for key in (*KEPT, "area")}
    made = {key: np.asarray(arrays[f"level{index - 1}.{key}"], np.float64) for key in (*KEPT, "area")}
    return made | {"depth": np.where(np.isfinite(made["depth"]), made["depth"], 0)}


def parts_of(plane: Array, side: int) -> Array:
    """Return the side^2 finer texels of each texel along the last axis, 0 beyond the rim."""
    rows, columns = (-(-size // side) for size in plane.shape[-2:])
    beyond = [(0, 0)] * (plane.ndim - 2) + [(0, rows * side - plane.shape[-2]), (0, columns * side - plane.shape[-1])]
    blocks = np.pad(plane, beyond).reshape(*plane.shape[:-2], rows, side, columns, side)
    return np.moveaxis(blocks, -3, -2).reshape(*plane.shape[:-2], rows, columns, side * side)


def averaged(
    fine: Planes, side: int, *, weigh: Callable[[Array, Array], Array] = lambda area, z: area, unit: bool = True,  # noqa: ARG005
    area: Callable[[Array], Array] = lambda a: a.sum(axis=-1), divided: str = "weight",
    plain: tuple[str, ...] = (), summed: tuple[str, ...] = (), nearest: tuple[str, ...] = (),
    first: tuple[str, ...] = (), kept: slice = slice(None), shifted: bool = False,
) -> Planes:
    """Return the planes of a level of means of side x side finer texels, in float64, with a bug."""
    parts = {key: parts_of(np.roll(plane, -1, axis=-1) if shifted else plane, side)[..., kept]
             for key, plane in fine.items()}
    there = parts["area"] > 0
    weight = np.where(there, weigh(parts["area"], parts["depth"]), 0)
    some, made = there.any(axis=-1), {"area": area(parts["area"])}
    closest = np.where(there, parts["depth"], np.inf).argmin(axis=-1)[..., None]
    for key in KEPT:
        own = there.astype(float) if key in plain else weight
        total = {"weight": own.sum(axis=-1), "all": np.full(some.shape, float(there.shape[-1]) * own.max(initial=1))}[
            divided]
        mean = (own * parts[key]).sum(axis=-1) / np.where(some, 1 if key in summed else total, 1)
        at = {True: closest, False: there.argmax(axis=-1)[..., None]}[key in nearest]
        if key in nearest or key in first:
            index = np.broadcast_to(at, (*parts[key].shape[:-1], 1))
            mean = np.take_along_axis(parts[key], index, -1)[..., 0]
        made[key] = mean
    if unit:
        length = np.sqrt((made["normal"] ** 2).sum(axis=0))
        made["normal"] = made["normal"] / np.where(length > 0, length, 1)
    return {key: np.where(some, plane, np.inf if key == "depth" else 0) for key, plane in made.items()}


def averaged_bugs(view: Projection, index: int, number: int) -> list[Bug]:
    """Return likely bugs of a level of means."""
    side = 1 << number if index == 0 else 2
    ways: Mapping[str, dict[str, Any]] = {
        "texels count alike, whatever their area: weights are missing": {"weigh": lambda area, z: np.ones_like(area)},  # noqa: ARG005
        "radiance alone is a mean of texels that count alike, not by area": {"plain": ("radiance",)},
        "texels are weighed by the root of their area": {"weigh": lambda area, z: np.sqrt(area)},  # noqa: ARG005
        "texels are weighed by the inverse of their area": {"weigh": lambda area, z: 1 / np.where(area > 0, area, 1)},  # noqa: ARG005
        "mean normals are not made unit vectors (not normalised)": {"unit": False},
        "the area is the mean of the finer ones, not their sum": {"area": lambda a: a.mean(axis=-1)},
        "the area is the mean of those with a surface, not their sum": {
            "area": lambda a: a.sum(axis=-1) / np.maximum((a > 0).sum(axis=-1), 1)},
        "the area is the largest of the finer ones": {"area": lambda a: a.max(axis=-1)},
        "the area is that of the first finer one, times their number": {
            "area": lambda a: a[..., 0] * a.shape[-1]},
        "radiance is a sum, not a mean": {"summed": ("radiance",)},
        "depth is the least, not the mean": {"nearest": ("depth",)},
        "position is that of the closest, not the mean": {"nearest": ("position",)},
        "the normal is that of the closest, not the mean": {"nearest": ("normal",)},
        "radiance is that of the closest, not the mean": {"nearest": ("radiance",)},
        "all is that of the closest but the area": {"nearest": KEPT},
        "radiance is that of the first with a surface": {"first": ("radiance",)},
        "all is that of the first with a surface but the area": {"first": KEPT},
        "the last of the finer ones is left out": {"kept": slice(None, -1)},
        "the first of the finer ones is left out": {"kept": slice(1, None)},
        "the lower half of the finer ones is left out: one row alone": {"kept": slice(None, side * side // 2)},
        "texels begin one column too far right": {"shifted": True},
    }
    return [Bug(cause, _averaged_by(view, index, side, how), MEANS) for cause, how in ways.items()]


def _averaged_by(view: Projection, index: int, side: int, how: dict[str, Any]) -> Any:
    return lambda arrays, real: {f"level{index}.{key}": plane for key, plane in averaged(  # noqa: ARG005
        finer(arrays, view, index), side, **how).items()}


def counted(arrays: Arrays, index: int, side: int) -> Array:
    """Return the pixels with a surface that texels cover, from pixels or from the finer level's."""
    fine = np.isfinite(np.asarray(arrays["gbuffer.depth"])) if index == 0 else np.asarray(
        arrays[f"level{index - 1}.count"])
    return np.asarray(parts_of(fine.astype(np.int32), side).sum(axis=-1, dtype=np.int32))


def counted_level(
    arrays: Arrays, view: Projection, index: int, number: int, *, mean: Callable[[Array, Array], Array] | None = None,
    count: Callable[[Array], Array] = lambda a: a,
) -> Planes:
    """Return the closest texels with the mean radiance of all pixels, with a bug; `mean` of radiance and counts."""
    side, size = 1 << number if index == 0 else 2, (view.height, view.width)
    made = coarser_level(arrays, index, number, size) if index else first_level(arrays, view, number)
    if index == 0:
        pixels = first_level(arrays, view, 0)
        light, share = pixels["radiance"], (pixels["pixel"] >= 0).astype(float)
    else:
        light, share = (np.asarray(arrays[f"level{index - 1}.{key}"], np.float64) for key in ("radiance", "count"))
    parts = parts_of(light, side), parts_of(share, side)
    found = (mean or _mean)(*parts)
    radiance = np.where(made["pixel"] >= 0, found, 0)
    return {**{key: made[key] for key in PLANES}, "radiance": radiance, "count": count(counted(arrays, index, side))}


def _mean(light: Array, share: Array) -> Array:
    return np.asarray((light * share).sum(axis=-1) / np.maximum(share.sum(axis=-1), 1))


def counted_bugs(view: Projection, index: int, number: int) -> list[Bug]:
    """Return likely bugs of the mean radiance of a level's closest texels."""
    ways: Mapping[str, dict[str, Any]] = {
        "radiance is that of the closest: no mean": {"mean": "closest"},
        "pixels without surface count as dark: radiance is divided by all": {
            "mean": lambda light, share: (light * share).sum(axis=-1) / (share.shape[-1] * max(share.max(), 1))},
        "radiance is a sum, not a mean": {"mean": lambda light, share: (light * share).sum(axis=-1)},
        "radiance is that of the first of the finer ones": {"mean": lambda light, share: light[..., 0]},  # noqa: ARG005
        "radiance is the largest of the finer ones": {"mean": lambda light, share: light.max(axis=-1)},  # noqa: ARG005
        "the last of the finer ones is left out of the mean radiance": {
            "mean": lambda light, share: _mean(light[..., :-1], share[..., :-1])},
        "the upper row of the finer ones alone has its radiance averaged": {
            "mean": lambda light, share: _mean(light[..., : light.shape[-1] // 2], share[..., : light.shape[-1] // 2])},
        "texels of the finer level count alike, however many of their pixels show a surface": {
            "mean": lambda light, share: _mean(light, (share > 0).astype(float))},
        "pixels without surface are counted": {"count": lambda a: np.full_like(a, 1 << 2 * number)},
        "texels are counted, not pixels": {"count": lambda a: np.minimum(a, 1)},
    }

    def by(how: dict[str, Any]) -> Any:
        def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            if how.get("mean") == "closest":
                made = coarser_level(arrays, index, number, (view.height, view.width)) if index else first_level(
                    arrays, view, number)
                made["count"] = counted(arrays, index, 1 << number if index == 0 else 2)
            else:
                made = counted_level(arrays, view, index, number, **how)
            return {f"level{index}.{key}": plane for key, plane in made.items()}

        return run

    return [Bug(cause, by(how), MEANS) for cause, how in ways.items()]
