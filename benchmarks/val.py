"""Clustered visibility: frames a second beside the paper's, their breakdown, error against shadow rays.

A figure of the paper is of a GeForce 8800 GTX at 800^2 with 1024 lights, 30 area lights, 8 x 8 interleaving and the
geometry-aware blur; ours are of this machine, with light and camera moving. The paper's scenes are used where
REFGI_DATA names their folder, built-in ones of as many faces elsewhere.
"""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.harness import Row, real_scene, seconds
from refgi import Frame, load_scene
from refgi.cluster import ValSettings, val
from refgi.scene import Scene
from refgi.settings import of
from refgi.splat import MultiresSettings, multires
from refgi.stages import observe
from refgi.truth.vpl import VplSettings, vpl

STAND_INS = {"cornell_horse": "cornell_sphere:faces=17000", "sponza": "atrium:faces=262000",
             "kitchen": "atrium:faces=100000,seed=3"}
PAPER = {"cornell_horse": 19.7, "sponza": 13.4}  # frames a second, Table 1
PARTS = {  # stages of each line of Table 2, and the paper's ms on cornell_horse
    "deferred rendering": (("rsm.gbuffer", "rsm.resolve", "rsm.shadow_map_visibility", "rsm.direct_irradiance",
                            "frame.compose"), 0.4),
    "VPL generation": (("rsm.reflective_shadow_map", "lights.draw", "lights.choose"), 0.1),
    "clustering": (("cluster.kmeans", "cluster.area_lights"), 0.5),
    "depth maps": (("cluster.shadow_maps",), 4.2),
    "indirect light": (("cluster.irradiance",), 35.0),
    "blur": (("cluster.blur",), 10.7),
    "subsplats": (("multires.criteria", "multires.refine", "multires.upsample"), 0.0),
}
EVERYWHERE = "every light at every pixel"
Light = Callable[[Frame], Any]
LIGHTS: dict[str, Light] = {
    "8 x 8 interleaved and blurred": lambda frame: val(frame, of(ValSettings, interleaving=8)),
    "the same, lights assigned by cluster": lambda frame: val(frame, of(ValSettings, interleaving=8,
                                                                        assignment="cluster")),
    "every light at subsplats": lambda frame: multires(frame, of(MultiresSettings, lights=1024, visibility="val")),
    EVERYWHERE: lambda frame: val(frame, of(ValSettings, interleaving=1)),
}


def rows(quick: bool) -> Iterator[Row]:
    size, repeats = (200, 3) if quick else (800, 7)
    for name, paper in PAPER.items():
        yield from _frames(name, size, repeats, paper)
    for name in STAND_INS:
        yield from _errors(name, 96 if quick else 192)


def _scene(name: str) -> Scene:
    return load_scene(real_scene(name) or STAND_INS[name])


def _frames(name: str, size: int, repeats: int, paper: float) -> Iterator[Row]:
    """Frames a second as published and in full, and the breakdown of the paper's Table 2."""
    scene, moves = _scene(name), iter(range(1, 10000))

    def frame(light: Light) -> None:
        moved = Frame(_moved(scene, 1e-4 * next(moves)), width=size, height=size)
        moved.radiance(light(moved))

    for label, light in LIGHTS.items():
        def draw(light: Light = light) -> None:
            frame(light)

        aim = "" if label == EVERYWHERE else f"> {paper}"
        yield Row(f"{name}: {label}", 1 / seconds(draw, repeats), "frames/s", aim, _breakdown(draw, repeats))
    yield from _saved(name, Frame(scene, width=size, height=size))


def _saved(name: str, frame: Frame) -> Iterator[Row]:
    """Error that evaluating fewer lights or fewer receivers adds to every light at every pixel."""
    everywhere = LIGHTS[EVERYWHERE](frame).astype(np.float64)
    covered = frame.gbuffer.covered
    for label, light in LIGHTS.items():
        if label != EVERYWHERE:
            error = np.sqrt(np.square((light(frame) - everywhere)[:, covered]).mean()) / everywhere[:, covered].mean()
            yield Row(f"{name}: {label}, RMSE / mean to every light at every pixel", float(error), "", "")


def _moved(scene: Scene, step: float) -> Scene:
    light, (x, y, z) = scene.lights[0], scene.camera.eye
    a, b, c = light.position
    return (scene.with_lights(dataclasses.replace(light, position=(a + step, b, c)))
            .with_camera(eye=(x + step, y, z)))


def _breakdown(frame: Any, repeats: int) -> str:
    """Return the median time of each part of a frame, ms, with the paper's beside it."""
    taken: dict[str, list[float]] = {part: [] for part in PARTS}
    for _ in range(repeats):
        with observe() as log:
            frame()
        for part, (stages, _) in PARTS.items():
            taken[part].append(1e3 * sum(log.seconds(stage) for stage in stages))
    return ", ".join(f"{part} {np.median(times):.1f} ms ({PARTS[part][1]})" for part, times in taken.items())


def _errors(name: str, size: int) -> Iterator[Row]:
    """Error against a shadow ray for each pair at equal lights."""
    frame = Frame(_scene(name), width=size, height=size)
    truth = vpl(frame, of(VplSettings, lights=1024)).astype(np.float64)
    unshadowed = vpl(frame, of(VplSettings, lights=1024, visibility=False))
    yield Row(f"{name}: no visibility", *_relative(unshadowed, truth, frame), "")
    for label, settings in (("every light", of(ValSettings, interleaving=1)),
                            ("8 x 8", of(ValSettings, interleaving=8)),
                            ("PCF", of(ValSettings, interleaving=1, visibility="pcf")),
                            ("PCSS", of(ValSettings, interleaving=1, visibility="pcss"))):
        yield Row(f"{name}: 30 area lights, {label}", *_relative(val(frame, settings), truth, frame), "")


def _relative(found: Any, truth: Any, frame: Frame) -> tuple[float, str]:
    from refgi.compare.metrics import relmse

    return relmse(found, truth, frame.gbuffer.covered), "relMSE"
