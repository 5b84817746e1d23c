"""What ports get wrong in the look-up of a shadow map (docs/rasterizer: receiver-plane bias)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import PARABOLOID, Projection, project
from refgi.vectors.bugs.views import ViewChange, view_changes, view_of
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run

PLANE, OUTSIDE = "receiver-plane bias", "false outside the map and without surface"
BIASES = (0.001, 0.01, 0.05)
Test = Callable[..., Arrays]
SQUARE = "horizontal", "vertical"  # what a square map does not tell


def shadow_map_family(test: Test, name: str, maps: Projection, index: int, facing: str) -> tuple[Bug, ...]:
    """Return likely bugs of a look-up.

    `test` (arrays, type, constant bias); `name` of the map, number of the light, name of the normals of faces.
    """
    if maps.kind == PARABOLOID:
        return ()
    made, printed = f"shadow{index}.visible", name.replace(".", "__")

    def outside(arrays: Arrays, real: Any) -> Arrays:
        origin, frame, half = (np.ascontiguousarray(arrays[f"{name}.{key}"], np.float64) for key in
                               ("origin", "frame", "half"))
        position = np.ascontiguousarray(arrays["gbuffer.position"], np.float64)
        row, _, _ = project(maps._replace(origin=origin, frame=frame, half=half), position)
        covered = np.asarray(arrays["gbuffer.triangle_id"]) >= 0
        return {made: np.asarray(test(arrays, real)[made]) | (covered & np.isnan(row))}

    def inverted(arrays: Arrays, real: Any) -> Arrays:
        covered = np.asarray(arrays["gbuffer.triangle_id"]) >= 0
        return {made: covered & ~np.asarray(test(arrays, real)[made])}

    return (
        *(Bug(f"the bias is a constant {1000 * bias:g} mm and not the receiver's plane", _biased(test, bias), PLANE)
          for bias in BIASES),
        Bug("points outside the map are lit: beyond a spot's cone", outside, OUTSIDE),
        Bug("lit and shadowed points are exchanged: the depth comparison is turned round", inverted, PLANE),
        Bug("the receiver's normal points inwards: the plane's bias has the wrong sign",
            reading(test, **{facing.replace(".", "__"): np.negative}), PLANE),
        *(Bug(f"the map: {cause}", _viewed(test, name, maps, change), paper)
          for cause, change, paper in view_changes(maps) if not any(word in cause for word in SQUARE)),
        Bug("depths of the map are one column off", reading(test, **{
            f"{printed}__{key}": _next_column for key in ("depth", "position")}), "nearest texel"),
        Bug("depths of the map are one row off", reading(test, **{
            f"{printed}__{key}": _next_row for key in ("depth", "position")}), "nearest texel"),
    )


def _biased(test: Test, bias: float) -> Run:
    return lambda arrays, real: test(arrays, real, bias)


def _viewed(test: Test, name: str, maps: Projection, change: ViewChange) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        seen = change(view_of(arrays, name, maps))
        return test({**arrays, f"{name}.origin": seen.origin, f"{name}.frame": seen.frame,
                     f"{name}.half": seen.half}, real)

    return altered


def _next_column(array: Array) -> Array:
    return np.roll(array, 1, axis=-1)


def _next_row(array: Array) -> Array:
    return np.roll(array, 1, axis=-2)
