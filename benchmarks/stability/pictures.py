"""Pictures: what `refgi stress` promises, on built-in scenes, and scenes that nobody would build.

`python -m benchmarks.stability.pictures METHOD SEED` shows one of these, `METHOD FIRST LAST` tries many.
"""

import sys
import time
import traceback
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numba
import numpy as np

from benchmarks.stability.hostile import Hostile, hostile, shrunk
from benchmarks.stability.promise import Task, Tell
from refgi import load_scene
from refgi.errors import InputError, RefgiWarning
from refgi.methods import BUILT_IN, render
from refgi.stress.promises import Row, settings_of
from refgi.stress.run import PART, stress

SIZE = 64
SCENES = ("cornell_box", "stage", "ring:faces=3000", "glass_ball:faces=3000", "metaballs",
          "integrating_sphere:faces=1000", "textured_atrium", "leaf_grid")
SHORT_METHODS = ("sii", "multires", "hssil", "gather")
# a few lights each: what breaks on a strange scene breaks with few
FEW = {"sii": ("lights=64",), "multires": ("lights=64",), "val": ("lights=64", "clusters=4", "maps=16"),
       "vpl": ("lights=64",), "truth": ("samples=8", "photons=4096")}
MAP = 32  # texels of a lamp's map
HOSTILE, SHORT_HOSTILE = 3000, 6
PROCESSES, SHARE = 2, 200  # of the full form; scenes that one of them tries at once
SLOWEST = 10.0  # s of a processor, a picture
DOMAIN = ("needles, soups, fans, lamps and cameras in walls, 1e-8 to 1e8 m, exponents to 1e20, 1 to 17 pixels "
          "along a side")
SOUND = "no number that is no light, no exception but InputError, no warning of Python, within 10 s"


def tasks(short: bool) -> list[Task]:
    """Return the tasks: each scene's changes, and hostile scenes by method."""
    scenes = SCENES[:1] if short else SCENES
    methods = SHORT_METHODS if short else tuple(BUILT_IN)
    changed = [Task(f"changes-{name.partition(':')[0]}", lambda _, name=name: _changed(name, methods))
               for name in scenes]
    count = SHORT_HOSTILE if short else HOSTILE
    processes = 1 if short else PROCESSES
    return [*changed, *(Task(f"hostile-{name}",
                             lambda tell, name=name: [hostile_row(name, range(count), tell, processes)])
                        for name in methods)]


def _changed(name: str, methods: Sequence[str]) -> list[Row]:
    scene = load_scene(name)
    return [found.row for found in stress(scene, methods, width=SIZE, height=SIZE, source=name)]


def hostile_row(method: str, seeds: Sequence[int], tell: Tell, processes: int = 1) -> Row:
    """Return how many hostile scenes break a method; in this process, or in some others."""
    if processes == 1:
        broken = broken_by(method, seeds)
    else:
        shares = [seeds[first : first + SHARE] for first in range(0, len(seeds), SHARE)]
        with ProcessPoolExecutor(processes, get_context("spawn"), numba.set_num_threads, (1,)) as pool:
            broken = [one for share in pool.map(partial(broken_by, method), shares) for one in share]
    for seed, why in broken:
        tell(f"{method}, seed {seed}: {why}")
    worst = ""
    if broken:
        smallest = shrunk(hostile(broken[0][0]), lambda one: bool(fault_of(one, method)))
        worst = f"{broken[0][1]}; smallest scene: {smallest.written()}"
    seed = broken[0][0] if broken else None
    return Row(part=PART, property="hostile scenes", subject=method, domain=DOMAIN, figure=len(broken), unit="scenes",
               limit=0, kind="exact", source=SOUND, cases=len(seeds), seed=seed, detail=worst,
               reproduce=f"python -m benchmarks.stability.pictures {method} {seed or 0}")


def broken_by(method: str, seeds: Iterable[int]) -> list[tuple[int, str]]:
    """Return the hostile scenes that break a method, and how."""
    found = ((seed, fault_of(hostile(seed), method)) for seed in seeds)
    return [(seed, why) for seed, why in found if why]


def fault_of(scene: Hostile, method: str) -> str:
    """Return what breaks when a method renders a scene; nothing where it is refused or rendered well."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RefgiWarning)
            picture = render(scene.scene(), method, settings_of(method, FEW.get(method, ())), rsm_resolution=MAP)
    except InputError:
        return ""
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {error} ({where.name}, line {where.lineno})"
    for what in ("irradiance", "lobes", "radiance"):
        light = getattr(picture, what)
        if light is not None and not (np.isfinite(light).all() and (light >= 0).all()):
            return (f"{what}: {np.count_nonzero(~np.isfinite(light))} numbers not finite, "
                    f"{np.count_nonzero(light < 0)} below 0")
    spent = time.process_time() - begin
    return f"{spent:.0f} s" if spent > SLOWEST else ""


def main(arguments: list[str]) -> int:
    """Show one scene, or count those that break of as many as are wanted."""
    method, first, *last = arguments
    if last:
        row = hostile_row(method, range(int(first), int(last[0])), print, PROCESSES)
        print(f"{method}: {row.figure:g} of {row.cases} scenes break it\n{row.detail}".rstrip())
        return int(not row.passed)
    print(hostile(int(first)).written())
    fault = fault_of(hostile(int(first)), method)
    print(fault or "nothing breaks")
    return int(bool(fault))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
