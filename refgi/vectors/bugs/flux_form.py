"""Flux that a map's texels reflect, as a port finds it, with knobs for bugs (SII Sec. 3.1; docs/radiometry)."""

import functools
from typing import Any

import numpy as np

from refgi.scene import DirectionalLight, SpotLight
from refgi.scene.model import Light
from refgi.vectors.bugs.spot_integral import Falloff, own_falloff, share_at, spot_integrals
from refgi.vectors.bugs.surface import literal_surface, rays
from refgi.vectors.bugs.views import View, ViewChange
from refgi.vectors.spec import Array, Arrays

EVERY = slice(None)


def literal_flux(
    arrays: Arrays, name: str, lamp: tuple[str, Light], view: View, *, paint: str = "own", holes: bool = False,
    table: str = "own", times: str = "none", strength: str = "own", area: str = "own", angle: float | None = None,
    corner: bool = False, power: float = 3.0, falloff: Falloff | None = None, angles: tuple[int | None, int] = (0, 1),
    widened: float = 1.0, sample: bool = False, pieces: tuple[slice, slice] = (EVERY, EVERY), modulo: bool = True,
    maps: int | None = None, mirror: str = "r", lobe_axis: bool = False, lobe_frame: ViewChange | None = None,
    lobe_centre: tuple[float, float] = (0.5, 0.5), everywhere: bool = False, exponent: str = "own",
    norm: int | None = None,
) -> dict[str, Array]:
    """Return solid angle, flux and lobes of each texel of a light's map, or with a bug."""
    ids, light = np.asarray(arrays[f"{name}.triangle_id"]), lamp[1]
    falloff = falloff or own_falloff(light)
    directional, key = isinstance(light, DirectionalLight), "half_angles"
    rows = np.arange(view.maps * view.rows)
    rows = rows % view.rows if modulo else rows
    shift = (-0.5 * view.rows, -0.5 * view.columns) if corner else (0.0, 0.0)
    low, high = (view.image_points((end - shift[0], end - shift[1]), 0, rows) for end in (0.0, 1.0))
    dx, dy = (2 * view.half / (view.columns, view.rows)).tolist()
    solid = _angles(low, high) if not directional or area == "angle" else {
        "one": 1.0, "whole": dx * dy * view.rows * view.columns, "quarter": dx * dy / 4, "width": dx}.get(
        area, dx * dy) * np.ones(ids.shape)
    if angle is not None:
        middle = view.image_points((0.5, 0.5), 0, rows)
        cosine = (1 + middle[0] ** 2 + middle[1] ** 2) ** -0.5
        solid = dx * dy * cosine**angle if angle >= 0 else np.full_like(solid, solid[0, 0])
    measure = np.ones_like(solid) if area == "flux" else solid
    cone = np.asarray(arrays[f"{lamp[0]}.{key}"], np.float64) if isinstance(light, SpotLight) else np.zeros(2)
    if isinstance(light, SpotLight):
        chosen = tuple(1e-9 if k is None else widened * float(cone[k]) for k in angles)
        measure = _spot(low, high, (chosen[0], chosen[1]), falloff, power, pieces)
        if sample:
            middle = view.image_points((0.5, 0.5), 0, rows)
            measure = solid * share_at((1 + middle[0] ** 2 + middle[1] ** 2) ** -0.5, cone[0], cone[1], falloff)
    seen = np.ones_like(ids, bool) if holes else (ids >= 0) & (
        np.arange(len(ids)) // view.rows < (view.maps if maps is None else maps))[:, None]
    diffuse, specular, exponents = _reflectance(arrays, ids, paint, table)
    arriving = _strength(arrays, lamp, strength, float(cone[1])) * np.where(seen, measure, 0.0)
    if times != "none":
        arriving = arriving * _received(arrays, ids, view, times)
    kept = specular * arriving
    lobe = seen & ((kept > 0).any(axis=0) | everywhere)
    own = np.where(lobe, exponents if exponent == "own" else np.asarray(arrays["materials.exponent"])[0], 0.0)
    looked = view if lobe_frame is None else lobe_frame(view)
    axis = _mirrored(arrays, ids, looked, mirror, lobe_centre, lobe_axis, modulo)
    scale = 1.0 if norm is None else (own + norm) / (2 * np.pi) if norm else 1 / np.pi
    return {"solid_angle": solid, "flux": diffuse * arriving, "lobe_flux": kept * scale,
            "lobe_axis": np.where(lobe, axis, 0.0), "lobe_exponent": own}


def _angles(low: tuple[Array, Array], high: tuple[Array, Array]) -> Array:
    """Return the solid angle of rectangles of the plane at distance 1."""
    def corner(x: Array, y: Array) -> Array:
        return np.asarray(np.arctan2(x * y, np.sqrt(1 + x * x + y * y)))

    (x0, y0), (x1, y1) = low, high
    return np.asarray(corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0))


def _spot(
    low: tuple[Array, Array], high: tuple[Array, Array], cone: tuple[float, float], falloff: Falloff, power: float,
    pieces: tuple[slice, slice],
) -> Array:
    (x0, y0), (x1, y1) = low, high
    edges = np.stack([one.reshape(-1) for one in (x0, x1, y0, y1)])
    kept = tuple((piece.start, piece.stop) for piece in pieces)
    return _integrals(edges.tobytes(), cone, falloff, power, kept).reshape(x0.shape)


@functools.lru_cache(maxsize=64)  # most bugs leave a map's cone as it is
def _integrals(
    edges: bytes, cone: tuple[float, float], falloff: Falloff, power: float, pieces: tuple[tuple[Any, Any], ...]
) -> Array:
    x0, x1, y0, y1 = np.frombuffer(edges).reshape(4, -1)
    inner = cone[0] * (1 - 1e-12) if cone[0] == cone[1] else cone[0]
    with np.errstate(all="ignore"):
        made = spot_integrals((x0, x1), (y0, y1), (inner, cone[1]), falloff=falloff, power=power,
                              columns=slice(*pieces[0]), rows=slice(*pieces[1]))
    made.flags.writeable = False
    return made


def _strength(arrays: Arrays, lamp: tuple[str, Light], how: str, outer: float) -> Array:
    key = "irradiance" if isinstance(lamp[1], DirectionalLight) else "intensity"
    own = np.asarray(arrays[f"{lamp[0]}.{key}"], np.float64)
    own = {"red": own[[0, 0, 0]], "reverse": own[::-1], "grey": np.full(3, own.mean())}.get(how, own)
    return own.reshape(3, 1, 1) / (2 * np.pi * (1 - np.cos(outer)) if how == "cone" else 1.0)


def _reflectance(arrays: Arrays, ids: Array, paint: str, table: str) -> tuple[Array, Array, Array]:
    """Return diffuse and specular reflectance (3, H, W) and the exponent (H, W)."""
    diffuse, specular, exponent = (np.asarray(arrays[f"materials.{key}"], np.float64) for key in
                                   ("diffuse", "specular", "exponent"))
    own = np.asarray(arrays["scene.material_of_face"])[ids]
    material = {"first": np.zeros_like(own), "last": np.full_like(own, len(diffuse) - 1),
                "triangle": ids % len(diffuse), "next": (own + 1) % len(diffuse)}.get(paint, own)
    pair = {"white": (np.ones_like(diffuse), specular), "exchanged": (specular, diffuse),
            "sum": (diffuse + specular, specular), "diffuse lobes": (diffuse, diffuse)}.get(table, (diffuse, specular))
    return np.moveaxis(pair[0][material], -1, 0), np.moveaxis(pair[1][material], -1, 0), exponent[material]


def _received(arrays: Arrays, ids: Array, view: View, times: str) -> Array:
    """Return the cosine at the surface, over the squared distance, or one of both."""
    made = literal_surface(arrays, ids, view)
    _, d, _ = rays(view)
    length = np.sqrt((d**2).sum(axis=0))
    cosine = np.abs((made["normal"] * d).sum(axis=0)) / length
    square = np.where(ids >= 0, (made["depth"] * length) ** 2, 1.0)
    return np.asarray({"cosine": cosine, "distance": 1 / square, "both": cosine / square}[times])


def _mirrored(
    arrays: Arrays, ids: Array, view: View, how: str, centre: tuple[float, float], forward: bool, modulo: bool
) -> Array:
    """Return the axis of a lobe at each texel."""
    normal = literal_surface(arrays, ids, view, centre=centre, modulo=modulo)["normal"]
    _, d, frame = rays(view, centre, modulo=modulo)
    d = np.moveaxis(frame[:, :, 2], -1, 0) if forward else d
    d = d / np.sqrt((d**2).sum(axis=0))
    along = (normal * d).sum(axis=0) * normal
    axis = {"r": d - 2 * along, "d": d, "-d": -d, "n": normal, "d - n": d - along, "d + 2n": d + 2 * along,
            "half": normal - d}[how]
    with np.errstate(all="ignore"):
        return axis / np.sqrt((axis**2).sum(axis=0)) if how != "d + 2n" else np.asarray(axis)
