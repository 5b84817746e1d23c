"""Cost and error over the number of lights, 256 to 1e6: lightcuts beside the full sum of the same lights.

The full sum of many lights is timed and compared at some whole tiles of pixels, spread over the picture, and scaled to
all; lightcuts run at every pixel. Times are processor time of all threads, without the choice of lights.
"""

import statistics
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from benchmarks.harness import Row, in_turn, real_scene, relative_rmse
from refgi import Frame, load_scene
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import add_lights
from refgi.pairs.pair_sum import TILE
from refgi.pairs.pixel_lights import Packed, Unpacked
from refgi.pairs.pixel_lights import clustered as with_clusters
from refgi.pairs.tiles import block_by_block, taken
from refgi.settings import of
from refgi.splat import SiiSettings

SCENES = ("cornell_box", "stage", "ring", "metaballs", "sponza", "kitchen")
COUNTS = tuple(16**power for power in range(2, 6))
TILES = 12  # of the full sum
ERRORS = (0.02, 0.1)


def rows(quick: bool) -> Iterator[Row]:
    size, repeats = (128, 2) if quick else (512, 3)
    for name in SCENES[:2] if quick else SCENES:
        path = real_scene(name)
        if path is None and name in ("sponza", "kitchen"):
            continue
        frame = Frame(load_scene(path or name), width=size, height=size, rsm_resolution=1024)
        for count in COUNTS[:2] if quick else COUNTS:
            yield from _of_count(name, frame, count, repeats)


def _of_count(name: str, frame: Frame, count: int, repeats: int) -> Iterator[Row]:
    settings = of(SiiSettings, lights=count)
    lights, pairs = choose_lights(frame, settings.lights), settings.effective_pairs
    area = footprints(frame, settings.lights, pairs)
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    places = block_by_block(covered)
    points, normals = taken(position, places), taken(normal, places)
    unpacked = Unpacked(lights._replace(lobe_flux=None), pairs, area, points.dtype)  # lobes take as long either way
    packed = unpacked.packed
    number = packed.diffuse.shape[1] - 1
    if number == 0:
        return
    tiles = np.linspace(0, len(places) // TILE - 1, TILES).astype(np.int64) * TILE
    some = (tiles[:, None] + np.arange(TILE)).reshape(-1)
    here, facing = np.ascontiguousarray(points[:, some]), np.ascontiguousarray(normals[:, some])
    share = len(places) / len(some)
    for error in ERRORS if count == COUNTS[-1] else ERRORS[:1]:
        full = partial(_sums, here, facing, packed)

        def clustered(error: float = error) -> Any:
            return _sums(points, normals, with_clusters(unpacked, error))

        of_full, of_cuts = in_turn({"full": full, "cuts": clustered}, repeats, time.process_time).values()
        expected, got = full(), clustered()
        off = got[:, some].astype(np.float64) - expected
        total = expected.sum(axis=0, dtype=np.float64)
        worst = float((np.abs(off).sum(axis=0)[total > 0] / total[total > 0]).max(initial=0.0))
        rmse = relative_rmse(got[:, some], expected)
        whole, taken_by_cuts = share * statistics.median(of_full), statistics.median(of_cuts)
        equal = taken_by_cuts / (whole / number)
        note = (f"N {number}, full {whole:.3f} s ({min(of_full) * share:.3f} to {max(of_full) * share:.3f}), "
                f"RMSE {rmse:.2e}, worst {worst:.2e}, as {equal:.0f} lights in full")
        yield Row(f"{name}, {count}, error {error:g}: time", taken_by_cuts, "s", "",
                  f"{min(of_cuts):.3f} to {max(of_cuts):.3f}; {note}")
        if count == COUNTS[-1]:
            yield Row(f"{name}, {count}, error {error:g}: as many lights in full", equal, "lights", "<= 3000")


def _sums(points: Any, normals: Any, packed: Packed) -> Any:
    sums = np.zeros_like(points)
    add_lights(points, normals, packed, sums)
    return sums
