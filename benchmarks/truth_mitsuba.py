"""Truth beside Mitsuba 3: time to relMSE 1e-2 of one-bounce irradiance at the same receivers, in turn.

REFGI_MITSUBA names a Python that has Mitsuba (`pip install mitsuba`, an environment of its own; its LLVM mode needs
libllvm 19, named by DRJIT_LIBLLVM_PATH), REFGI_DATA the folder of real scenes. Without the first, this is one line.
The quantity is that of docs/truth.md: rays start at refgi's receivers, lifted by its offsets; a lobe is refgi's formula
in a kernel written for it. Samples are doubled until a run has the aim or takes SECONDS; each round then times a run of
the truth and one of each of Mitsuba's ways in turn. relMSE as in `truth_glossy`; from a run to the aim it falls as
1 / N. The reference is the oracle of glossy scenes, each pixel REPEAT x REPEAT times; else a long run of the truth,
whose own stated variance is taken out of what both are off by. A row's note says how far means of the picture are off.
"""

import dataclasses
import os
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import betainc

from benchmarks.harness import Row, real_scene
from benchmarks.truth_glossy import TARGET, View, relative_mse, repeated, settings_for, timed, view_of, weights
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.pairs.shadow_rays import receivers
from refgi.radiometry import POINT
from refgi.scene import Scene, light_table, load_scene
from refgi.scene.light import BEND
from refgi.truth import TruthSettings
from refgi.types import Array
from tests.truth.glossy_scenes import SCENES, frame, reference

DIFFUSE = ("buddha", "horse", "kitchen", "cornell_box", "sponza", "quake_e1m1")
FILES = {"horse": "cornell_horse"}
SIZE, QUICK_SIZE = (256, 192), (64, 48)
SECONDS, QUICK_SECONDS = 10.0, 1.0  # the longest run of either
ROUNDS, QUICK_ROUNDS = 5, 2
LONGER = 12  # times such a run: the reference where there is no oracle
REPEAT, QUICK_REPEAT = 8, 3  # of the glossy scenes' pixels: 192 x 144 of them
SHARES = 4097  # cosines from -1 to 1 at which K(theta, P) is tabulated
WAYS = ("sobol", "cosine", "light")


class Score(NamedTuple):
    seconds: float
    relative_mse: float  # without the reference's noise
    mean: float  # of the picture


class Worker:
    """Mitsuba in a process of its own, with one scene."""

    def __init__(self, python: str, view: View, folder: Path) -> None:
        self.folder, self.seed = folder, 0
        np.savez(folder / "scene.npz", **described(view))
        self.process = subprocess.Popen([python, str(Path(__file__).with_name("mitsuba_worker.py")),
                                         str(folder / "scene.npz")], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True)
        self.says = self._answer()

    def run(self, way: str, samples: int) -> tuple[float, Array]:
        """Return seconds and irradiance (3, n)."""
        self.seed += 1
        assert self.process.stdin is not None
        self.process.stdin.write(f"{way} {samples} {self.seed} {self.folder / 'found.npy'}\n")
        self.process.stdin.flush()
        return float(self._answer()), np.load(self.folder / "found.npy")

    def close(self) -> None:
        self.process.communicate()

    def _answer(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"Mitsuba's process ended with {self.process.wait()}; its error is above")
        return line.strip()


def described(view: View) -> dict[str, Any]:
    """Return what the worker needs of a scene and its receivers."""
    scene, geometry, lamps = view.scene, view.scene.geometry, light_table(view.scene.lights)
    to = receivers(geometry, *view[2:], view.tracer.grain)
    spots = [getattr(lamp, "inner_half_angle", 0.0) for lamp in scene.lights]
    wide = [getattr(lamp, "outer_half_angle", 0.0) for lamp in scene.lights]
    opaque = np.array([not m.is_dielectric for m in scene.materials])[:, None]
    exponent = np.array([m.exponent for m in scene.materials])
    cosine = np.linspace(-1, 1, SHARES)
    half = betainc((exponent[:, None] + 1) / 2, 0.5, 1 - cosine**2) / 2
    middle = np.mean(geometry.bounds, axis=0)
    return {"vertices": geometry.vertices, "faces": geometry.faces, "material_of_face": geometry.material_of_face,
            "vertex_normals": np.zeros((0, 3)) if geometry.vertex_normals is None else geometry.vertex_normals,
            "diffuse": np.array([m.diffuse for m in scene.materials]) * opaque,
            "specular": np.array([m.specular for m in scene.materials]) * opaque, "exponent": exponent,
            "share": np.where(cosine >= 0, 1 - half, half), "kind": lamps.kind, "position": lamps.position,
            "direction": lamps.direction, "intensity": lamps.intensity, "cos_inner": np.cos(spots),
            "cos_outer": np.cos(wide), "shape": lamps.cone[:, BEND:], "middle": middle,
            "radius": geometry.diagonal / 2 * 1.001,
            "origin": to.origin, "normal": to.normal, "facing": to.facing, "methods": np.array(ways_of(view.scene))}


def ways_of(scene: Scene) -> list[str]:
    """Return which ways of Mitsuba can do a scene: its own integrator knows point lamps, its BSDFs no such lobe."""
    own = all(lamp == POINT for lamp in light_table(scene.lights).kind)
    return [*WAYS, *(["path"] if own and not any(any(m.specular) for m in scene.materials) else [])]


def rows(quick: bool) -> Iterator[Row]:
    python = os.environ.get("REFGI_MITSUBA", "")
    if not python or subprocess.run([python, "-c", "import mitsuba"], capture_output=True, check=False).returncode:
        yield Row("left out: REFGI_MITSUBA names no Python that has Mitsuba", 0.0, "")
        return
    warnings.simplefilter("ignore", RefgiWarning)
    width, height = QUICK_SIZE if quick else SIZE
    for name in DIFFUSE:
        if file := real_scene(FILES.get(name, name)):
            scene = load_scene(file)
            yield from compared(python, name, view_of(Frame(scene, width=width, height=height)), None, quick)
    times = QUICK_REPEAT if quick else REPEAT
    for name in SCENES:
        yield from compared(python, name, view_of(frame(name), times), repeated(reference(name), times), quick)


def compared(python: str, name: str, view: View, oracle: Array | None, quick: bool) -> Iterator[Row]:
    seconds, rounds = (QUICK_SECONDS, QUICK_ROUNDS) if quick else (SECONDS, ROUNDS)
    seen = view.seen
    expected, noise = (oracle, 0.0) if oracle is not None else long_run(view, settings_for(view, seconds), seen)
    with tempfile.TemporaryDirectory() as folder:
        worker = Worker(python, view, Path(folder))

        def run(way: str, samples: int, seed: int) -> Score:
            if way == "truth":
                took, result = timed(view, TruthSettings(samples=samples, seed=seed))
                picture = result.mean
            else:
                took, values = worker.run(way, samples)
                picture = np.zeros_like(expected)
                picture[:, seen] = values
            return Score(took, relative_mse(picture, expected, seen) - noise, float(picture[:, seen].mean()))

        samples = {way: samples_for(partial(run, way), seconds) for way in ("truth", *ways_of(view.scene))}
        found: dict[str, list[Score]] = {way: [] for way in samples}
        for number in range(rounds):
            for way, count in samples.items():
                found[way].append(run(way, count, 1 + number))
        worker.close()
    needed = {way: time_needed(runs) for way, runs in found.items()}
    for way, runs in found.items():
        off = np.mean([one.mean for one in runs]) / expected[:, seen].mean() - 1
        note = (f"{samples[way]} samples in {np.median([one.seconds for one in runs]):.2f} s have "
                f"{np.mean([one.relative_mse for one in runs]):.2g}; mean off by {off:+.2%}")
        yield Row(f"{name}: time to relMSE {TARGET:g}, {'refgi' if way == 'truth' else 'Mitsuba ' + way}", needed[way],
                  "s", "", note)
    best = min(samples.keys() - {"truth"}, key=lambda way: needed[way])
    yield Row(f"{name}: Mitsuba's best over refgi", needed[best] / needed["truth"], "ratio", ">= 1",
              f"{best}; {worker.says}")


def samples_for(run: Callable[[int, int], Score], seconds: float) -> int:
    """Return how many samples, doubled time after time, reach the aim or take that long."""
    samples = 1
    while True:
        found = run(samples, 9_999)
        if found.relative_mse <= TARGET or found.seconds >= seconds:
            return samples
        samples *= 2


def time_needed(runs: list[Score]) -> float:
    """Return seconds to the aim: errors fall as 1 / N from a run to it, and never below the shortest run's time."""
    took, error = (float(np.mean([getattr(one, key) for one in runs])) for key in ("seconds", "relative_mse"))
    return took * max(error / TARGET, 0.5)


def long_run(view: View, settings: TruthSettings, seen: Array) -> tuple[Array, float]:
    """Return a reference by the truth, and the relMSE that its own stated variance makes."""
    found = timed(view, dataclasses.replace(settings, samples=LONGER * settings.samples, seed=10_001))[1]
    return found.mean, float((found.variance_of_mean * weights(found.mean, seen)).sum() / (3 * seen.sum()))
