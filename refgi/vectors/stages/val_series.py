"""Stages of the series by which convolution shadow maps compare depths, and of its scale on each map (VAL Sec. 4.1)."""

from typing import Any

import numpy as np

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.settings import Csm
from refgi.cluster.visibility.search_region import scale_of
from refgi.cluster.visibility.series import series
from refgi.literal import val_maps
from refgi.literal import val_series as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.val_maps import shadow_maps_of

SCALE = ("scale.origin", "scale.slope", "series.range")


def add_series(recipe: Recipe, csm: Csm) -> None:
    """Add the numbers of the series."""
    plain = csm.attenuation == 0 and csm.rescale == "none" and csm.bias is None
    form = Form(literal.series, {}, ("series.weight", "series.bias", "series.range"), {
        "terms": csm.terms, "attenuation": csm.attenuation, "rescale": csm.rescale, "fixed": csm.bias})

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        chain = series(csm)
        return {"series.weight": chain.weight, "series.bias": np.array([chain.search_bias, chain.bias]),
                "series.range": np.array([chain.range])}

    facts = {"terms": csm.terms, "depth_scale": csm.depth_scale, "prefilter": csm.prefilter,
             "gain": series(csm).gain, "least blocked share": 0.02}
    recipe.facts["csm"] = facts
    recipe.add("series", "weights and biases of f_M, and the far end of its depths", run, (), {
        "series.weight": Spec("term", "1", "w_k = 2 / c_k, c_k = (2k - 1) pi", paper="E-VAL-02"),
        "series.bias": Spec("(search, comparison)", "1", "b*, where f_M is 1 for the first time", paper="E-VAL-03"),
        "series.range": Spec("one", "1", "1 - 2 b*, the depth of what is farthest", paper="E-VAL-05")},
        paper="VAL Sec. 4.1, E-VAL-02, 03, 05", variants=(form,),
        bugs=form.bugs("series", "series/plain" if plain else "series/damped"))


def add_scale(recipe: Recipe, csm: Csm) -> None:
    """Add the scale of depths of each map."""
    kind = csm.depth_scale

    def run(arrays: Arrays, real: Any) -> Arrays:
        maps = shadow_maps_of(arrays, real)
        chain = series(csm)._replace(range=float(arrays["series.range"][0]))
        scales = [scale_of(maps, k, kind, chain) if maps.map_of[k] >= 0 else DepthScale(False, 0.0, 0.0, 0.0)
                  for k in range(len(maps.near))]
        return {"scale.origin": np.array([one.origin for one in scales]),
                "scale.slope": np.array([one.slope for one in scales])}

    form = Form(val_maps.depth_scale, {"near": "maps.near", "far": "maps.far", "scene_far": "maps.scene_far",
                                       "end": "series.range"}, SCALE[:2], {"kind": kind})
    others = (f"depth_scale/not {one}" for one in ("log_map", "map", "scene") if one != kind)
    unit = "depths per octave" if csm.depth_scale == "log_map" else "1/m"
    recipe.add("scale", "scale on which the depths of each map are compared; far / near counts as at least 1.05", run,
               ("maps.near", "maps.far", "maps.scene_far", "series.range"),
               {"scale.origin": Spec("area light", "m", "distance of depth 0; 0 for empty maps"),
                "scale.slope": Spec("area light", unit, "depths per octave of distance or per metre; 0 on empty maps")},
               paper="E-VAL-05", bugs=form.bugs("depth_scale", f"depth_scale/{kind}", *others), variants=(form,))


def scale_at(arrays: Arrays, csm: Csm, k: int) -> DepthScale:
    """Return the scale of one map among arrays."""
    return DepthScale(csm.depth_scale == "log_map", float(arrays["scale.origin"][k]), float(arrays["scale.slope"][k]),
                      float(arrays["series.range"][0]))
