"""Multiresolution splatting: its steps, speed-up at its error, cost by subsplats.

A figure of the paper is of a GeForce GTX 280 at 1024^2; ours are of this machine. The paper's scenes are used where
REFGI_DATA names their folder, built-in ones of as many faces elsewhere.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.harness import Row, paper_scene, ratio, seconds
from refgi import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.settings import of, replaced
from refgi.splat import MultiresSettings, Receivers, irradiance, multires, shared_subsplats
from refgi.splat.multires import ByError, ByGeometry
from refgi.splat.multires.refinement.criteria import discontinuities
from refgi.splat.multires.refinement.grid import top_level
from refgi.splat.multires.refinement.refine import refine
from refgi.splat.multires.subsplats.evaluate import evaluate, representative_points
from refgi.splat.multires.subsplats.upsample import upsample

PAPER = {"dragon_bunny": 21, "flying_bunnies": 25}  # frames a second at 1024^2, Table 2
CLAMPS = {"no clamp": {"clamp": "none"}, "disc": {"clamp": "disc"}}
TARGETS = (0.10, 0.05, 0.02, 0.01)


def rows(quick: bool) -> Iterator[Row]:
    size, repeats = (256, 3) if quick else (1024, 7)
    for name, paper in PAPER.items():
        yield from _shares(name, size, repeats, paper)
    for name in ("sponza", "cornell_horse"):
        frame = Frame(paper_scene(name), width=size, height=size)
        for clamp, how in CLAMPS.items():
            yield from _errors(f"{name}, {clamp}", frame, of(MultiresSettings, **how), repeats)
    yield from _sweep(size, repeats)


def _shares(name: str, size: int, repeats: int, paper: int) -> Iterator[Row]:
    """What of a frame is the method's own; the rate of whole frames: topic frames."""
    still, settings = Frame(paper_scene(name), width=size, height=size), MultiresSettings()
    parts = _parts(still, settings, repeats)
    note = ", ".join(f"{part} {1e3 * taken:.1f} ms" for part, taken in parts.items())
    yield Row(f"{name}: mips and upsampling in a frame of the paper", (parts["mips"] + parts["upsampling"]) * paper,
              "share", "<= 0.3", note)
    leaves = len(shared_subsplats(still.gbuffer, ByGeometry()).level)
    yield Row(f"{name}: refinement", 1e9 * parts["refinement"] / leaves, "ns a leaf", "<= 10", f"{leaves} leaves")


def _parts(frame: Frame, settings: MultiresSettings, repeats: int) -> dict[str, float]:
    """Seconds of each step of the method on buffers that rest."""
    subsplats, pairs = settings.subsplats, settings.effective_pairs
    assert isinstance(subsplats, ByGeometry)
    criteria = subsplats.criteria
    buffer, lights = frame.gbuffer, choose_lights(frame, settings.lights)
    area = footprints(frame, settings.lights, pairs)
    buffer.resolve("position", "normal", "depth", "covered")
    top = top_level(buffer.height, buffer.width, subsplats.coarsest)
    discontinuous = discontinuities(buffer, criteria, top)
    leaves = refine(discontinuous, buffer.covered)
    points = representative_points(buffer, leaves)
    values = evaluate(*points, lights, pairs, area)
    return {"mips": seconds(lambda: discontinuities(buffer, criteria, top), repeats),
            "refinement": seconds(lambda: refine(discontinuous, buffer.covered), repeats),
            "fetching": seconds(lambda: representative_points(buffer, leaves), repeats),
            "lighting": seconds(lambda: evaluate(*points, lights, pairs, area), repeats),
            "upsampling": seconds(lambda: upsample(values, leaves, buffer.covered), repeats)}


def _errors(name: str, frame: Frame, settings: MultiresSettings, repeats: int) -> Iterator[Row]:
    """Speed over the full sum at the error that thresholds or a target lead to."""
    pairs = settings.effective_pairs
    lights, area = choose_lights(frame, settings.lights), footprints(frame, settings.lights, pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))

    def everywhere() -> Any:
        return irradiance(receivers, choose_lights(frame, settings.lights), pairs,
                          footprints(frame, settings.lights, pairs))

    full = irradiance(receivers, lights, pairs, area).astype(np.float64)
    for threshold in (0.1, 0.25, 0.5, 1.4):
        how = replaced(settings, {"normal.threshold": threshold})
        yield _against(f"{name}: normal threshold {threshold}", "", frame, how, everywhere, full, repeats)
    for target in TARGETS:
        how = replaced(settings, {"subsplats": ByError(target)})
        aim = ">= 8" if target == TARGETS[-1] else ""
        yield _against(f"{name}: target {target:.0%}", aim, frame, how, everywhere, full, min(3, repeats))


def _against(
    name: str, aim: str, frame: Frame, settings: MultiresSettings, everywhere: Any, full: Any, repeats: int
) -> Row:
    covered = frame.gbuffer.covered
    off = (multires(frame, settings) - full)[:, covered]
    error = np.sqrt((off**2).mean()) / full[:, covered].mean()
    faster = ratio(everywhere, lambda: multires(frame, settings), repeats)
    return Row(f"{name}: speed over the full sum", faster.median, "ratio", aim,
               f"RMSE / mean {error:.4f}; {1e3 * faster.seconds_a:.0f} against {1e3 * faster.seconds_b:.0f} ms")


def _sweep(size: int, repeats: int) -> Iterator[Row]:
    """Time of lighting, for each pair of subsplat and light."""
    frame = Frame(paper_scene("sponza"), width=size, height=size)
    for count in (64, 256, 1024):
        for threshold in (0.25, 1.4):
            settings = of(MultiresSettings, lights=count, clamp="none", normal_threshold=threshold)
            assert isinstance(settings.subsplats, ByGeometry)
            leaves = shared_subsplats(frame.gbuffer, settings.subsplats)
            points, lights = representative_points(frame.gbuffer, leaves), choose_lights(frame, settings.lights)
            taken = seconds(lambda p=points, x=lights, s=settings.pairs: evaluate(*p, x, s), repeats)
            pairs = points[0].shape[1] * lights.position.shape[1]
            yield Row(f"{count} lights, normal threshold {threshold}", 1e9 * taken / pairs, "ns a pair", "",
                      f"{points[0].shape[1]} subsplats, {1e3 * taken:.2f} ms")
