"""Literal forms of `@stage` functions, by name: what they read of a stage's parameters, and which rows they have.

Each entry is handed a stage's arguments and returns its form and lists, or None where the literal text does not cover
them. Names of arrays are those of parameters and their fields (`lights.flux`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.literal import direct, pairs, upsampling, val_areas
from refgi.scene import DirectionalLight, PointLight, SpotLight
from refgi.scene.model import Light
from refgi.sssil.settings import Bilateral
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array

Arguments = Mapping[str, Any]


class Described(NamedTuple):
    """What a stage has beside its function."""

    form: Form
    lists: tuple[tuple[str, str], ...]  # literal module, "" for the form's own, and list of rows
    exact: tuple[str, ...] = ()  # leaves of parameters, as `Stage.exact`


def described(stage: str, arguments: Arguments) -> Described | None:
    """Return what a run of a stage has beside its function; None where there is no literal form of it."""
    make = FORMS.get(stage)
    return None if make is None else make(arguments)


def ids(covered: Array) -> Array:
    """Return triangle ids of receivers of which only whether there is one is known."""
    return np.where(covered, np.int32(0), np.int32(-1))


def pair_sum(arguments: Arguments) -> Described | None:
    """Return Eq. 2 and 3 without clamp or with discs."""
    lights, settings = arguments["lights"], arguments["settings"]
    clamp = "none" if settings.clamp is None else settings.clamp.name()
    plain = settings.offset == 0 and not settings.as_published and settings.lobe.norm == "clamped"
    if clamp not in ("none", "disc") or not plain or settings.lobe.widening or arguments["lightcuts"] is not None:
        return None
    glossy, disc = lights.lobe_flux is not None, clamp == "disc"
    reads = {"position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered",
             "light_position": "lights.position", "light_normal": "lights.normal", "flux": "lights.flux"}
    if glossy:
        reads |= {name: f"lights.{name}" for name in ("lobe_flux", "lobe_axis", "lobe_exponent")}
    if disc:
        reads["area"] = "footprint"
    form = Form(pairs.irradiance, reads, ("",), adapt={"triangle_id": ids})
    return Described(form, tuple(("", name) for name in pair_lists("irradiance", glossy, disc, lights.flux.shape[1])),
                     ("receivers.position", "lights.position"))


def pair_lists(entry: str, glossy: bool, disc: bool, count: int) -> tuple[str, ...]:
    """Return the lists of rows that hold for sums over lights with or without lobes and discs."""
    kind = "glossy" if glossy else "diffuse"
    return ("pair", *((entry,) if entry == "irradiance" else ()),
            *(("pair/disc",) if disc else ("pair/free", f"{entry}/free", f"pair/{kind} free")), f"pair/{kind}",
            f"{entry}/{kind}", *(("pair/several",) if count > 1 else ()))


def direct_light(arguments: Arguments) -> Described | None:
    """Return the direct irradiance of one lamp."""
    light = arguments["light"]
    if arguments["visible"] is None:
        return None
    spot, near = isinstance(light, SpotLight), not isinstance(light, DirectionalLight)
    numbers = {
        "strength": (np.array(light.intensity if near else light.irradiance),),
        "place": (np.array(light.position) if near else None,),
        "direction": (None if isinstance(light, PointLight) else np.array(light.direction),),
        "half_angles": (np.array([light.inner_half_angle, light.outer_half_angle]) if spot else None,),
        "falloff": (light.falloff if spot else None,)}
    reads = {"position": "buffer.position", "normal": "buffer.normal", "triangle_id": "buffer.triangle_id",
             "visible": ("visible",)}
    lists = ("direct", *(("direct/place",) if near else ()), *(("direct/spot",) if spot else ()))
    return Described(Form(direct.direct_irradiance, reads, ("",), numbers, double=True),
                     (*(("", one) for one in lists), *(("light_flux", one) for one in falloff_lists([light]))),
                     ("buffer.position",))


def falloff_lists(lights: Sequence[Light]) -> tuple[str, ...]:
    """Return the lists of wrong falloffs of some lights' spots: what is right for all of them is none."""
    kinds = {light.falloff for light in lights if isinstance(light, SpotLight)}
    return (*(("falloff",) if kinds else ()), *(("falloff/smooth",) if kinds - {"squared_ramp"} else ()),
            *(("falloff/squared",) if "squared_ramp" in kinds else ()))


def rectangles(arguments: Arguments) -> Described | None:
    """Return the rectangles of clusters whose single lights are points."""
    settings = arguments["settings"]
    if settings.single_light != "point":
        return None
    reads = {"position": "lights.position", "center": "clusters.center", "normal": "clusters.normal",
             "of": "clusters.of"}
    form = Form(val_areas.areas, reads, ("frame", "axes", "side", "offset", "delta", "radius", "members"), {
        "axes": settings.axes, "extent": settings.extent, "unbiased": settings.unbiased_area}, double=True,
        kept={"center": "clusters.center", "normal": "clusters.normal", "of": "clusters.of"})
    return Described(form, tuple(("", one) for one in ("areas", *area_lists(settings))),
                     ("lights.position", "clusters.center"))


def area_lists(settings: Any) -> tuple[str, ...]:
    """Return the lists of rows that hold for an area light's settings."""
    return ("areas/root" if settings.extent == "root" else "areas/not root",
            "areas/fixed" if settings.axes == "fixed" else "areas/not fixed",
            "areas/unbiased" if settings.unbiased_area else "areas/biased")


def level_blur(arguments: Arguments) -> Described:
    """Return the mean over windows of a level's texels."""
    settings = arguments["settings"]
    planes = {name: f"level.{name}" for name in ("position", "normal", "depth")}
    form = Form(upsampling.blur, {"light": "irradiance", **planes}, ("",), {
        "size": settings.size, "plane_tolerance": settings.plane_tolerance, "cosine": settings.cosine})
    return Described(form, (("", "blur"), *((("", "blur/even"),) if settings.size % 2 == 0 else ())),
                     tuple(planes.values()))


def level_upsampling(arguments: Arguments) -> Described | None:
    """Return joint bilateral upsampling, and the sum with a level's own light."""
    settings, guide, coarse = arguments["settings"], arguments["guide"], arguments["coarse"]
    weights, adds = settings.upsampling, arguments["added"] is not None
    factor = next(2**k for k in range(1, 6) if -(-guide.depth.shape[0] // 2**k) <= coarse.shape[1])
    if not isinstance(weights, Bilateral):
        return None
    mean = settings.senders.downsample == "average"
    reads = {"coarse": "coarse", "below_depth": "coarse_guide.depth", "below_normal": "coarse_guide.normal",
             "depth": "guide.depth", "normal": "guide.normal", **({"own": "added"} if adds else {})}
    form = Form(upsampling.level_sum if adds else upsampling.upsample, reads, ("",), {
        "factor": factor, "depth_sigma": weights.depth_sigma, "normal_power": weights.normal_power,
        "nearest": not mean})
    lists = ("upsample", *(("level_sum",) if adds else ()), *(("upsample/mean",) if mean else ()))
    return Described(form, tuple(("", one) for one in lists), ("coarse_guide.depth", "guide.depth"))


FORMS: Mapping[str, Callable[[Arguments], Described | None]] = {
    "pairs.sum": pair_sum, "rsm.direct_irradiance": direct_light, "cluster.area_lights": rectangles,
    "sssil.blur": level_blur, "sssil.upsample": level_upsampling}
