"""The literal text of soft shadows as settings ask for it: V of one area light by its map."""

from typing import NamedTuple

import numpy as np

from refgi.cluster.settings import Csm, Hard, Pcf, Pcss
from refgi.literal.val_back_projection import back_projection
from refgi.literal.val_filters import box_means, disc_means, mip_levels, mip_means
from refgi.literal.val_maps import basis, depth_scale, map_depths, map_ranges
from refgi.literal.val_series import csm, csm_penumbra, series
from refgi.literal.val_visibility import depth_tests, pcss, pcss_penumbra, search, to_map

AT_ONCE = 32  # pixels that PCSS compares with every texel


class Seen(NamedTuple):
    """Distances around the centre of an area light."""

    center: np.ndarray  # (3,) m
    frame: np.ndarray  # rows right, down, forward
    depth: np.ndarray  # (n, n) m; inf where nothing is
    scene_far: float  # to the farthest corner of what takes part, m


def at_origin(depth, scene_far):
    """Return what a light at the origin sees, forward along z."""
    return Seen(np.zeros(3), np.eye(3), np.asarray(depth, float), scene_far)


def shadow(settings, seen, delta, points, facing):
    """Return V and z_avg, m, of pixels (3, n), 0 without blockers, of a light of size delta, m, by `ValSettings`."""
    parts = [_shadow(settings, seen, delta, points[:, k : k + AT_ONCE], facing[:, k : k + AT_ONCE])
             for k in range(0, points.shape[1], AT_ONCE)]
    return tuple(np.concatenate(one) for one in zip(*parts, strict=True))


def _shadow(settings, seen, delta, points, facing):
    kind, printed = settings.visibility, settings.as_published
    position, up = points[:, None].astype(float), facing[:, None].astype(float)
    ids = np.zeros((1, points.shape[1]), int)
    depth, size, map_ = seen.depth[None], np.array([delta]), (seen.center[None], seen.frame[None])
    near, far = map_ranges(depth)
    if isinstance(kind, Hard | Pcf) or delta == 0:
        texels = kind.texels if isinstance(kind, Pcf) else 1
        return depth_tests(position, ids, up, depth, *map_, size, near, texels)[0, 0], np.zeros(points.shape[1])
    sized = {"squares": "val_alpha_over_pi" in printed, "foreshortened": settings.area.foreshortened}
    axial, alpha = isinstance(kind, Pcss) and kind.blocker_depth == "axial", "val_alpha" in printed
    pending, region, _ = search(position, ids, *map_, size, near, "val_search_solid_angle" in printed, **sized,
                                axial=axial)
    if isinstance(kind, Pcss):
        biased = biased_distance(kind.constant_bias, seen, to_map(position, *map_)[1], near, far)
        shaded, z_avg, region = pcss_penumbra(position, up, depth, *map_, size, near, pending, region, alpha, **sized,
                                              axial=axial, cone=kind.cone, biased=biased)
        return pcss(position, up, depth, *map_, shaded, region, biased=biased)[0, 0], z_avg[0, 0]
    assert isinstance(kind, Csm)
    weight, bias, end = series(kind.terms, kind.attenuation, kind.rescale, kind.bias)
    scale = (*depth_scale(near, far, np.array([seen.scene_far]), end, kind.depth_scale), end)
    logs = kind.depth_scale == "log_map"
    mean = means_of(kind, basis(map_depths(depth, *scale, logs, kind.prefilter == "mip"), kind.terms,
                                kind.quantisation == "published"), sized["squares"])
    shaded, z_avg, final, t = csm_penumbra(position, *map_, size, near, *scale, weight, bias, pending,
                                           mean(pending, region, True), logs, alpha, **sized)
    v = csm(shaded, t, mean(shaded, final, False), weight, bias, 2.0 if kind.rescale == "scale2" else 1.0)
    return v[0, 0], z_avg[0, 0]


def biased_distance(bias, seen, d, near, far):
    """Return distances less a share of the depths of four terms, whose range the bias narrows; None without one."""
    if bias is None:
        return None
    _, slope = depth_scale(near, far, np.array([seen.scene_far]), series(4, fixed=bias.value)[2], bias.scale)
    along = bias.value / slope[0]
    return d * 2**-along if bias.scale == "log_map" else d - along


def means_of(kind, texels, squares):
    """Return what takes means of a basis (1, C, n, n) over regions."""
    if kind.prefilter == "mip":
        levels = [texels, *mip_levels(texels, kind.quantisation == "published")]
        return lambda asked, region, weighed: mip_means(asked, region, kind.terms, weighed, levels)
    mean = box_means if squares else disc_means
    return lambda asked, region, weighed: mean(asked, region, kind.terms, weighed, texels)


def projected(seen, area, points, facing):
    """Return V of pixels (3, n) by back projection onto an area's rectangle."""
    return back_projection(
        points[:, None].astype(float), np.zeros((1, points.shape[1]), int), facing[:, None].astype(float),
        seen.depth[None], seen.center[None], seen.frame[None], np.asarray(area.axes)[None], area.side[:, None],
        area.offset[:, None], area.center[:, None], seen.frame[2][:, None], np.array([seen.scene_far]))[0, 0]
