"""Cost and error over the number of lights, 256 to 1e6: lightcuts beside the full sum of the same lights.

The full sum of many lights is timed and compared at some whole tiles of pixels, spread over the picture, and scaled to
all; lightcuts run at every pixel. Times are processor time of all threads, without the choice of lights.
`python -m benchmarks.lights DIR` draws the figures of --out, log over log.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.harness import Row, real_scene
from refgi import Frame, load_scene
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import add_lights
from refgi.pairs.packing import Packed, pack, with_tree
from refgi.pairs.pair_sum import TILE
from refgi.pairs.settings import Lightcuts
from refgi.pairs.tiles import block_by_block, taken
from refgi.settings import of
from refgi.splat import SiiSettings

SCENES = ("cornell_box", "stage", "ring", "metaballs", "sponza", "kitchen")
COUNTS = tuple(16**power for power in range(2, 6))
TILES = 12  # of the full sum
ERRORS = (0.02, 0.1)


class Cost(NamedTuple):
    """Processor time, s: median, least and most."""

    median: float
    low: float
    high: float


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
    packed = pack(lights._replace(lobe_flux=None), pairs, area, points.dtype)  # lobes take as long either way
    number = packed.diffuse.shape[1] - 1
    if number == 0:
        return
    tiles = np.linspace(0, len(places) // TILE - 1, TILES).astype(np.int64) * TILE
    some = (tiles[:, None] + np.arange(TILE)).reshape(-1)
    here, facing = np.ascontiguousarray(points[:, some]), np.ascontiguousarray(normals[:, some])
    share = len(places) / len(some)
    for error in ERRORS if count == COUNTS[-1] else ERRORS[:1]:
        def clustered(error: float = error) -> Any:
            return _sums(points, normals, with_tree(packed, Lightcuts(error)))

        def full() -> Any:
            return _sums(here, facing, packed)

        if count == COUNTS[0]:
            clustered()  # compiles
        (of_full, expected), (of_cuts, got) = _in_turn(full, clustered, repeats)
        off = got[:, some].astype(np.float64) - expected
        total = expected.sum(axis=0, dtype=np.float64)
        worst = float((np.abs(off).sum(axis=0)[total > 0] / total[total > 0]).max(initial=0.0))
        rmse = float(np.sqrt((off**2).mean()) / expected.mean(dtype=np.float64))
        equal = of_cuts.median / (of_full.median * share / number)
        note = (f"N {number}, full {of_full.median * share:.3f} s ({of_full.low * share:.3f} to "
                f"{of_full.high * share:.3f}), RMSE {rmse:.2e}, worst {worst:.2e}, as {equal:.0f} lights in full")
        yield Row(f"{name}, {count}, error {error:g}: time", of_cuts.median, "s", "",
                  f"{of_cuts.low:.3f} to {of_cuts.high:.3f}; {note}")
        if count == COUNTS[-1]:
            yield Row(f"{name}, {count}, error {error:g}: as many lights in full", equal, "lights", "<= 3000")


def _sums(points: Any, normals: Any, packed: Packed) -> Any:
    sums = np.zeros_like(points)
    add_lights(points, normals, packed, sums)
    return sums


def _in_turn(a: Callable[[], Any], b: Callable[[], Any], repeats: int) -> list[tuple[Cost, Any]]:
    """Run A and B in turn and return their times and results."""
    times: list[list[float]] = [[], []]
    results: list[Any] = [None, None]
    for _ in range(repeats):
        for k, run in enumerate((a, b)):
            before = time.process_time()
            results[k] = run()
            times[k].append(time.process_time() - before)
    return [(Cost(statistics.median(one), min(one), max(one)), result)
            for one, result in zip(times, results, strict=True)]


def draw(folder: Path) -> Path:
    """Draw time over the number of lights from a folder's results.json; return the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = json.loads((folder / "results.json").read_text())
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5))
    for row in found["results"]["lights"]:
        name, _, what = row["name"].partition(": ")
        if what != "time":
            continue
        scene, count, error = (part.strip() for part in name.split(","))
        full = float(row["note"].split("full ")[1].split(" s")[0])
        rmse = float(row["note"].split("RMSE ")[1].split(",")[0])
        color = f"C{SCENES.index(scene)}"
        if error.endswith("0.02"):
            axes[0].loglog(int(count), full, "x", color=color)
            axes[0].loglog(int(count), row["value"], "o", color=color)
            axes[1].loglog(int(count), max(rmse, 1e-8), "o", color=color, label=scene if int(count) == 256 else None)
    axes[0].set(xlabel="lights asked for", ylabel="processor time, s", title="x full sum, o lightcuts of 2 %")
    axes[1].set(xlabel="lights asked for", ylabel="RMSE over the mean", title="lightcuts of 2 %")
    axes[1].legend()
    figure.tight_layout()
    path = folder / "lights.png"
    figure.savefig(path, dpi=110)
    return path


if __name__ == "__main__":
    print(draw(Path(sys.argv[1])))
