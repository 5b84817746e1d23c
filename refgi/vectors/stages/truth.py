"""Stage of the ground truth: path-traced irradiance of a small picture with its variance (tier T3).

A port has random numbers of its own: its mean and the variance of its mean are judged together with these, by the
difference over the standard error of both.
"""

import dataclasses
from typing import Any

import numpy as np

from refgi.rays import Tracer
from refgi.scene import Material, Scene
from refgi.settings import flat, replaced
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import accumulate
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import REFLECTANCE, SCENE, _light_names, _map_names, geometry_of, light_of
from refgi.vectors.stages.direct import POINTS

RADIOMETRY = "docs/radiometry: E = integral of L cos over the hemisphere, L = albedo/pi of the direct irradiance there"
NAMES = ("truth.mean", "truth.variance_of_mean", "truth.samples")


def add_truth(recipe: Recipe, scene: Scene, settings: TruthSettings) -> None:
    """Add the path-traced irradiance of the picture."""
    lamps = [(f"light{k}", light) for k, light in enumerate(scene.lights)]
    lights = [name for lamp, light in lamps for name in _light_names(lamp, light)]
    normals = ("scene.vertex_normals",) if "scene.vertex_normals" in recipe.specs else ()
    reads = (*SCENE, *normals, *REFLECTANCE, *lights, *POINTS, *_map_names("camera"))

    def run(arrays: Arrays, real: Any, how: TruthSettings = settings) -> Arrays:
        given = dataclasses.replace(scene, geometry=geometry_of(arrays, scene), materials=_materials(arrays, scene),
                                    lights=tuple(light_of(arrays, lamp, light) for lamp, light in lamps))
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in POINTS[:2])
        found = accumulate(given, Tracer(given.geometry), position, normal, np.asarray(arrays[POINTS[2]]), how)
        return dict(zip(NAMES, (found.mean, found.variance_of_mean, found.samples), strict=True))

    def changed(**values: Any) -> Run:
        return lambda a, r: run(a, r, replaced(settings, values))

    def scaled(factor: float) -> Run:
        return writing(run, truth__mean=lambda a: a * factor, truth__variance_of_mean=lambda a: a * factor**2)

    def with_direct(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        return {**made, NAMES[0]: made[NAMES[0]] + arrays["direct.irradiance"]}

    bright = {name.replace(".", "__"): _doubled for name in lights if name.endswith(("intensity", "irradiance"))}
    bugs = [
        Bug("the emitter's radiance lacks 1/pi", scaled(np.pi), RADIOMETRY),
        Bug("irradiance is divided by pi", scaled(1 / np.pi), "E excludes the receiver's albedo/pi"),
        Bug("lights are twice as bright", reading(run, **bright), RADIOMETRY),
        Bug("the emitter's albedo is left out", reading(run, materials__diffuse=_white, materials__specular=(
            np.zeros_like)), RADIOMETRY),
        Bug("direct light is added", with_direct, "one bounce alone"),
        Bug("the receiver's normal points inwards", reading(run, gbuffer__normal=lambda a: -a), RADIOMETRY),
    ]
    if settings.bounces > 1:
        bugs.append(Bug("one bounce less", changed(bounces=settings.bounces - 1), "number of bounces: a fact"))
    elif settings.visibility and settings.emitters == "all":
        bugs.append(Bug("one bounce more", changed(bounces=2), "number of bounces: a fact of the case"))
    else:
        bugs.append(Bug("all surfaces emit and block", changed(visibility=True, emitters="all"),
                        "facts of the case"))
    if settings.visibility and settings.bounces == 1:
        bugs.append(Bug("nothing blocks between emitter and receiver", changed(visibility=False), RADIOMETRY))
    if np.any(recipe.given[REFLECTANCE[1]] > 0):
        bugs.append(Bug("lobes are missing", reading(run, materials__specular=np.zeros_like), "SII Eq. 3"))
    if len(lamps) > 1:
        last = next(name for name in reversed(lights) if name.endswith(("intensity", "irradiance")))
        bugs.append(Bug("the last light is left out", reading(run, **{last.replace(".", "__"): np.zeros_like}),
                        "all lights"))
    recipe.facts["truth"] = {key: value for key, value in flat(settings).items()
                             if isinstance(value, bool | int | float | str)}
    recipe.add("truth", "irradiance by light of so many bounces before the pixel, and the variance of this estimate; "
               "without direct light and the receiver's albedo/pi", run, (*reads, "direct.irradiance"), {
                   NAMES[0]: Spec("rgb, row, column", "W/m^2", "mean of all samples", "linear RGB", RADIOMETRY, "T3"),
                   NAMES[1]: Spec("rgb, row, column", "(W/m^2)^2", "estimated variance of that mean; 0 without surface",
                                  "linear RGB", RADIOMETRY, "T3"),
                   NAMES[2]: Spec("row, column", "1", "samples of each pixel; 0 without surface", tier="T3"),
               }, paper=RADIOMETRY, exact=("scene.vertices", POINTS[0]), bugs=tuple(bugs))


def deviation(mean: Array, variance: Array, other_mean: Array, other_variance: Array) -> float:
    """Return the mean square of what two estimates differ by over the standard error of both: about 1 if they agree.

    Values that neither has an error of, such as pixels without surface, must be equal: inf if they are not.
    """
    both = np.asarray(variance, np.float64) + other_variance
    apart = np.asarray(mean, np.float64) - other_mean
    if np.any(apart[both == 0] != 0):
        return np.inf
    return float((apart[both > 0] ** 2 / both[both > 0]).mean()) if np.any(both > 0) else 0.0


def _materials(arrays: Arrays, scene: Scene) -> tuple[Material, ...]:
    rows = zip(*(np.asarray(arrays[name], np.float64).tolist() for name in REFLECTANCE), strict=True)
    return tuple(Material(material.name, tuple(diffuse), tuple(specular), exponent)
                 for material, (diffuse, specular, exponent) in zip(scene.materials, rows, strict=True))


def _doubled(array: Array) -> Array:
    return np.asarray(2 * array)


def _white(array: Array) -> Array:
    return np.ones_like(array)
