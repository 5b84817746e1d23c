"""Stages of clustered visibility as a whole: area lights, visibility, interleaved sums, blur (VAL Sec. 4 to 6)."""

from typing import Any

import numpy as np

from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.interleave import (
    add_members,
    assigned_subsets,
    gather_pixels,
    member_lights,
    scatter_pixels,
    subsets,
)
from refgi.cluster.settings import BackProjection, BoxBlur, Csm, GeometryBlur, Hard, Pcf, Pcss, ValSettings
from refgi.literal import val_areas as literal
from refgi.literal import val_filters
from refgi.pairs.irradiance import Receivers, checked
from refgi.scene import Scene
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.facing import add_facing
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import EQ2, LOBES, READS, RECEIVERS
from refgi.vectors.stages.val_areas import add_areas
from refgi.vectors.stages.val_basis import add_basis
from refgi.vectors.stages.val_clusters import add_extents, add_kmeans, clusters_of, extent_of
from refgi.vectors.stages.val_csm import add_csm
from refgi.vectors.stages.val_maps import add_maps
from refgi.vectors.stages.val_pcss import add_binary, add_pcss
from refgi.vectors.stages.val_projected import add_back_projection
from refgi.vectors.stages.val_search import add_search

BLUR = "VAL Sec. 6, E-VAL-13; docs/methods/val"


def add_val(recipe: Recipe, scene: Scene, settings: ValSettings) -> None:
    """Add all stages from pixel lights on to the irradiance."""
    add_extents(recipe, len(scene.lights))
    add_kmeans(recipe, clusters_of(settings), recipe.expected()["lights.flux"].shape[1])
    add_areas(recipe, settings.area)
    add_maps(recipe, settings)
    delta = recipe.expected()["areas.delta"]
    if isinstance(settings.visibility, Csm) and delta.any():
        add_basis(recipe, settings.visibility)
    add_facing(recipe, scene)
    add_visibility(recipe, settings, delta)
    add_lighting(recipe, settings)


def add_visibility(recipe: Recipe, settings: ValSettings, delta: Array) -> None:
    """Add V of each area light at each pixel; those of size `delta` (M,) 0 have hard shadows."""
    kind = settings.visibility
    if isinstance(kind, BackProjection):
        add_back_projection(recipe)
        return
    if isinstance(kind, Pcf | Hard) or not delta.any():
        add_binary(recipe, "visibility", kind.texels if isinstance(kind, Pcf) else 1)
        return
    if settings.maps.behind != "visible":
        raise ValueError(f"{recipe.id}: a second map: by depth tests of a square alone")
    if (delta == 0).any():
        add_binary(recipe, "hard", 1)
    add_search(recipe, settings)
    if isinstance(kind, Csm):
        add_csm(recipe, settings, kind)
    else:
        assert isinstance(kind, Pcss)
        add_pcss(recipe, settings, kind)


def add_lighting(recipe: Recipe, settings: ValSettings) -> None:
    """Add the light of each area light's members, the sum under their visibility, and the blur."""
    block = settings.interleaving.block or 1
    if block > 1:
        _add_subsets(recipe, settings, block)
    _add_parts(recipe, settings, block)

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.zeros(arrays["parts.irradiance"].shape[1:], real)
        for part, share in zip(arrays["parts.irradiance"], arrays["visibility.share"], strict=True):
            made += part * share
        return {"sum.irradiance": made}

    form = Form(literal.shadowed, {"irradiance": "parts.irradiance", "share": "visibility.share"}, ("sum.irradiance",))
    recipe.add("sum", "E = sum V_m E_m over all area lights", run, ("parts.irradiance", "visibility.share"),
               {"sum.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance" + (
                   ", not blurred" if block > 1 else ""), "linear RGB")}, paper="VAL Sec. 4",
               bugs=form.bugs("shadowed"), variants=(form,))
    if block > 1 and settings.blur is not None:
        _add_blur(recipe, settings.blur, block)


def _add_subsets(recipe: Recipe, settings: ValSettings, block: int) -> None:
    kind = settings.interleaving.assignment

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        return {"interleaving.subset": assigned_subsets(np.asarray(arrays["clusters.of"]), block, kind)}

    form = Form(literal.interleaving, {"of": "clusters.of"}, ("interleaving.subset",),
                {"side": block, "assignment": kind})
    recipe.facts["interleaving"] = {"n": block, "assignment": kind,
                                    "subset of a pixel": "(row mod n) n + column mod n"}
    recipe.add("interleaving", "which of n^2 subsets each light belongs to", run, ("clusters.of",),
               {"interleaving.subset": Spec("light", "1", "0 to n^2 - 1", tier="T0")},
               paper="VAL Sec. 6, E-VAL-13", bugs=form.bugs("interleaving", f"interleaving/{kind}"),
               variants=(form,))


def _add_parts(recipe: Recipe, settings: ValSettings, block: int) -> None:
    pairs = settings.pairs
    lights = light_names(recipe)
    area = ("lights.area",) if pairs.needs_footprints else ()
    own = ("interleaving.subset",) if block > 1 else ()

    def run(arrays: Arrays, real: Any) -> Arrays:
        receivers = _receivers(arrays, real)
        packed = checked(receivers, pixel_lights_of(arrays, real), pairs,
                         np.ascontiguousarray(arrays["lights.area"], real) if area else None)
        of, count = np.asarray(arrays["clusters.of"]), arrays["clusters.center"].shape[1]
        subset = np.asarray(arrays[own[0]], np.int64) if own else np.zeros(len(of), np.int64)
        parts, members = subsets(receivers.covered, block), member_lights(packed, of, count, subset, block**2)
        position, normal = (np.empty((3, len(parts.places)), real) for _ in range(2))
        gather_pixels(receivers.position.reshape(3, -1), parts, position)
        gather_pixels(receivers.normal.reshape(3, -1), parts, normal)
        made = np.zeros((count, *receivers.position.shape), real)
        for m in range(count):
            sums = np.zeros_like(position)
            add_members(position, normal, parts, members, m, sums)
            scatter_pixels(sums, parts, real(block**2), made[m].reshape(3, -1))
        return {"parts.irradiance": made}

    form = Form(literal.parts, {
        **READS, "triangle_id": RECEIVERS[2], "of": "clusters.of", "center": "clusters.center",
        **(LOBES if "lights.lobe_flux" in lights else {}), **({"area": "lights.area"} if area else {}),
        **({"subset": own[0]} if own else {})}, ("parts.irradiance",), {"side": block})
    recipe.facts["pairs.clamp"] = "none" if pairs.clamp is None else pairs.clamp.name()
    recipe.add("parts", "light of each area light's members, without visibility" + (
        ": n^2 times those of the pixel's subset" if own else ""), run,
        (*RECEIVERS, *lights, "clusters.of", "clusters.center", *own, *area),
        {"parts.irradiance": Spec("area light, rgb, row, column", "W/m^2", "irradiance of the cluster's lights",
                                  "linear RGB", EQ2)},
        paper="VAL Sec. 4, E-VAL-01, E-VAL-13", exact=("gbuffer.position", "lights.position"),
        bugs=form.bugs("parts", *(("parts/interleaved",) if own else ())), variants=(form,))


def _receivers(arrays: Arrays, real: Any) -> Receivers:
    position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
    return Receivers(position, normal, np.ascontiguousarray(np.asarray(arrays[RECEIVERS[2]]) >= 0))


def _add_blur(recipe: Recipe, settings: BoxBlur | GeometryBlur, block: int) -> None:
    reads = ("sum.irradiance", *RECEIVERS, "extents.visible")
    how = {"extent": settings.extent, "cosine": settings.cosine, "every_subset": settings.every_subset} if isinstance(
        settings, GeometryBlur) else {}
    form = Form(val_filters.blur, {
        "irradiance": reads[0], "position": RECEIVERS[0], "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2],
        "box": reads[-1]}, ("blur.irradiance",), {"size": block, **(how or {
            "extent": np.inf, "cosine": -np.inf, "every_subset": False})})

    def run(arrays: Arrays, real: Any) -> Arrays:
        light, diagonal = np.ascontiguousarray(arrays["sum.irradiance"], real), extent_of(arrays, "visible").diagonal
        return {"blur.irradiance": blur(light, _receivers(arrays, real), block, settings, diagonal)}

    recipe.facts["blur"] = {"n": block, "window": "x - n // 2 on, moved inwards at the rim"} | (
        {"extent, of the visible box's diagonal": settings.extent, "least cosine": settings.cosine,
         "every subset": settings.every_subset} if isinstance(settings, GeometryBlur) else {})
    recipe.add("blur", "mean over n x n pixels of the same surface, each subset once", run, reads,
               {"blur.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB")},
               paper=BLUR, exact=("gbuffer.position", "gbuffer.normal"), variants=(form,),
               bugs=form.bugs(*(("blur/geometry", f"blur/every subset {how['every_subset']}") if how else ()), "blur",
                              *(("blur/even",) if block % 2 == 0 else ())))
