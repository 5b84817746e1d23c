"""The rasterizer against Embree's rays through the same texels and against llvmpipe, and how its cost grows.

`run`: Embree traces with one thread, as one `EmbreeScene.run(output=True)` call does, over a prebuilt hierarchy; the
rasterizer starts from the triangles each time and runs on all threads. The batch of depth maps is compared with
`run` in its default mode, over rays made beforehand.

Packets of coherent rays (`embree_packets`) and OpenGL in software (`llvmpipe`, where moderngl is installed) run on all
threads as well. Scenes are `stage`, whose vase has interpolated vertex normals, and `atrium`, which has none. Pairs are
interleaved; a ratio is the median over pairs, with the least and the greatest in the note.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks import llvmpipe
from benchmarks.embree_packets import Packets
from benchmarks.harness import Ratio, Row, ratio, seconds
from refgi.rsm import camera_projection, gbuffer, paraboloid_depth_maps, rasterize
from refgi.rsm.raster.projection import Projection, paraboloid_projection
from refgi.scene import Geometry, load_scene, material_table

CHANNELS = ("depth", "position", "normal", "albedo", "material_id", "triangle_id")
TARGETS = ("depth", "position", "normal", "albedo")  # what a deferred renderer on a graphics card writes
SIZE = 1024


def rows(quick: bool) -> Iterator[Row]:
    """Yield ratios to Embree, and time per triangle and per pixel."""
    yield from _against_embree("atrium:faces=100000", 5 if quick else 15)
    for faces in (100_000,) if quick else (10_000, 100_000, 400_000):
        for name in ("stage", "atrium"):
            yield from _against_packets(f"{name}:faces={faces}", 5 if quick else 15)
    yield from _depth_maps(3 if quick else 9)
    yield from _growth((10_000, 100_000) if quick else (10_000, 100_000, 1_000_000, 10_000_000))


def _against_embree(name: str, repeats: int) -> Iterator[Row]:
    scene = load_scene(name)
    materials = material_table(scene.materials, np.float32)
    projection = camera_projection(scene.camera, 1024, 1024)
    trace = _tracer(scene.geometry, *_pixel_rays(projection))

    def whole() -> Any:
        return gbuffer(scene.geometry, materials, scene.camera, 1024, 1024).resolve(*CHANNELS)

    for label, function, aim in (("full G-buffer", whole, "<= 0.15"),
                                 ("visibility", lambda: rasterize(scene.geometry, projection), "<= 0.08")):  # fmt: skip
        measured = ratio(function, trace, repeats)
        note = f"{1e3 * measured.seconds_a:.1f} ms against {1e3 * measured.seconds_b:.0f} ms"
        yield Row(f"{label} 1024^2, {name} / Embree", measured.median, "", aim, note)


def _against_packets(name: str, repeats: int) -> Iterator[Row]:
    """Time visibility and the whole G-buffer over Embree's packets, and over a G-buffer of OpenGL in software."""
    scene = load_scene(name)
    materials, shape = material_table(scene.materials, np.float32), scene.geometry
    projection = camera_projection(scene.camera, SIZE, SIZE)
    packets = Packets(shape, projection)

    def visibility() -> Any:
        return rasterize(shape, projection)

    def whole() -> Any:
        return gbuffer(shape, materials, scene.camera, SIZE, SIZE).resolve(*TARGETS)

    for label, function in (("visibility", visibility), ("G-buffer", whole)):
        measured = ratio(function, packets.trace, repeats)
        aim = "<= 0.5" if label == "visibility" else ""
        yield Row(f"{label} {SIZE}^2, {name} / Embree packets", measured.median, "", aim, _spread(measured))
    missing = llvmpipe.available()
    if missing:
        yield Row(f"G-buffer {SIZE}^2, {name} / llvmpipe", math.nan, "", "", f"skipped: {missing}")
        return
    pipe = llvmpipe.Pipe(scene, SIZE)
    measured = ratio(whole, pipe.draw, repeats)
    yield Row(f"G-buffer {SIZE}^2, {name} / llvmpipe, read back", measured.median, "", "<= 0.3", _spread(measured))


def _spread(measured: Ratio) -> str:
    return (f"{measured.low:.2f} .. {measured.high:.2f}; {1e3 * measured.seconds_a:.1f} ms against "
            f"{1e3 * measured.seconds_b:.1f} ms")


def _depth_maps(repeats: int) -> Iterator[Row]:
    shape = load_scene("cornell_sphere:faces=17000").geometry
    rng = np.random.default_rng(1)
    low, high = shape.bounds
    centers, axes = low + (high - low) * rng.uniform(0.2, 0.8, (30, 3)), rng.normal(size=(30, 3))
    projection = paraboloid_projection(centers, axes, 256)
    trace = _tracer(shape, *_disc_rays(projection))
    measured = ratio(lambda: paraboloid_depth_maps(shape, centers, axes, 256), trace, repeats)
    note = f"{1e3 * measured.seconds_a:.1f} ms against {1e3 * measured.seconds_b:.0f} ms"
    yield Row(f"30 paraboloid maps 256^2, {len(shape.faces)} faces / Embree", measured.median, "", "<= 0.1", note)


def _growth(counts: tuple[int, ...]) -> Iterator[Row]:
    """Time ten times the triangles, and sixteen times the pixels: linear growth is 10 and 16."""
    before = 0.0
    for count in counts:
        scene = load_scene(f"atrium:faces={count}")
        time = {}
        for size in (256, 1024):
            projection = camera_projection(scene.camera, size, size)
            time[size] = seconds(lambda view=projection, of=scene.geometry: rasterize(of, view), 5)
        faces = len(scene.geometry.faces)
        note = f"{1e3 * time[1024]:.1f} ms, {1e9 * time[1024] / faces:.0f} ns a triangle"
        yield Row(f"visibility {faces} faces: 1024^2 / 256^2", time[1024] / time[256], "", "<= 16", note)
        if before:
            yield Row(f"visibility 1024^2: {faces} faces / a tenth of them", time[1024] / before, "", "<= 10")
        before = time[1024]


def _tracer(shape: Geometry, origins: Any, directions: Any) -> Callable[[], Any]:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, shape.vertices.astype(np.float32), np.ascontiguousarray(shape.faces))
    origins, directions = (np.ascontiguousarray(array, np.float32) for array in (origins, directions))
    return lambda: scene.run(origins, directions, output=True)


def _pixel_rays(view: Projection) -> tuple[Any, Any]:
    row, column = np.mgrid[: view.height, : view.width] + 0.5
    x = view.half[0] * (2 * column / view.width - 1)
    y = view.half[1] * (2 * row / view.height - 1)
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ view.frame[0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(view.origin[0], directions.shape), directions


def _disc_rays(view: Projection) -> tuple[Any, Any]:
    """Return a ray for every texel inside the disc of every map."""
    s, t = np.meshgrid(*[(2 * np.arange(view.width) + 1) / view.width - 1] * 2)
    square = s * s + t * t
    local = (np.stack([2 * s, 2 * t, 1 - square], axis=-1) / (1 + square)[..., None])[square <= 1]
    directions = np.concatenate([local @ frame for frame in view.frame])
    return np.repeat(view.origin, len(local), axis=0), directions


if __name__ == "__main__":
    for line in rows(math.inf < 0):
        print(f"{line.name}: {line.value:.3g} {line.unit} (aim {line.aim}) {line.note}")
