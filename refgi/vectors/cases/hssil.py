"""Hierarchical screen-space light, from the buffers to the picture, and its temporal filter."""

import dataclasses
import math
from typing import Any

import numpy as np

from refgi.diagnostics import diagnosing
from refgi.scene import Scene, SpotLight
from refgi.settings import of, replaced
from refgi.sssil.settings import PRESETS, HssilSettings, TemporalSettings
from refgi.sssil.temporal.sequence import Sequence
from refgi.vectors.cases.scenes import BULB, DOWN, POLE, RAMP, SPOT, VIEW, coloured, room, stored_scene
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.buffers import add_gbuffer, give_scene
from refgi.vectors.stages.direct import Shadows, add_direct
from refgi.vectors.stages.hssil import add_hssil
from refgi.vectors.stages.temporal import add_temporal

AWAY = SpotLight((0.5, 1.5, 0.625), (0.3, 1.0, 0.2), 0.3, 0.6, (4.0, 2.6, 1.3))  # shines into the void
NARROW = math.radians(38)  # the room fills the picture: points enter at its edges
BOX = slice(16, 20)  # vertices of the lid in the room
CLOSEST = of(HssilSettings, downsample="closest", disc_share=1.0)  # what the stages here are of
SETTINGS = {
    "hssil-default": replaced(CLOSEST, {"samples": 12, "radius": 2.0, "seed": 3}),
    "hssil-paper": replaced(PRESETS["paper"], {"sampling.samples": 12, "sampling.radius": 2.0}),
    "hssil-odd": replaced(CLOSEST, {"samples": 9, "radius": None, "levels": 5, "start": "full", "seed": 1,
                                    "blur.size": 3, "plane_tolerance": 0.1, "cosine": 0.5}),
    "hssil-pole": replaced(CLOSEST, {"samples": 8, "radius": 2.0, "levels": 2, "seed": 5}),
    "hssil-dark": replaced(CLOSEST, {"samples": 8, "radius": 2.0, "levels": 2, "start": "quarter"}),
    "hssil-average": replaced(CLOSEST, {"samples": 7, "radius": 2.0, "levels": 3, "seed": 6, "downsample": "average",
                                        "pattern": "pixel", "density": "uniform"}),
    "hssil-radiance": replaced(CLOSEST, {"samples": 10, "radius": 2.5, "levels": 3, "seed": 2,
                                         "downsample": "closest_average", "pattern": "fixed"}),
    "hssil-all": replaced(CLOSEST, {"radius": 2.0, "levels": 3, "pattern": "all"}),
    "hssil-ramp": replaced(CLOSEST, {"samples": 8, "radius": 2.0, "levels": 2, "seed": 4}),
    "hssil-colours": replaced(CLOSEST, {"samples": 8, "radius": 2.0, "levels": 2, "seed": 8}),
}
VIEWS: dict[str, tuple[Scene, tuple[int, int], Shadows]] = {
    "hssil-default": (room(SPOT, BULB), (40, 28), "map"),
    "hssil-paper": (room(SPOT, matte=True), (40, 28), "map"),
    "hssil-odd": (room(SPOT, matte=True), (13, 11), "exact"),
    "hssil-pole": (room(DOWN, camera=POLE), (21, 14), "exact"),
    "hssil-dark": (room(AWAY, matte=True), (18, 13), "exact"),
    "hssil-average": (room(SPOT, BULB), (27, 19), "exact"),
    "hssil-radiance": (room(SPOT, BULB, matte=True, smooth=True), (30, 21), "exact"),
    "hssil-all": (room(BULB, matte=True), (18, 14), "exact"),
    "hssil-ramp": (room(RAMP, SPOT, matte=True), (16, 12), "exact"),
    "hssil-colours": (coloured(room(SPOT, BULB, matte=True)), (20, 15), "exact"),
}
TEMPORAL = {
    "hssil-temporal": of(TemporalSettings),
    "hssil-entering": of(TemporalSettings, warm_up=False, entering_speed=6.0, clamp=1.0, clamp_radius=2,
                         depth_tolerance=0.25, fetch="nearest"),
    "hssil-moving": of(TemporalSettings, speed=3.0),
}
STEPS = {"hssil-temporal": (0.1, 0.15, -0.2), "hssil-entering": (-0.2, 0.1, 0.2), "hssil-moving": (0.01, 0.0, 0.02)}
FRAMES, TEMPORAL_SIZE = 4, (32, 24)


def screen_space(id: str, what: str, scene: Scene, size: tuple[int, int], shadows: Shadows) -> Case:
    """Return hssil on a scene: `size` (columns, rows) of the picture."""
    recipe = Recipe(id, "hssil", what)
    give_scene(recipe, scene)
    add_gbuffer(recipe, scene, *size)
    add_direct(recipe, scene, size, shadows)
    add_hssil(recipe, scene, size, SETTINGS[id])
    return recipe.case()


def coherent(id: str, what: str) -> Case:
    """Return the temporal filter of the last of some frames; light and count of the frames before are given."""
    scenes = frames_of(id)
    with diagnosing(False):  # few samples are what the case is made of
        filtered = list(sequence(id, scenes[:-1]))
        new = next(iter(sequence(id, scenes[-1:], None).over(scenes[-1:], FRAMES - 1)))
    recipe = Recipe(id, "hssil", what)
    give_scene(recipe, scenes[-1])
    add_gbuffer(recipe, scenes[-1], *TEMPORAL_SIZE)
    before = filtered[-1]
    counts = np.ones(before.irradiance.shape[1:]) if before.frames is None else before.frames
    add_temporal(recipe, scenes[-1], scenes[-2], TEMPORAL_SIZE, TEMPORAL[id],
                 (before.irradiance, counts, new.irradiance))
    return recipe.case()


def frames_of(id: str) -> list[Scene]:
    """Return scenes whose camera moves on, or whose lid rises in place."""
    still, step = room(SPOT, BULB, matte=True), np.array(STEPS[id])
    scenes = []
    for k in range(FRAMES):
        eye, target = (tuple((np.array(point) + k * share * step).tolist()) for point, share in
                       ((VIEW.eye, 1.0), (VIEW.target, 0.3)))
        vertices = still.geometry.vertices.copy()
        if id == "hssil-moving":
            vertices[BOX] += k * np.array([-0.06, 0.03, 0.04])
        geometry = dataclasses.replace(still.geometry, vertices=vertices) if id == "hssil-moving" else still.geometry
        camera = dataclasses.replace(VIEW, eye=eye, target=target, vfov=NARROW)
        scenes.append(stored_scene(dataclasses.replace(still, camera=camera, geometry=geometry)))
    return scenes


def sequence(id: str, scenes: list[Scene], *temporal: Any) -> Sequence:
    """Return the frames of the production method in double precision."""
    settings = replaced(CLOSEST, {"samples": 8, "radius": 3.0, "levels": 3, "seed": 7})
    width, height = TEMPORAL_SIZE
    return Sequence(scenes, settings, *(temporal or (TEMPORAL[id],)), width=width, height=height, dtype=np.float64)


def _quick(id: str, what: str) -> Any:
    return lambda: screen_space(id, what, *VIEWS[id])


QUICK = {
    "hssil-default": _quick("hssil-default", "interleaved samples, two lamps, 4 levels from half resolution, void "
                            "around the room; the nearest senders and whole discs, where the method's default draws "
                            "senders and lets discs cover a quarter"),
    "hssil-paper": _quick("hssil-paper", "the paper's settings: rows share samples, uniform density, no blur"),
    "hssil-odd": _quick("hssil-odd", "13 x 11 pixels from full resolution down to one texel"),
    "hssil-pole": _quick("hssil-pole", "a camera that looks straight down: surfaces of one depth; a lamp above a "
                         "purely glossy shelf"),
    "hssil-ramp": _quick("hssil-ramp", "a spot of a squared ramp beside one of the smoothstep"),
    "hssil-temporal": lambda: coherent("hssil-temporal", "a camera that moves: fourth frame, surfaces found in 1 to 3 "
                                       "frames before, disoccluded ones"),
    "hssil-entering": lambda: coherent("hssil-entering", "a camera that turns: entering pixels, clamped light of the "
                                       "nearest texel"),
}
FULL: dict[str, Any] = {
    "hssil-dark": _quick("hssil-dark", "no direct light: all is 0"),
    "hssil-average": _quick("hssil-average", "levels of means by area; each texel has samples of its own"),
    "hssil-radiance": _quick("hssil-radiance", "the closest texels with the mean radiance of all; one mirror-symmetric "
                             "set of samples, no blur"),
    "hssil-all": _quick("hssil-all", "every texel of disc and crown is a sample, no blur"),
    "hssil-colours": _quick("hssil-colours", "vertex colours multiply the albedo, and so the light that senders send"),
    "hssil-moving": lambda: coherent("hssil-moving", "a surface that moves by itself before a camera that moves too"),
}
