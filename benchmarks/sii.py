"""SII as a whole: frames a second beside the paper's, pairs evaluated, the cut against the full sum, the warp.

A figure of the paper is of a GeForce 6800 GT at 512^2, without buffer updates unless said; ours are of this machine.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.harness import Row, ratio, seconds
from refgi import Frame, load_scene
from refgi.lights import Warp, warp_stacked
from refgi.lights.selection import choose_lights
from refgi.rsm import rasterize
from refgi.sampling import halton
from refgi.scene import Scene
from refgi.settings import of, replaced
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.sii.reach.fragments import fragments
from refgi.splat.sii.sii import splat

ROOM = "cornell_sphere:faces=17000"
# a sixth of the pairs count, as in Fig. 8: 125 of 768
FIVE_PERCENT = of(SiiSettings, cut_share=0.05, reference_length=0.171, clamp="none")
CAUSTIC = of(SiiSettings, lights=4096, warp="B", importance="peak", cut_share=0.05, reference_length=1.0,
             clamp="none")


def rows(quick: bool) -> Iterator[Row]:
    size, repeats = (256, 3) if quick else (512, 9)
    room = load_scene(ROOM)
    yield from _frames("768 lights, 5 %, 17k faces", room, FIVE_PERCENT, size, repeats, 48)
    yield from _frames("ring caustic, 4096 lights", load_scene("ring"), CAUSTIC, size, repeats, 95)
    yield from _culling(size)
    yield from _early_depth(size, repeats)
    yield from _headline(room, size, repeats)
    yield from _warping(room, repeats)


def _frames(name: str, scene: Scene, settings: SiiSettings, size: int, repeats: int, paper: float) -> Iterator[Row]:
    """Frames a second of the splatting alone, as the paper timed its figures; of whole frames: topic frames."""
    still = Frame(scene, width=size, height=size)
    lights, receivers = choose_lights(still, settings.lights), _receivers(still)
    drawn = fragments(receivers, lights, settings)
    splatting = seconds(lambda: sii(still, settings), repeats)  # choosing the lights included
    note = f"paper {paper:.0f}; overdraw {drawn.total / receivers.covered.sum():.0f}"
    yield Row(f"{name}: still buffers", 1 / splatting, "frames/s", f">= {paper * (3 if paper < 50 else 1):.0f}", note)


def _receivers(frame: Frame) -> Receivers:
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


def _culling(size: int) -> Iterator[Row]:
    """Pairs that the kernels look at over those that count."""
    scenes = {"cornell_box": 0.25, ROOM: 0.171, "atrium": 4.0}
    for name, length in scenes.items():
        frame = Frame(load_scene(name), width=size, height=size)
        for bound in ("tangent", "ellipsoid", "quad", "full"):
            how = of(SiiSettings, cut_share=0.05, reference_length=length, bound=bound, clamp="none")
            drawn = fragments(_receivers(frame), choose_lights(frame, how.lights), how, None, frame.gbuffer.projection)
            yield Row(f"{name}, {bound}: pairs evaluated over fragments", drawn.evaluated / drawn.total, "ratio",
                      "<= 1.3" if bound == "tangent" else "",
                      f"overdraw {drawn.total / frame.gbuffer.covered.sum():.0f} of 768")


def _early_depth(size: int, repeats: int) -> Iterator[Row]:
    """Quads, which know no depth, against tangent ellipsoids, whose tiles do (Sec. 3.4): the splat's time."""
    yard = load_scene("atrium")
    scenes = {"atrium": yard, "atrium, behind columns": yard.with_camera(eye=(6.5, 1.6, 3.2), target=(-6, 1.6, 3.2))}
    near = of(SiiSettings, cut_share=0.05, reference_length=4.0, clamp="none")
    flat = replaced(near, {"bound": "quad"})
    for name, scene in scenes.items():
        frame = Frame(scene, width=size, height=size)
        given, view = (_receivers(frame), choose_lights(frame, near.lights)), frame.gbuffer.projection
        quads, solids = (fragments(*given, how, None, view).evaluated for how in (flat, near))
        took = ratio(partial(splat, *given, flat, None, view), partial(splat, *given, near), repeats)
        yield Row(f"{name}: splat of quads over that of tangent ellipsoids", took.median, "ratio", "",
                  f"pairs evaluated {quads / solids:.2f}; {1e3 * took.seconds_b:.0f} ms")


def _headline(scene: Scene, size: int, repeats: int) -> Iterator[Row]:
    """The full sum of 1024 lights, and what the cut of as many loses and saves."""
    frame = Frame(scene, width=size, height=size)
    full = replaced(FIVE_PERCENT, {"lights": 1024, "cut": "none"})
    whole = sii(frame, full).astype(np.float64)
    first = seconds(lambda: sii(frame, full), repeats)
    yield Row("full sum of 1024 lights", 1 / first, "frames/s", "",
              f"{1e3 * first:.0f} ms; the paper's splat of 768 cut at 5 % took 21 ms")
    for share in (0.01, 0.05, 0.07, 0.10):
        cut = replaced(full, {"cut_share": share})
        picture = sii(frame, cut).astype(np.float64)
        saved = ratio(lambda: sii(frame, full), lambda how=cut: sii(frame, how), repeats)
        error = np.sqrt(((picture - whole) ** 2).mean()) / whole.mean()
        yield Row(f"cut at {share:.0%}: speed over the full sum", saved.median, "ratio", "",
                  f"RMSE / mean {error:.3f}, {1 - picture.sum() / whole.sum():.1%} of the light lost")


def _warping(scene: Scene, repeats: int) -> Iterator[Row]:
    """4096 samples through 4 levels, pyramid included, against rasterizing the map."""
    frame = Frame(scene, width=8, height=8)
    rsm = frame.rsms[0]
    points, worth = halton(4096), rsm.flux.max(axis=0)
    for method in ("A", "B"):
        against = ratio(lambda m=method: warp_stacked(points, worth, 1, Warp(m, 4)),
                        lambda: rasterize(scene.geometry, rsm.projection), repeats)
        yield Row(f"warp {method}, 4096 samples, 4 levels, over rasterizing 512^2", against.median, "ratio", "<= 1",
                  f"{1e3 * against.seconds_a:.2f} ms")
