"""Each light's own lists, and light with visibility, one step after the other (AMS Sec. 3.3.1, 3.4).

- pixels tuple of (h_l, w_l): Representative pixel of each cell of levels 0 to top, -1 without surface.
- pixel (n,): Pixel of each subsplat.
"""

import dataclasses
import itertools
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.reference import reference_visibility
from refgi.cluster.val import cluster_lights
from refgi.error_target.grid import Subsplats, representatives, top_level
from refgi.pairs.irradiance import Receivers
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded, receivers, senders_of
from refgi.pairs.steps import filled_rays, shadow_rays
from refgi.pairs.tiles import taken
from refgi.rays import Tracer
from refgi.rsm import facing_normals
from refgi.scene import Geometry
from refgi.splat.multires.evaluate import points_of, sum_at
from refgi.splat.multires.light_lists import ReceiverTree, append_children, keep_split
from refgi.splat.multires.per_light import CellTree, cell_tree, interior_cells, threshold_of
from refgi.splat.multires.settings import Representative, Upsampling
from refgi.splat.multires.steps import area_read, arrays_of, points, subsplats_of
from refgi.splat.multires.upsample import picture_of
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import ByIrradiance

Levels = tuple[Array, ...]


@stage("multires.samples", kept=False)
def samples(
    position: Array, normal: Array, pixels: Levels, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None, area: Array | None,
    pairs: PairSettings, representative: Representative,
) -> dict[int, Array]:
    """Sum the irradiance of each light alone at every cell (AMS Eq. 2; E-AMS-02).

    area (light,): Surface that each stands for, m^2, where the clamp reads it.
    representative: Whether a cell is its representative pixel, or its mean surface.
    -> dict of (light, rgb, h_l, w_l): Irradiance of each light, W/m^2, by level; 0 without surface.
    """
    made = {}
    for level, pixel in enumerate(pixels):
        row, column = np.nonzero(pixel >= 0)
        cells = Subsplats(np.full(len(row), level), row, column, pixel[row, column], (), pixels[0].shape)
        points, normals = points_of(position, normal, pixels[0] >= 0, cells, representative)
        made[level] = np.zeros((flux.shape[1], 3, *pixel.shape), position.dtype)
        for k in range(flux.shape[1]):
            only = (None if part is None else np.ascontiguousarray(part[..., k : k + 1]) for part in (
                light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent))
            made[level][k][:, row, column] = sum_at(points, normals, PixelLights._make((*only, 1, None, None, None)),
                                                    pairs, None if area is None else area[k : k + 1])
    return made


@stage("multires.splits", kept=False)
def splits(
    pixels: Levels, sampled: Levels, finest: int, threshold: float, form: Literal["relative", "absolute", "brightest"],
    start: tuple[Array, Array, Array] | None = None,
) -> dict[int, Array]:
    """Find the cells that each light splits: max - min of a channel over its quadrants exceeds T (AMS Sec. 3.3.1).

    sampled tuple of (light, 3, h_l, w_l): Irradiance of each light there, W/m^2.
    finest: Finest level.
    threshold: T in W/m^2, or the share that it is of this.
    form: Of the largest channel of the light's samples at the quadrants' level and above ("relative"), of none, or of
        the largest sum of all lights at the coarsest cells over their number.
    start tuple of (subsplat): Level, row and column of the list of all lights that each goes on to refine.
    -> dict of (light, h_l, w_l) bool: Whether the cell is split, by level; false where the list does not come to it.
    """
    top, covered = len(pixels) - 1, pixels[0] >= 0
    tree, count, real = cell_tree(covered, top, finest), len(sampled[0]), sampled[0].dtype
    refined = np.zeros(len(tree.level), np.bool_) if start is None else interior_cells(
        tree, subsplats_of(covered, *start, top))
    cells = ReceiverTree(tree.first, tree.roots, np.zeros((3, 0), real), np.zeros((3, 0), real), refined)
    offset, share = threshold_of(real.type, threshold, form, count, lambda: sampled[top].sum(axis=0))
    made = {level: np.zeros((count, *pixels[level].shape), np.bool_) for level in range(1, top + 1)}
    for k in range(count):
        light = np.zeros((3, len(tree.level)), real)
        for level in range(top + 1):
            here = tree.level == level
            light[:, here] = sampled[level][k][:, tree.row[here], tree.column[here]]
        for cell in _split_cells(cells, light, offset, share):
            made[int(tree.level[cell])][k, tree.row[cell], tree.column[cell]] = True
    return made


def _split_cells(cells: ReceiverTree, light: Array, offset: Any, share: Any) -> Array:
    """Return the cells of a tree that one light's list splits, level after level, by its light (3, n) at all."""
    cell, child = np.empty(len(cells.refined), np.int32), np.full(len(cells.refined), -1, np.int32)
    listed = np.empty_like(light)
    cell[: cells.roots] = np.arange(cells.roots)
    start, last, stop, largest = 0, 0, cells.roots, light.dtype.type(0)
    while last < stop:
        listed[:, last:stop] = light[:, cell[last:stop]]
        largest, end = max(largest, listed[:, last:stop].max()), stop
        if last > 0:
            end = keep_split(cells, cell, child, listed, start, last, offset + share * largest)
        start, last = last, end
        stop = append_children(cells.first, cell, start, last)
    return cell[:last][child[:last] >= 0]


@stage("multires.lists", kept=False)
def lists(pixels: Levels, sampled: Levels, split_levels: Levels) -> tuple[Array, Array, Array, Array, Array]:
    """List each light's subsplats: cells that are not split, but whose coarser cell is (AMS Sec. 3.3.1).

    sampled tuple of (light, 3, h_l, w_l): Irradiance of each light there, W/m^2.
    split_levels tuple of (light, h_l, w_l) bool: Cells of levels 1 to top that each light splits.
    -> first (light and one more) int64: Where each light's list begins, and the end.
    -> level (subsplat) uint8: Level: cell of 2^level pixels a side. Light by light, coarsest level first, row by row.
    -> row (subsplat) int32: Row in the grid of its level.
    -> column (subsplat) int32: Column in the grid of its level.
    -> irradiance (rgb, subsplat): Irradiance of its light there, W/m^2.
    """
    top = len(pixels) - 1
    tree = cell_tree(pixels[0] >= 0, top, 0)
    parent = np.repeat(np.arange(len(tree.level)), np.diff(tree.first))  # of all cells but the coarsest
    order = np.lexsort((tree.column, tree.row, -tree.level.astype(np.int64)))
    cells, light = [np.zeros(0, np.int64)], [np.zeros((3, 0), sampled[0].dtype)]
    for k in range(len(sampled[0])):
        split = _of_tree(tree, [np.zeros_like(pixels[0], np.bool_), *(one[k] for one in split_levels)])
        leaf = ~split
        leaf[tree.roots :] &= split[parent]
        cells.append(order[leaf[order]])
        light.append(_of_tree(tree, [one[k] for one in sampled])[:, cells[-1]])
    chosen = np.concatenate(cells)
    return (np.cumsum([len(one) for one in cells]), tree.level[chosen], tree.row[chosen], tree.column[chosen],
            np.concatenate(light, axis=1))


def _of_tree(tree: CellTree, planes: list[Array]) -> Array:
    """Return the values (..., n) that levels have at the cells of a tree."""
    made = np.empty((*planes[0].shape[:-2], len(tree.level)), planes[0].dtype)
    for level, plane in enumerate(planes):
        here = tree.level == level
        made[..., here] = plane[..., tree.row[here], tree.column[here]]
    return made


@stage("multires.sum_of_pictures", kept=False)
def sum_of_pictures(
    covered: Array, first: Array, level: Array, row: Array, column: Array, irradiance: Array, top: int,
    mode: Upsampling, filter_all: bool, corner_rule: bool,
) -> Array:
    """Upsample each light's subsplats by themselves, coarsest level first, and add (AMS Sec. 3.3.1, 3.5; E-AMS-09).

    first (N + 1,): Where each light's list begins.
    level, row, column (subsplat) int: The lists of all lights.
    irradiance (rgb, subsplat): Their light, W/m^2.
    mode: Filter from level to level.
    filter_all, corner_rule: Whether leaves are filtered too; whether a cell across a corner counts only beside one that
        counts.
    -> (rgb, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    total = np.zeros((3, *covered.shape), irradiance.dtype)
    for begin, end in itertools.pairwise(first):
        listed = subsplats_of(covered, level[begin:end], row[begin:end], column[begin:end], top)
        total += picture_of(irradiance[:, begin:end], listed, covered, mode, filter_all=filter_all,
                            corner_rule=corner_rule)
    return total


def per_light_steps(
    buffer: "GBuffer", lights: PixelLights, settings: "ByIrradiance", pairs: PairSettings,
    footprint: Array | None = None, start: Subsplats | None = None, *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Return the picture of all lights, each from subsplats of its own, made by steps."""
    top = top_level(buffer.height, buffer.width, settings.coarsest)
    pixels = representatives(buffer.covered, top)
    sampled = tuple(samples(buffer.position, buffer.normal, pixels, *arrays_of(lights), area_read(footprint, pairs),
                            pairs, settings.representative).values())
    split = splits(pixels, sampled, settings.finest, settings.threshold, settings.form,
                   None if start is None else start[:3])
    listed = lists(pixels, sampled, tuple(split.values()))
    return sum_of_pictures(buffer.covered, *listed, top, settings.upsampling, filter_all, corner_rule)


@stage("multires.subsplat_facing", kept=False)
def subsplat_facing(
    vertices: Array, faces: Array, point_normal: Array, triangle_id: Array, pixel: Array
) -> Array:
    """Find the normal of the face that each subsplat's pixel sees (docs/conventions).

    vertices (n, 3): Vertices of the scene, m.
    faces (m, 3) int32: Its triangles.
    point_normal (3, n): Normals of the subsplats.
    -> (xyz, subsplat): Unit normal of the face, on the side of the subsplat's normal.
    """
    geometry = Geometry(vertices, faces, np.zeros(len(faces), np.int32))
    of = triangle_id.reshape(-1)[pixel]
    return receivers(geometry, np.zeros_like(point_normal), point_normal, of, 1.0).facing.astype(point_normal.dtype)


@stage("multires.lights_seen", kept=False)
def lights_seen(
    geometry: Geometry, point: Array, point_normal: Array, triangle_id: Array, pixel: Array, face_normal: Array,
    light_position: Array, light_normal: Array,
) -> Array:
    """Trace whether light reaches each subsplat from each pixel light (SII Eq. 2 with V).

    point (3, n): The subsplats, m.
    point_normal (3, n): Their unit normals.
    face_normal (3, n): Normals of the subsplats' faces.
    -> (light, subsplat) bool: True where the subsplat's point, its normal and its face look at the light, it at them,
        and nothing lies between.
    """
    tracer = Tracer(geometry)
    to, _, reach, rays = shadow_rays(geometry, tracer.grain, (point, point_normal, triangle_id.reshape(-1)[pixel]),
                                     face_normal, light_position, light_normal)
    blocked = np.ones(len(reach), np.bool_)
    tracer.fill_occluded(*rays, reach, blocked)
    return np.ascontiguousarray(~blocked.reshape(len(to.pixel), -1).T)


@stage("multires.seen_irradiance", kept=False)
def seen_irradiance(
    point: Array, point_normal: Array, seen: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None,
) -> Array:
    """Sum the irradiance of the lights that each subsplat sees, without albedo/pi (AMS Eq. 2 with V; E-AMS-02).

    point (3, n): The subsplats, m.
    point_normal (3, n): Their unit normals.
    seen (light, n) bool: Which lights reach which.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    at, up = (np.ascontiguousarray(one, np.float32) for one in (point, point_normal))
    count, total = flux.shape[1], np.zeros((3, point.shape[1]))
    lights = PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, count)
    given = filled_rays(RayReceivers(np.arange(at.shape[1]), at, up, up, at), senders_of(lights), 1.0)[3]
    add_unoccluded(total, 0, at.shape[1], count, np.ascontiguousarray(~seen.T).reshape(-1), given)
    return total.astype(point.dtype)


def visible_steps(
    tracer: Tracer, geometry: Geometry, buffer: "GBuffer", subsplats: Subsplats, lights: PixelLights
) -> Array:
    """Return the light that reaches subsplats, made by steps."""
    del tracer  # of the same triangles
    ids, pixel = buffer.triangle_id, subsplats.pixel
    point, normal = points(buffer.position, buffer.normal, buffer.covered, *subsplats[:4], "pixel")
    facing = subsplat_facing(geometry.vertices, geometry.faces, normal, ids, pixel)
    blockers = dataclasses.replace(geometry, vertex_normals=None, colours=None)
    seen = lights_seen(blockers, point, normal, ids, pixel, facing, lights.position, lights.normal)
    return seen_irradiance(point, normal, seen, *arrays_of(lights))


@stage("multires.one_row", kept=False)
def one_row(position: Array, normal: Array, triangle_id: Array, pixel: Array) -> tuple[Array, Array, Array]:
    """Take the pixels of subsplats for a picture of one row (AMS Sec. 3.4; E-AMS-11).

    -> position (xyz, row, subsplat): Surface point, m.
    -> normal (xyz, row, subsplat): Its unit normal.
    -> triangle_id (row, subsplat) int32: Triangle that it lies on.
    """
    return (taken(position, pixel)[:, None], taken(normal, pixel)[:, None],
            np.ascontiguousarray(triangle_id.reshape(-1)[None, pixel]))


@stage("multires.of_row", kept=False)
def of_row(irradiance: Array) -> Array:
    """Return the light of a picture of one row to the list of subsplats (AMS Sec. 3.4).

    irradiance (3, 1, n): Irradiance of the row, W/m^2.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    return np.ascontiguousarray(irradiance[:, 0])


def shadowed_steps(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", settings: "ValSettings",
    footprint: Array | None = None,
) -> Array:
    """Return the light at subsplats under soft shadows, made by steps."""
    for extent in ("visible_extent", "illuminated_extent"):
        vars(frame).pop(extent, None)  # found anew, as steps of their own
    areas, maps = cluster_lights(frame, lights, settings)
    reference = reference_visibility(frame, lights, areas, maps, settings)
    position, normal, ids = one_row(buffer.position, buffer.normal, buffer.triangle_id, subsplats.pixel)
    facing = facing_normals(frame.scene.geometry, ids, normal)
    row = Receivers(position, normal, np.ones(ids.shape, np.bool_))
    return of_row(clustered_irradiance(row, facing, lights, areas, maps, settings, footprint, reference,
                                       rays=frame.tracer if settings.maps.behind == "raytrace" else None))
