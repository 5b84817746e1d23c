"""Paraboloid depth maps of area lights against Embree's rays through the same texels, and what leaving out saves.

Embree traces over a hierarchy built beforehand, rays made beforehand: one thread is one `EmbreeScene.run` in its
default mode, all threads are the project's own backend of Embree in its robust mode. The maps start from the scene's
triangles each time.
"""

from collections.abc import Iterator
from itertools import count

import numba
import numpy as np

from benchmarks.harness import Row, ratio, seconds
from benchmarks.raster import _disc_rays, _tracer
from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.maps import shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.jit import threads
from refgi.rays import Tracer
from refgi.rsm import paraboloid_depth_maps
from refgi.rsm.raster.projection import paraboloid_projection
from refgi.scene import Geometry, load_scene
from refgi.settings import of
from refgi.stages import Memory, observe

MAPS = 30


def rows(quick: bool) -> Iterator[Row]:
    repeats = 5 if quick else 15
    shape = load_scene("cornell_sphere:faces=17000").geometry
    areas = _areas(shape)
    yield from _against_embree(shape, areas, repeats)
    yield from _left_out(shape, areas, repeats)


def _against_embree(shape: Geometry, areas: AreaLights, repeats: int) -> Iterator[Row]:
    centers, axes = areas.center.T, areas.normal.T
    origins, directions = (np.ascontiguousarray(rays, np.float32)
                           for rays in _disc_rays(paraboloid_projection(centers, axes, 256)))  # fmt: skip
    tracer, reach = Tracer(shape), np.full(len(origins), np.inf, np.float32)
    found, distance = np.empty(len(origins), np.int32), np.empty(len(origins), np.float32)

    def by_all_threads() -> None:
        tracer.fill_closest(origins, directions, reach, found, distance)

    run = _tracer(shape, origins, directions)
    cores = numba.get_num_threads()
    for label, workers, traced in ((f"{cores} threads / Embree, {cores} threads", cores, by_all_threads),
                                 (f"{cores} threads / Embree's run, 1 thread", cores, run),
                                 ("1 thread / Embree's run, 1 thread", 1, run)):  # fmt: skip
        with threads(workers):
            measured = ratio(lambda: paraboloid_depth_maps(shape, centers, axes, 256), traced, repeats)
        note = f"{1e3 * measured.seconds_a:.1f} ms against {1e3 * measured.seconds_b:.0f} ms"
        yield Row(f"{MAPS} maps 256^2, {len(shape.faces)} faces: {label}", measured.median, "", "<= 0.5", note)


def _left_out(shape: Geometry, areas: AreaLights, repeats: int) -> Iterator[Row]:
    memory, frames = Memory(), count()

    def draw(settings: ValSettings) -> None:
        moved = areas._replace(center=areas.center + 1e-9 * next(frames))  # new maps of the same triangles
        with observe(memory=memory):
            shadow_maps(shape, moved, settings.maps, np.float32)

    for rule in ("keep", "planes", "ball"):
        for alone in (False, True):
            settings = of(ValSettings, near_geometry=rule, occluders_alone=alone)
            maps = shadow_maps(shape, areas, settings.maps, np.float32)
            note = f"{len(maps.depth)} maps, {maps.left_out / MAPS:.0f} triangles a map left out"
            taken = seconds(lambda: draw(settings), repeats)  # noqa: B023
            yield Row(f"near_geometry {rule}, occluders alone {alone}", 1e3 * taken, "ms", "", note)


def _areas(shape: Geometry) -> AreaLights:
    """Return area lights of a tenth of the scene anywhere in it, looking anywhere."""
    rng = np.random.default_rng(1)
    low, high = shape.bounds
    center = low + (high - low) * rng.uniform(0.2, 0.8, (MAPS, 3))
    axis = rng.normal(size=(MAPS, 3))
    normal = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    frame, none = paraboloid_projection(center, normal, 1).frame, np.zeros((2, MAPS))
    return AreaLights(np.ascontiguousarray(center.T), np.ascontiguousarray(normal.T), frame, none,
                      np.ascontiguousarray(frame[:, :2]), none, np.zeros(MAPS), np.full(MAPS, 0.1 * shape.diagonal),
                      np.ones(MAPS, np.int64), np.arange(MAPS, dtype=np.int32))  # fmt: skip
