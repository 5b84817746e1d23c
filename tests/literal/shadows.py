"""Soft shadows as settings ask for them: `ValSettings` as named arguments of refgi.literal.val."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from refgi.cluster.settings import Csm, Pcf, Pcss
from refgi.literal.val import Maps, shadows

AT_ONCE = 32  # pixels that are compared with every texel


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
    """Return V and z_avg, m, of pixels (3, n), 0 without blockers, of a light of size delta, m."""
    return tuple(one[0] for one in shadows_of(settings, SimpleNamespace(delta=np.array([delta])),
                                              Maps(*(np.asarray(one)[None] for one in (
                                                  seen.depth, seen.center, seen.frame, seen.scene_far))),
                                              points, facing))


def shadows_of(settings, areas, maps, points, facing, shading=None):
    """Return V and z_avg (K, n) of pixels (3, n) by the maps of area lights."""
    ids, found, kind = np.zeros((1, points.shape[1]), int), [], settings.visibility.name()
    planes = (points[:, None].astype(float), ids, *(
        one[:, None].astype(float) for one in (facing, facing if shading is None else shading)))
    for k in range(0, points.shape[1], AT_ONCE):
        *some, normals = (plane[..., k : k + AT_ONCE] for plane in planes)
        beside = {"shading": normals} if kind == "back_projection" else soft(settings)
        found.append(shadows(kind, *some, areas, maps, **beside))
    return tuple(np.concatenate(one, axis=2)[:, 0] for one in zip(*found, strict=True))


def soft(settings):
    """Return what a kind of soft shadow is asked for by name."""
    kind, printed = settings.visibility, settings.as_published
    if isinstance(kind, Pcf):
        return {"texels": kind.texels}
    how = {"solid_angle": "val_search_solid_angle" in printed, "alpha": "val_alpha" in printed,
           "squares": "val_alpha_over_pi" in printed, "foreshortened": settings.area.foreshortened}
    if isinstance(kind, Pcss):
        bias = kind.constant_bias
        return how | {"cone": kind.cone, "axial": kind.blocker_depth == "axial"} | (
            {} if bias is None else {"bias": bias.value, "bias_scale": bias.scale})
    if isinstance(kind, Csm):
        same = {name: getattr(kind, name) for name in ("terms", "attenuation", "rescale", "bias", "depth_scale")}
        return how | same | {"mip": kind.prefilter == "mip", "in_bytes": kind.quantisation == "published"}
    return {}
