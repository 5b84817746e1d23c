"""What else a user of this machine could run: the GLSL port on a software GPU, plain Numba and C, beside refgi.

All read the arrays of a recorded stage and are held to its values. One thread each, processor time, in turn. Without
moderngl and OpenGL 4.5, or without a C compiler, those rows are left out.
"""

import ctypes
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numba import njit, prange

from benchmarks.harness import Row, in_turn, seconds_of
from refgi.cluster import ValSettings, val
from refgi.frame import Frame
from refgi.jit import threads
from refgi.methods import find_method
from refgi.scene import load_scene
from refgi.settings.text import from_text
from refgi.stages import observe
from refgi.types import Array
from refgi.vectors.recorded import recorded_case
from refgi.vectors.spec import Case, Stage, as_read, expected_of

GLSL = Path(__file__).parents[1] / "examples/ports/glsl"
AIMS = {"GLSL on llvmpipe": "<= 0.5", "plain Numba": "<= 0.2", "gcc -O3": "", "gcc -O3 -ffast-math": "<= 1.05"}
CROWN = "senders.downsample=closest senders.disc_share=1"  # the form that the ports have
FAR = 1e-3  # RMSE of a peer over the RMS of the stage's values that tells other work

C_SOURCE = r"""
#include <math.h>
void sum(long n, long m, const float *x, const float *nx, const float *y, const float *ny, const float *flux,
         const float *area, const unsigned char *covered, float *out) {
    for (long i = 0; i < n; i++) {
        if (!covered[i]) continue;
        float r = 0, g = 0, b = 0;
        for (long k = 0; k < m; k++) {
            float dx = x[i] - y[k], dy = x[n + i] - y[m + k], dz = x[2 * n + i] - y[2 * m + k];
            float square = dx * dx + dy * dy + dz * dz;
            float sent = dx * ny[k] + dy * ny[m + k] + dz * ny[2 * m + k];
            float received = -(dx * nx[i] + dy * nx[n + i] + dz * nx[2 * n + i]);
            float pi = 3.14159265f;
            float f = fmaxf(sent, 0) * fmaxf(received, 0) / (fmaxf(square, 1e-30f) * (pi * square + area[k]));
            r += f * flux[k]; g += f * flux[m + k]; b += f * flux[2 * m + k];
        }
        out[i] = r; out[n + i] = g; out[2 * n + i] = b;
    }
}
"""

Runs = dict[str, Callable[[], object]]


class Recorded:
    """The arrays of a recorded case, as the GLSL port asks a kit for them; what it writes is kept."""

    def __init__(self, case: Case, known: dict[str, Array]) -> None:
        self.facts, self.known, self.written = case.facts, known, dict[str, Array]()
        self.manifest = {"arrays": known}

    def __getitem__(self, name: str) -> Array:
        return self.known[name]

    def write(self, name: str, flat: Array) -> None:
        """Keep an output in its shape."""
        self.written[name] = flat[: self.known[name].size].reshape(self.known[name].shape)


def rows(quick: bool) -> Iterator[Row]:
    size = {"width": 128, "height": 96} if quick else {"width": 320, "height": 240}
    repeats = 5 if quick else 11
    for what, method, stage, words, peers, count in (
            ("Eq. 2, a pair", "sii", "pairs.sum", "lights=256" if quick else "lights=1024", _pair_peers, _pairs),
            ("HSS Eq. 4, a sample", "hssil", "sssil.gather_samples", CROWN, _crown_peers, _samples)):
        settings = from_text(find_method(method).settings(), words.split())
        case = recorded_case("peers", load_scene("cornell_box"), method, settings, only=stage, **size)
        known = expected_of(case)
        step = max(case.stages, key=lambda one: known[one.writes[0]].size)
        result = np.empty_like(known[step.writes[0]])
        work: Runs = {"refgi": partial(step.run, as_read(known, step.reads, np.float32), np.float32)}
        work |= peers([known[name] for name in step.reads], result)
        work |= _glsl(case, step, known)
        expect_same(work, step, known, result)
        with threads(1):
            yield from _compared(what, work, repeats, count(known, step))
    yield from _shadows(size, repeats)


def _shadows(size: dict[str, int], repeats: int) -> Iterator[Row]:
    """Compare convolution visibility: VAL's whole irradiance beside the GLSL port's means and visibility alone."""
    scene, settings = load_scene("cornell_box"), from_text(ValSettings(), ["visibility=csm"])
    case = recorded_case("peers", scene, "val", settings, only="cluster.", **size)
    known = expected_of(case)
    runs = [run for step in case.stages if step.name.rstrip("0123456789") in ("cluster.mip_means", "cluster.csm")
            for run in _glsl(case, step, known).values()]
    frame = Frame(scene, dtype=np.float32, **size)
    spent: list[list[float]] = []
    with threads(1):
        for _ in range(repeats + 1 if runs else 0):
            with observe() as log:
                val(frame, settings)
            own = sum(run.seconds for run in log.runs if run.name == "cluster.irradiance")
            spent.append([own, sum(map(seconds_of, runs))])  # on the clock, as stages are
    if spent:
        own, theirs = np.array(spent[1:]).T  # the first compiles
        yield _ratio("CSM, a frame", "GLSL on llvmpipe", own, theirs, 1e6, "ms")


def _compared(what: str, work: Runs, repeats: int, count: int) -> Iterator[Row]:
    spent = in_turn(work, repeats, time.process_time)
    own = spent.pop("refgi")
    yield Row(f"{what}: refgi", np.median(own) / count * 1e9, "ns")
    for name, times in spent.items():
        yield _ratio(what, name, own, times, count, "ns")


def _ratio(what: str, name: str, own: Sequence[float], times: Sequence[float], count: float, unit: str) -> Row:
    found = np.divide(own, times)
    return Row(f"{what}: refgi over {name}", float(np.median(found)), "ratio", AIMS[name],
               f"{found.min():.2f} to {found.max():.2f}; {np.median(times) / count * 1e9:.2f} {unit}")


def expect_same(work: Runs, step: Stage, known: dict[str, Array], result: Array) -> None:
    """Raise where a peer does other work; each leaves its values in `result` or returns them."""
    expected = known[step.writes[0]].astype(np.float64)
    for name, run in work.items():
        if name == "refgi":
            continue
        result.fill(0)
        made = run()
        off = np.sqrt(np.mean((np.asarray(result if made is None else made) - expected) ** 2) / np.mean(expected**2))
        if not off < FAR:
            raise AssertionError(f"{name}: off by {off:.3g} of the values of {step.name}")


def _pairs(known: dict[str, Array], step: Stage) -> int:
    covered, lights = known[step.reads[2]], known[step.reads[3]]
    return int(np.count_nonzero(covered)) * lights.shape[1]


def _samples(known: dict[str, Array], step: Stage) -> int:
    return known[step.reads[3]].size * known[step.reads[4]].shape[2]


@njit(parallel=True)
def sum_plainly(position, normal, covered, light_position, light_normal, flux, area, out):
    position, normal, covered = position.reshape(3, -1), normal.reshape(3, -1), covered.reshape(-1)
    for i in prange(covered.size):
        if not covered[i]:
            continue
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for k in range(area.size):
            dx, dy, dz = (position[0, i] - light_position[0, k], position[1, i] - light_position[1, k],
                          position[2, i] - light_position[2, k])
            square = dx**2 + dy**2 + dz**2
            if square == 0:
                continue
            sent = dx * light_normal[0, k] + dy * light_normal[1, k] + dz * light_normal[2, k]
            received = -(dx * normal[0, i] + dy * normal[1, i] + dz * normal[2, i])
            if sent > 0 and received > 0:
                f = sent * received / (square * (np.float32(np.pi) * square + area[k]))
                red += f * flux[0, k]
                green += f * flux[1, k]
                blue += f * flux[2, k]
        out[0, i], out[1, i], out[2, i] = red, green, blue


@njit(parallel=True)
def gather_plainly(position, normal, radiance, area, offsets, weight, out):
    rows, columns = area.shape
    pi = np.float32(np.pi)
    for y in prange(rows):
        for x in range(columns):
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for j in range(offsets.shape[2]):
                u = x + offsets[y % offsets.shape[0], x % offsets.shape[1], j, 0]
                v = y + offsets[y % offsets.shape[0], x % offsets.shape[1], j, 1]
                if u < 0 or v < 0 or u >= columns or v >= rows:
                    continue
                dx, dy, dz = (position[0, v, u] - position[0, y, x], position[1, v, u] - position[1, y, x],
                              position[2, v, u] - position[2, y, x])
                square = dx**2 + dy**2 + dz**2
                received = dx * normal[0, y, x] + dy * normal[1, y, x] + dz * normal[2, y, x]
                sent = -(dx * normal[0, v, u] + dy * normal[1, v, u] + dz * normal[2, v, u])
                if received > 0 and sent > 0:
                    distance = np.sqrt(square)
                    disc = sent / distance * area[v, u] * weight[y % weight.shape[0], x % weight.shape[1], j] / pi
                    f = pi * received / distance * disc / (square + disc)
                    red += f * radiance[0, v, u]
                    green += f * radiance[1, v, u]
                    blue += f * radiance[2, v, u]
            out[0, y, x], out[1, y, x], out[2, y, x] = red, green, blue


def _pair_peers(given: list[Array], result: Array) -> Runs:
    covered = given[2] if given[2].dtype == np.bool_ else given[2] >= 0
    arrays = *given[:2], covered, *given[3:]
    runs: Runs = {"plain Numba": partial(sum_plainly, *arrays, result.reshape(3, -1))}
    for name, licence in (("gcc -O3", ()), ("gcc -O3 -ffast-math", ("-ffast-math",))):
        if (compiled := _compiled(*licence)) is not None:
            position, normal, seen, *lights = map(np.ascontiguousarray, arrays)
            pointers = [one.ctypes.data_as(ctypes.c_void_p) for one in (position, normal, *lights, seen, result)]
            runs[name] = partial(compiled, ctypes.c_long(seen.size), ctypes.c_long(lights[0].shape[1]), *pointers)
    return runs


def _crown_peers(given: list[Array], result: Array) -> Runs:
    return {"plain Numba": partial(gather_plainly, *given, result)}


def _compiled(*licence: str) -> Callable[..., None] | None:
    """Return C_SOURCE as compiled for this processor; None without a compiler."""
    if (compiler := shutil.which("gcc")) is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "sum.so"
        subprocess.run([compiler, "-O3", "-march=native", *licence, "-shared", "-fPIC", "-x", "c", "-", "-o", library,
                        "-lm"], input=C_SOURCE, text=True, check=True)
        function = ctypes.CDLL(str(library)).sum
    function.restype = None
    return function


def _glsl(case: Case, step: Stage, known: dict[str, Array]) -> Runs:
    """Return the GLSL port's run of a stage, on one thread; none where there is no OpenGL 4.5."""
    os.environ["LP_NUM_THREADS"] = "1"
    try:
        sys.path.insert(0, str(GLSL))
        port = importlib.import_module("run")
        gpu = port.Gpu(())
    except Exception:  # no moderngl, no EGL or an older OpenGL: each raises its own
        return {}
    finally:
        sys.path.remove(str(GLSL))
    arrays = Recorded(case, known)
    entry = {"name": step.name, "reads": step.reads, "writes": step.writes}

    def run() -> Array:
        port.STAGES[port.kind_of(entry)](gpu, arrays, entry)
        return arrays.written[step.writes[0]]

    return {"GLSL on llvmpipe": run}
