"""Stages of convolution shadow maps at pixels: filtered means, mean depth of blockers, V (VAL Sec. 4.1, 4.2)."""

from typing import Any

import numpy as np

from refgi.cluster.filters.prefilter import filter_means
from refgi.cluster.settings import Csm, ValSettings
from refgi.cluster.visibility.csm import compare_filtered, find_penumbra
from refgi.cluster.visibility.search_region import BIAS, CONSTANTS, GAIN, ON_SERIES, SCRATCH_ROWS, filter_sizing
from refgi.cluster.visibility.series import Series, series
from refgi.literal import val_filters
from refgi.literal import val_series as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.val_basis import filters_of, level_names
from refgi.vectors.stages.val_search import (
    LIGHT,
    PIXELS,
    PLACE,
    PLACES,
    SIZES,
    by_default,
    lanes,
    penumbra_planes,
    penumbra_specs,
    put_penumbra,
    searched,
    share_spec,
    sizing,
)
from refgi.vectors.stages.val_series import SCALE, scale_at


def add_csm(recipe: Recipe, settings: ValSettings, csm: Csm) -> None:
    """Add V by the series."""
    _add_means(recipe, settings, csm, "search", "search.pending", 4 * csm.terms + 1)

    exact = ("cone",) if by_default(settings) else ()
    series_of = {"weight": "series.weight", "bias": "series.bias"}
    form = Form(literal.csm_penumbra, {
        **PLACES, **SIZES, **series_of, "origin": "scale.origin", "slope": "scale.slope", "end": "series.range",
        "pending": "search.pending", "means": "search.means"},
        ("penumbra.shaded", "penumbra.z_avg", "penumbra.region", "penumbra.t"),
        {"logarithmic": csm.depth_scale == "log_map", **sizing(settings)})

    def penumbra(arrays: Arrays, real: Any) -> Arrays:
        out, weight, chain = penumbra_planes(arrays, real), *_chain(arrays, csm, real)
        out.new("penumbra.t")
        for lane in lanes(arrays, real, 4 * csm.terms + 1, chain):
            searched(lane, settings)
            flags, rows = lane.scratch.pending, lane.scratch.rows
            flags[:] = np.asarray(arrays["search.pending"])[lane.k].reshape(-1)
            means = np.ascontiguousarray(arrays["search.means"][lane.k], real).reshape(4 * csm.terms + 1, -1)
            asked = flags.copy()
            find_penumbra(lane.constants, filter_sizing(settings), scale_at(arrays, csm, lane.k), weight, means,
                          len(flags), flags, rows)
            put_penumbra(out, lane)
            out.put("penumbra.t", lane.k, rows[ON_SERIES], asked)
        return out.made

    recipe.add("penumbra", "mean depth of the blockers in the search disc, and the disc of the penumbra", penumbra,
               (*PIXELS, *LIGHT, *SCALE, "series.weight", "series.bias", "search.pending", "search.means"),
               {**penumbra_specs(),
                "penumbra.t": Spec(PLACE, "1", "depth on the scale of the series, of all pending pixels")},
               paper="VAL Sec. 4.1, E-VAL-02, 04, 07", exact=("maps.center",),
               variants=(form,), bugs=(*form.bugs("penumbra", "region", *exact, of="val_visibility"),
                                             *form.bugs(*(("csm_penumbra", "shade") if exact else ()))))
    _add_means(recipe, settings, csm, "penumbra", "penumbra.shaded", 2 * csm.terms)
    hard = ("hard.share",) if "hard.share" in recipe.specs else ()
    final = Form(literal.csm, {"shaded": "penumbra.shaded", "t": "penumbra.t", "means": "penumbra.means", **series_of,
                               **({"hard": "hard.share"} if hard else {})}, ("visibility.share",),
                 {"gain": series(csm).gain})

    def share(arrays: Arrays, real: Any) -> Arrays:
        made = np.array(arrays["hard.share"], real) if hard else np.ones(arrays["penumbra.shaded"].shape, real)
        weight, chain = _chain(arrays, csm, real)
        constants = np.zeros(CONSTANTS, real)
        for k, flags in enumerate(np.asarray(arrays["penumbra.shaded"]).reshape(len(made), -1)):
            rows, visible = np.zeros((SCRATCH_ROWS, len(flags)), real), np.ones(len(flags), real)
            rows[ON_SERIES] = arrays["penumbra.t"][k].reshape(-1)
            constants[BIAS], constants[GAIN] = chain.bias, chain.gain
            means = np.ascontiguousarray(arrays["penumbra.means"][k], real).reshape(2 * csm.terms, -1)
            compare_filtered(constants, weight, means, len(flags), flags, visible, rows)
            made[k].reshape(-1)[flags] = visible[flags]
        return {"visibility.share": made}

    recipe.add("visibility", "V = gain (1/2 + sum w_k (cos(c_k d') S_k - sin(c_k d') C_k)), where shaded", share,
               ("penumbra.shaded", "penumbra.t", "penumbra.means", "series.weight", "series.bias", *hard),
               {"visibility.share": share_spec()}, paper="VAL Sec. 4.1, E-VAL-02", variants=(final,),
               bugs=final.bugs("csm", "shade", *(("csm/hard",) if hard else ())))


def _add_means(recipe: Recipe, settings: ValSettings, csm: Csm, name: str, flag: str, channels: int) -> None:
    levels = level_names(recipe) + (("maps.t",) if csm.quantisation == "published" else ())
    boxes, by_mips = "val_alpha_over_pi" in settings.as_published, csm.prefilter == "mip"
    mean = val_filters.mip_means if by_mips else val_filters.box_means if boxes else val_filters.disc_means
    basis = {"levels": level_names(recipe)} if by_mips else {"basis": "basis.0"}
    form = Form(mean, {"pending": flag, "region": f"{name}.region", **basis}, (f"{name}.means",),
                {"terms": csm.terms, "weighed": channels > 2 * csm.terms})

    def run(arrays: Arrays, real: Any) -> Arrays:
        region, flags = np.asarray(arrays[f"{name}.region"], real), np.asarray(arrays[flag])
        made = np.zeros((len(flags), channels, *flags.shape[1:]), real)
        for k in np.flatnonzero(flags.any(axis=(1, 2))):
            filters = filters_of(arrays, csm, int(k), real, boxes)
            s, t, radius = (np.ascontiguousarray(one).reshape(-1) for one in region[k])
            asked = flags[k].reshape(-1)
            means = np.zeros((4 * csm.terms + 1, len(asked)), real)
            filter_means(filters, s, t, radius, asked, len(asked), channels > 2 * csm.terms, means)
            made[k].reshape(channels, -1)[:, asked] = means[:channels, asked]
        return {f"{name}.means": made}

    def by_shares(arrays: Arrays, _: Any) -> Arrays:  # coordinates of textures: rounded as numbers in [0, 1] are
        region = np.array(arrays[f"{name}.region"], np.float64)
        region[:, :2] = 2.0 * np.float32(0.5 * region[:, :2] + 0.5) - 1.0
        return run({**arrays, f"{name}.region": region}, np.float64)

    read = "8 texels of two levels" if by_mips else "all texels"
    recipe.facts["mip"] = {"level": "max(0, log2(radius * texels a side) - 1)" if by_mips else "none"}
    recipe.add(f"{name}.means", f"means of the channels over the disc, by {read}", run,
               (flag, f"{name}.region", *levels),
               {f"{name}.means": Spec("area light, channel, row, column", "1",
                                      "means of the channels of basis.0 over the disc; 0 where none is asked for")},
               paper="VAL Sec. 6", variants=(*((by_shares,) if by_mips else ()), form),
               bugs=form.bugs("means", mean.__name__))


def _chain(arrays: Arrays, csm: Csm, real: Any) -> tuple[Array, Series]:
    search, bias = (float(one) for one in arrays["series.bias"])
    chain = series(csm)._replace(search_bias=search, bias=bias)
    return np.ascontiguousarray(arrays["series.weight"], real), chain
