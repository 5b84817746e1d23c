"""How cost grows: processor time of whole frames over lights, pixels and triangles, log over log.

Each sweep changes one number of a frame of the atrium and leaves the others; a method's sweep ends where a frame takes
more than `LONGEST`. Times are processor time of all threads, from geometry to radiance, acceleration structures
included; medians of three frames, or one of those that take long, after a first that is not counted.
A last sweep sets a busy process beside frames: those of all threads shall not be slower than those of one.
`python -m benchmarks.scaling DIR PICTURE` draws the figures of --out.
"""

import json
import math
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.harness import Row, ratio
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.jit import most_threads, threads
from refgi.methods import find_method, usual_shadows
from refgi.scene import Scene, load_scene
from refgi.settings import of

LONGEST, LONG = 25.0, 3.0  # s of processor time: the last frame of a sweep; from which on one frame is enough
FACES, SIDE, LIGHTS = 100_000, 256, 256  # of what does not change
OF_LIGHTS = ("sii", "multires", "val", "vpl")  # `gather` and `hssil` have samples, `truth` has passes
OF_SIZE = ("sii", "multires", "val", "hssil", "gather", "vpl", "truth")
SWEEPS = {
    "lights": tuple(4**power for power in range(4, 11)),
    "pixels": tuple(4**power for power in range(8, 13)),
    "triangles": tuple(10**power for power in range(4, 8)),
}
QUICK = {"lights": (256, 1024), "pixels": (64**2, 128**2), "triangles": (10_000, 30_000)}


def rows(quick: bool) -> Iterator[Row]:
    sweeps = QUICK if quick else SWEEPS
    scenes: dict[int, Scene] = {}
    for sweep, values in sweeps.items():
        for name in OF_LIGHTS if sweep == "lights" else OF_SIZE:
            before: tuple[int, float] | None = None
            for value in values:
                faces = value if sweep == "triangles" else FACES
                if faces not in scenes:
                    scenes = {faces: load_scene(f"atrium:faces={faces}")}  # one at a time: the largest takes 1 GB
                side = math.isqrt(value) if sweep == "pixels" else SIDE
                found = _cost(scenes[faces], name, side, value if sweep == "lights" else LIGHTS)
                growth = "" if before is None else f"exponent {_exponent(before, (value, found)):.2f}"
                yield Row(f"{sweep}: {name}, {value}", found, "s", "", growth)
                before = value, found
                if found > LONGEST:
                    break
    yield from _beside_a_neighbour(quick)


def _beside_a_neighbour(quick: bool) -> Iterator[Row]:
    scene = load_scene("atrium:faces=10000")
    side = SIDE // 2 if quick else 2 * SIDE
    for name in ("sii", "multires"):
        method = find_method(name)

        def frame(count: int, method: Any = method) -> None:
            with threads(count):
                view = Frame(scene, width=side, height=side)
                view.radiance(method.compute(view, method.settings())[0])

        frame(1)
        with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as neighbour:
            try:
                found = ratio(lambda: frame(most_threads()), lambda: frame(1))
            finally:
                neighbour.kill()
        yield Row(f"beside a busy process: {name}, all threads over one", found.median, "", "<= 1.1",
                  f"{found.low:.2f} to {found.high:.2f}")


def _cost(scene: Scene, name: str, side: int, lights: int) -> float:
    """Return the processor time of a frame by a method, s: not of the first one, which may compile or bound a scene."""
    method = find_method(name)
    settings = of(method.settings, **_settings(name, lights))

    def frame() -> float:
        started = time.process_time()
        view = Frame(scene, width=side, height=side, shadows=usual_shadows(settings))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RefgiWarning)
            view.radiance(method.compute(view, settings)[0])
        return time.process_time() - started

    first = frame()
    if first > LONGEST:
        return first
    return frame() if first > LONG else statistics.median([frame(), frame(), frame()])


def _settings(name: str, lights: int) -> dict[str, Any]:
    try:
        of(find_method(name).settings, lights=lights)
    except InputError:
        return {"samples": 32} if name == "truth" else {}
    return {"lights": lights}


def _exponent(before: tuple[int, float], now: tuple[int, float]) -> float:
    """Return the slope of the last step, log over log: 1 where time grows as what changed."""
    return math.log(now[1] / before[1]) / math.log(now[0] / before[0])


def draw(folder: Path, path: Path) -> Path:
    """Draw the sweeps of a folder's results.json; return the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = json.loads((folder / "results.json").read_text())["results"]["scaling"]
    figure, axes = plt.subplots(1, len(SWEEPS), figsize=(12, 4), sharey=True, layout="constrained")
    for axis, sweep in zip(axes, SWEEPS, strict=True):
        for number, name in enumerate(OF_SIZE):
            points = [(int(row["name"].rpartition(", ")[2]), row["value"]) for row in found
                      if row["name"].startswith(f"{sweep}: {name},")]
            if points:
                axis.loglog(*zip(*points, strict=True), "o-", color=f"C{number}", label=name, markersize=3)
        axis.set(xlabel=sweep)
        axis.grid(alpha=0.3)
    axes[0].set(ylabel="processor time of a frame, s")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside right center")
    figure.savefig(path)
    return path


if __name__ == "__main__":
    print(draw(Path(sys.argv[1]), Path(sys.argv[2])))
