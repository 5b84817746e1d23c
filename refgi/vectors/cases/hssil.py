"""Hierarchical screen-space light, from the buffers to the picture, and its temporal filter."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.scene import Scene, SpotLight
from refgi.settings import of, replaced
from refgi.sssil.settings import PRESETS, HssilSettings, TemporalSettings
from refgi.vectors.cases.scenes import (
    BULB,
    DOWN,
    POLE,
    RAMP,
    SPOT,
    UNDER,
    VIEW,
    Plan,
    Plans,
    cases_of,
    coloured,
    room,
    stored_scene,
)
from refgi.vectors.frames import frame_case
from refgi.vectors.spec import Arrays, Bug, Case, Run, expected_of, kind_of

LEVELS = "HSS Sec. 3.2: sums of disjoint crowns"
MAPS = 16  # texels along the side of a lamp's map
AWAY = SpotLight((0.5, 1.5, 0.625), (0.3, 1.0, 0.2), 0.3, 0.6, (4.0, 2.6, 1.3))  # shines into the void
NARROW = math.radians(38)  # the room fills the picture: points enter at its edges
BOX = slice(16, 20)  # vertices of the lid in the room
CLOSEST = of(HssilSettings, downsample="closest", disc_share=1.0)  # what the stages here are of
TEMPORAL = {
    "hssil-temporal": of(TemporalSettings),
    "hssil-entering": of(TemporalSettings, warm_up=False, entering_speed=6.0, clamp=1.0, clamp_radius=2,
                         depth_tolerance=0.25, fetch="nearest"),
    "hssil-moving": of(TemporalSettings, speed=3.0),
}
STEPS = {"hssil-temporal": (0.1, 0.15, -0.2), "hssil-entering": (-0.2, 0.1, 0.2), "hssil-moving": (0.01, 0.0, 0.02)}
FRAMES, TEMPORAL_SIZE = 4, (32, 24)
SEQUENCE = replaced(CLOSEST, {"samples": 8, "radius": 3.0, "levels": 3, "seed": 7})


def settings_of(plan: Plan) -> HssilSettings:
    """Return the settings of a plan: the nearest senders and whole discs unless it, or its preset, says otherwise."""
    choices = dict(plan.choices)
    base = {"": CLOSEST, "default": HssilSettings(), **PRESETS}[choices.pop("preset", "")]
    return replaced(base, choices)


def with_other_light(case: Case) -> Case:
    """Return a case with likely bugs of sums of levels that take another light of the case than they should."""
    known = functools.cache(functools.partial(expected_of, case))
    stages, made_by = list(case.stages), {name: step for step in case.stages for name in step.writes}
    for place, step in enumerate(case.stages):
        added = step.reads[-1] if kind_of(step.name) == "sssil.upsample" else ""
        if not added.startswith(("sssil.blur", "sssil.gather")):
            continue
        coarse, wrong = step.reads[0], {}
        raw, below = (made_by[one].reads[0] if one.startswith("sssil.blur") else one for one in (added, coarse))
        if raw != added:
            before = "that of the gather, before the blur"
            wrong[f"unblurred light of the level is added: {before}"] = {added: raw}
            if below != coarse:
                wrong |= {f"unblurred light of the coarser level: {before}": {coarse: below},
                          f"unblurred light of both levels: {before}": {coarse: below, added: raw}}
        if coarse.startswith("sssil.upsample"):
            wrong["only the next coarser level's own light is added, not the sum of all coarser ones"] = {
                coarse: made_by[coarse].reads[-1]}
        bugs = tuple(Bug(cause, _taking(known, step.run, others), LEVELS) for cause, others in wrong.items())
        stages[place] = dataclasses.replace(step, bugs=(*step.bugs, *bugs))
    return dataclasses.replace(case, stages=tuple(stages))


def _taking(known: Callable[[], Arrays], run: Run, others: Mapping[str, str]) -> Run:
    """Return a stage that reads other arrays of its case, which `known` gives, in place of some."""
    def wrong(arrays: Arrays, real: Any) -> Arrays:
        return run({**arrays, **{name: known()[other].astype(real) for name, other in others.items()}}, real)

    return wrong


def coherent(id: str, what: str) -> Case:
    """Return the last of some frames with its temporal filter; light and count of the frames before are given.

    So is what the frame before saw, where its triangles were elsewhere.
    """
    width, height = TEMPORAL_SIZE
    return with_other_light(frame_case(id, frames_of(id), "hssil", SEQUENCE, TEMPORAL[id], what=what, width=width,
                                       height=height, rsm_resolution=MAPS))


def frames_of(id: str) -> list[Scene]:
    """Return scenes whose camera moves on, or whose lid rises in place."""
    still, step = room(SPOT, BULB, matte=True), np.array(STEPS[id])
    scenes: list[Scene] = []
    for k in range(FRAMES):
        eye, target = (tuple((np.array(point) + k * share * step).tolist()) for point, share in
                       ((VIEW.eye, 1.0), (VIEW.target, 0.3)))
        vertices = still.geometry.vertices.copy()
        if id == "hssil-moving":
            vertices[BOX] += k * np.array([-0.06, 0.03, 0.04])
        geometry = dataclasses.replace(still.geometry, vertices=vertices) if id == "hssil-moving" else still.geometry
        camera = dataclasses.replace(VIEW, eye=eye, target=target, vfov=NARROW)
        scene = stored_scene(dataclasses.replace(still, camera=camera, geometry=geometry))
        if scenes and id != "hssil-moving":  # the very object: nothing moves
            scene = dataclasses.replace(scene, geometry=scenes[0].geometry)
        scenes.append(scene)
    return scenes


QUICK_PLANS: Plans = {
    "hssil-default": lambda: Plan(
        "interleaved samples, two lamps, 4 levels from half resolution, void around the room; the nearest senders and "
        "whole discs, where the method's default draws senders and lets discs cover a quarter",
        room(SPOT, BULB), (40, 28), MAPS, choices={"samples": 12, "radius": 2.0, "seed": 3}, shadows="map"),
    "hssil-paper": lambda: Plan(
        "the paper's settings: rows share samples, uniform density, no blur", room(SPOT, matte=True), (40, 28), MAPS,
        choices={"preset": "paper", "sampling.samples": 12, "sampling.radius": 2.0}, shadows="map"),
    "hssil-odd": lambda: Plan(
        "13 x 11 pixels from full resolution down to one texel; a lamp below the shelf", room(
            SPOT, UNDER, matte=True), (13, 11), MAPS, choices={
            "samples": 9, "radius": None, "levels": 5, "start": "full", "seed": 1, "blur.size": 3,
            "plane_tolerance": 0.1, "cosine": 0.5}, shadows="exact"),
    "hssil-pole": lambda: Plan(
        "a camera that looks straight down: surfaces of one depth; a lamp above a purely glossy shelf",
        room(DOWN, camera=POLE), (21, 14), MAPS, choices={"samples": 8, "radius": 2.0, "levels": 2, "seed": 5},
        shadows="exact"),
    "hssil-ramp": lambda: Plan(
        "a spot of a squared ramp beside one of the smoothstep", room(RAMP, SPOT, matte=True), (17, 13), MAPS,
        choices={"samples": 8, "radius": 2.0, "levels": 2, "seed": 4}, shadows="exact"),
}
FULL_PLANS: Plans = {
    "hssil-dark": lambda: Plan(
        "no direct light: all is 0", room(AWAY, matte=True), (18, 13), MAPS,
        choices={"samples": 8, "radius": 2.0, "levels": 2, "start": "quarter"}, shadows="exact"),
    "hssil-average": lambda: Plan(
        "levels of means by area; each texel has samples of its own", room(SPOT, BULB), (27, 19), MAPS, choices={
            "samples": 7, "radius": 2.0, "levels": 3, "seed": 6, "downsample": "average", "pattern": "pixel",
            "density": "uniform"}, shadows="exact"),
    "hssil-radiance": lambda: Plan(
        "the closest texels with the mean radiance of all; one mirror-symmetric set of samples, no blur",
        room(SPOT, BULB, matte=True, smooth=True), (30, 21), MAPS, choices={
            "samples": 10, "radius": 2.5, "levels": 3, "seed": 2, "downsample": "closest_average",
            "pattern": "fixed"}, shadows="exact"),
    "hssil-all": lambda: Plan(
        "every texel of disc and crown is a sample, no blur", room(BULB, matte=True), (18, 14), MAPS,
        choices={"radius": 2.0, "levels": 3, "pattern": "all"}, shadows="exact"),
    "hssil-colours": lambda: Plan(
        "vertex colours multiply the albedo, and so the light that senders send",
        coloured(room(SPOT, BULB, matte=True)), (20, 15), MAPS,
        choices={"samples": 8, "radius": 2.0, "levels": 2, "seed": 8}, shadows="exact"),
    "hssil-resampled": lambda: Plan(
        "the method's defaults: senders drawn in proportion to flux, discs that cover a quarter of what a sample "
        "stands for", room(SPOT, BULB, matte=True), (20, 15), MAPS,
        choices={"preset": "default", "samples": 8, "radius": 2.0, "levels": 3, "seed": 9}, shadows="exact"),
    "hssil-share": lambda: Plan(
        "samples that stand for less than a texel, whose discs cover all of it", room(SPOT, matte=True), (14, 11), MAPS,
        choices={"preset": "default", "samples": 60, "radius": 2.0, "levels": 2, "seed": 10, "downsample": "closest"},
        shadows="exact"),
}
QUICK: dict[str, Callable[[], Case]] = {
    **cases_of(QUICK_PLANS, "hssil", settings_of, finish=with_other_light),
    "hssil-temporal": lambda: coherent("hssil-temporal", "a camera that moves: fourth frame, surfaces found in 1 to 3 "
                                       "frames before, disoccluded ones"),
    "hssil-entering": lambda: coherent("hssil-entering", "a camera that turns: entering pixels, clamped light of the "
                                       "nearest texel"),
}
FULL: dict[str, Callable[[], Case]] = {
    **cases_of(FULL_PLANS, "hssil", settings_of, finish=with_other_light),
    "hssil-moving": lambda: coherent("hssil-moving", "a surface that moves by itself before a camera that moves too"),
}
