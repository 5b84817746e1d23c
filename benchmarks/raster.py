"""The rasterizer against Embree's packets of rays through the same pixels and against llvmpipe.

Packets of coherent rays (`embree_packets`, over a prebuilt hierarchy) and OpenGL in software (`llvmpipe`, where
moderngl is installed) run on all threads, as the rasterizer does, which starts from the triangles each time. Scenes are
`stage`, whose vase has interpolated vertex normals, and `atrium`, which has none. Pairs are interleaved; a ratio is the
median over pairs, with the least and the greatest in the note.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import llvmpipe
from benchmarks.embree_packets import Packets
from benchmarks.harness import Ratio, Row, ratio
from refgi.rsm import camera_projection, gbuffer, rasterize
from refgi.scene import load_scene, material_table

TARGETS = ("depth", "position", "normal", "albedo")  # what a deferred renderer on a graphics card writes
SIZE = 1024


def rows(quick: bool) -> Iterator[Row]:
    for faces in (100_000,) if quick else (10_000, 100_000, 400_000):
        for name in ("stage", "atrium"):
            yield from _against_packets(f"{name}:faces={faces}", 5 if quick else 15)


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
