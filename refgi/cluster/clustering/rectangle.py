"""The area light of each cluster (Sec. 6): the bounding rectangle of its lights, projected onto its plane."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.area_lights import AreaLights
from refgi.cluster.clustering.axes import turn_of
from refgi.cluster.clustering.kmeans import Clusters
from refgi.cluster.settings import Axes, Extent, ValSettings
from refgi.errors import expect
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

UPRIGHT = 0.999  # |y| of a normal from which a map's up is -z, as for all maps
FLAT = 1e-5  # of a cluster's radius: a narrower rectangle is a line, of no width but the rounding of its lights


@stage("cluster.area_lights")
def area_lights(
    lights: "PixelLights", clusters: Clusters, settings: ValSettings, footprint: Array | None = None
) -> AreaLights:
    """Return the rectangle that stands for each cluster.

    Parameters
    ----------
    lights : PixelLights
        N lights.
    clusters : Clusters
        Their clusters.
    settings : ValSettings
        Axes, extent, correction for sampling, and what a single light is.
    footprint : (N,) ndarray, optional
        Surface area of each light, m^2; for single lights that are their footprint.

    Returns
    -------
    AreaLights
        M rectangles around the projections of their lights. A cluster of no lights, of one that is a point, or of
        lights in one place has sides of 0; one of lights in a row along an axis has one side of 0.

    Raises
    ------
    InputError
        If lights, clusters and footprints do not fit, or footprints are missing.

    Notes
    -----
    The paper says neither along which axes the rectangle lies nor what single size Delta the filter takes from its
    sides s and t: here the fixed frame of the map and (s t)^(1/2), or as the settings say. A rectangle around n lights
    drawn evenly from a rectangle of area A has a mean area of ((n - 1) / (n + 1))^2 A; `unbiased_area` divides that
    out, (n + 1) / (n - 1) a side.
    """
    position = np.asarray(lights.position, np.float64)
    total, count = position.shape[1], clusters.center.shape[1]
    expect(clusters.of.shape == (total,), "clusters.of", f"shape ({total},)", clusters.of.shape)
    if settings.single_light == "footprint":
        expect(footprint is not None and footprint.shape == (total,), "footprint",
               f"the area of each of {total} lights", None if footprint is None else footprint.shape)
    frames = map_frames(clusters.normal)
    used, away, starts = _grouped(position, clusters)
    axes = _axes(away, frames, clusters, settings.axes)
    side, offset, radius = np.zeros((2, count)), np.zeros((2, count)), np.zeros(count)
    if total:
        flat = np.einsum("nac,cn->an", np.repeat(axes[used], clusters.members[used], axis=0), away)
        low, high = np.minimum.reduceat(flat, starts, axis=1), np.maximum.reduceat(flat, starts, axis=1)
        side[:, used], offset[:, used] = high - low, (low + high) / 2
        radius[used] = np.sqrt(np.maximum.reduceat((away**2).sum(axis=0), starts))
    side[side < FLAT * radius] = 0.0
    side *= _correction(clusters.members) if settings.unbiased_area else 1.0
    if settings.single_light == "footprint" and footprint is not None:
        single = np.flatnonzero(clusters.members[clusters.of] == 1)
        side[:, clusters.of[single]] = np.sqrt(footprint[single])
    delta = _size(side, settings.extent)
    return AreaLights(clusters.center, clusters.normal, frames, side, axes, offset, delta, radius, clusters.members,
                      clusters.of)


def map_frames(normal: Array) -> Array:
    """Return the frames of paraboloid maps along normals, those of `paraboloid_projection`.

    Parameters
    ----------
    normal : (3, M) ndarray
        Unit vectors.

    Returns
    -------
    (M, 3, 3) ndarray
        Rows right, down, forward.
    """
    forward = np.ascontiguousarray(normal.T)
    up = np.where(np.abs(forward[:, 1:2]) < UPRIGHT, (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    right = np.cross(forward, up)
    right /= np.sqrt((right**2).sum(axis=1, keepdims=True))
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _grouped(position: Array, clusters: Clusters) -> tuple[Array, Array, Array]:
    """Return the clusters in use, the lights of each in turn from its centre, and where each begins."""
    order = np.argsort(clusters.of, kind="stable")
    used = np.flatnonzero(clusters.members)
    starts = np.cumsum(clusters.members[used]) - clusters.members[used]
    return used, position[:, order] - clusters.center[:, clusters.of[order]], starts


def _axes(away: Array, frames: Array, clusters: Clusters, axes: Axes) -> Array:
    """Return the axes of every rectangle, (M, 2, 3)."""
    turned = np.ascontiguousarray(frames[:, :2])
    if axes == "fixed":
        return turned
    first = 0
    for m, members in enumerate(clusters.members):
        turn = turn_of(frames[m, :2] @ away[:, first : first + members], axes)
        c, s = math.cos(turn), math.sin(turn)
        turned[m] = np.array([[c, s], [-s, c]]) @ turned[m]
        first += members
    return turned


def _correction(members: Array) -> Array:
    """Return by how much the sides of a rectangle around n lights fall short."""
    return np.where(members > 1, (members + 1) / np.maximum(members - 1, 1), 1.0)


def _size(side: Array, extent: Extent) -> Array:
    """Return Delta, the one size of each rectangle."""
    if extent == "root":
        root: Array = np.sqrt(side[0] * side[1])
        return root
    return np.asarray(side.max(axis=0) if extent == "longer" else side.min(axis=0))
