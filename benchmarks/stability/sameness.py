"""Sameness: one hash a stage over threads, tiles and batches, cold and warm kernels, and compiler targets.

`python -m benchmarks.stability.sameness METHOD[,KEY=VALUE] ...` prints the hashes of each stage's result; the threads,
the compiler's target and the folder of compiled kernels are those of the environment.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

from benchmarks.stability.promise import Task, Tell
from refgi import Frame, load_scene
from refgi.batch.shared import hashes_of
from refgi.errors import RefgiWarning
from refgi.methods import BUILT_IN, find_method
from refgi.stages import observe
from refgi.stress.promises import Row, settings_of

ROOT = Path(__file__).parents[2]
PART = "sameness"
THREADS = (1, 2, 3, 7)
COLD = ("sii", "hssil", "gather")  # whose kernels are compiled anew: the others take minutes
TARGETS = {"x86-64": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""},
           "haswell": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""},
           "loop vectoriser off": {"NUMBA_LOOP_VECTORIZE": "0"}}
BATCHES = {"truth": ("batch=4099", "batch=262144"), "vpl": ("batch=4099", "batch=262144")}
OWNED = "each element is owned by one iteration and summed in a fixed order"
STRICT = "strict IEEE arithmetic: no contraction, no reassociation"

SCENES = ("cornell_box", "stage")
WIDTH, HEIGHT, MAP = 45, 33, 64  # pixels, texels: no multiples of any tile
FEW = {"sii": ("lights=256",), "multires": ("lights=256",), "val": ("lights=256", "clusters=8", "maps=64"),
       "vpl": ("lights=64",), "truth": ("samples=32",)}

Hashes = dict[str, dict[str, str]]


def hashes(method: str, *changes: str) -> dict[str, str]:
    """Return the hash of each stage's results, in the order in which they ended, over all scenes."""
    found: dict[str, str] = {}
    settings = settings_of(method, (*FEW.get(method, ()), *changes))
    for scene in SCENES:
        with warnings.catch_warnings(), observe(record=True) as log:
            warnings.simplefilter("ignore", RefgiWarning)
            frame = Frame(load_scene(scene), width=WIDTH, height=HEIGHT, rsm_resolution=MAP)
            frame.radiance(find_method(method).compute(frame, settings)[0])
        found |= {f"{scene} {number} {name}": digest for number, (name, digest) in enumerate(hashes_of(log, {}))}
    return found


def tasks(short: bool) -> list[Task]:
    """Return the tasks: threads and batches; in full cold kernels and targets as well."""
    methods = ("sii", "hssil") if short else tuple(BUILT_IN)
    counts = THREADS[::3] if short else THREADS
    found = [Task("threads", lambda tell: [_threads(methods, counts, tell)])]
    if not short:
        found += [Task("batches", lambda _: [_batches(name) for name in BATCHES]), Task("cold", lambda _: [_cold()])]
        if platform.machine() in ("x86_64", "AMD64"):
            found += [Task(f"target-{name}".replace(" ", "-"), lambda _, name=name: [_target(name)])
                      for name in TARGETS]
    return found


def apart(first: Hashes, second: Hashes) -> list[str]:
    """Return the stages whose hash differs, or that only one has, those of each method in order."""
    return [f"{method} {stage}" for method in sorted({*first, *second})
            for stage in dict.fromkeys([*first.get(method, {}), *second.get(method, {})])
            if first.get(method, {}).get(stage) != second.get(method, {}).get(stage)]


def hashes_in(environment: dict[str, str], *methods: str) -> Hashes:
    """Return the hashes that a process of some environment finds."""
    made = subprocess.run([sys.executable, "-m", "benchmarks.stability.sameness", *methods], cwd=ROOT, check=True,
                          env={**os.environ, **environment}, stdout=subprocess.PIPE, text=True)
    found: Hashes = json.loads(made.stdout)
    return found


def _row(name: str, subject: str, domain: str, stages: int, differing: list[str], source: str, command: str) -> Row:
    first = f"first: {differing[0]}" if differing else ""
    return Row(part=PART, property=name, subject=subject, domain=domain, figure=len(differing), unit="stages", limit=0,
               kind="exact", source=source, cases=stages, reproduce=command, detail=first)


def _threads(methods: tuple[str, ...], counts: tuple[int, ...], tell: Tell) -> Row:
    base = hashes_in({"NUMBA_NUM_THREADS": str(counts[0])}, *methods)
    differing: list[str] = []
    for count in counts[1:]:
        tell(f"{count} threads")
        differing += apart(base, hashes_in({"NUMBA_NUM_THREADS": str(count)}, *methods))
    stages = sum(len(one) for one in base.values()) * (len(counts) - 1)
    return _row("threads", ", ".join(methods), f"{', '.join(map(str, counts))} threads", stages, differing, OWNED,
                f"NUMBA_NUM_THREADS={counts[-1]} python -m benchmarks.stability.sameness {' '.join(methods)}")


def _batches(method: str) -> Row:
    """Compare pictures alone: a stage a batch is another number of stages."""
    small, large = ({"picture": dict(zip(SCENES, _pictures(method, batch), strict=True))}
                    for batch in BATCHES[method])
    return _row("batches", method, " and ".join(BATCHES[method]), len(small["picture"]), apart(small, large), OWNED,
                f"python -m benchmarks.stability.sameness {method},{BATCHES[method][0]}")


def _pictures(method: str, change: str) -> list[str]:
    """Return the hash of the picture of each scene."""
    stages = hashes_in({}, f"{method},{change}")[method]
    return [one for stage, one in stages.items() if stage.endswith("frame.compose")]


def _cold() -> Row:
    warm = hashes_in({}, *COLD)
    with tempfile.TemporaryDirectory() as folder:
        cold = hashes_in({"REFGI_CACHE_DIR": folder}, *COLD)
    return _row("cold and warm kernels", ", ".join(COLD), "kernels compiled in the process and read from the cache",
                sum(len(one) for one in warm.values()), apart(warm, cold), "the same machine code",
                f"REFGI_CACHE_DIR=$(mktemp -d) python -m benchmarks.stability.sameness {' '.join(COLD)}")


def _target(name: str) -> Row:
    native = hashes_in({}, *COLD)
    with tempfile.TemporaryDirectory() as folder:
        other = hashes_in({"REFGI_CACHE_DIR": folder, **TARGETS[name]}, *COLD)
    variables = " ".join(f"{key}='{value}'" for key, value in TARGETS[name].items())
    return _row("compiler target", ", ".join(COLD), f"{name} beside native",
                sum(len(one) for one in native.values()), apart(native, other), STRICT,
                f"{variables} REFGI_CACHE_DIR=$(mktemp -d) python -m benchmarks.stability.sameness {' '.join(COLD)}")


if __name__ == "__main__":
    print(json.dumps({text.partition(",")[0]: hashes(*text.split(",")) for text in sys.argv[1:]}))
