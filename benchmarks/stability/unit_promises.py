"""Promises of buffers in other units of length: a scene x 2^k has the same bits, lengths apart.

Pictures of indirect light are asked for this in part `pictures`; here it is what comes before them and beside them:
G-buffer, reflective shadow maps, face normals of smooth-shaded triangles, shadows and direct light.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.stability.promise import Case, Promise
from refgi import Frame, load_scene
from refgi.rsm import shadow_map_visibility
from refgi.rsm.buffers.facing import facing_normals
from refgi.scene import DirectionalLight, PointLight, Scene
from refgi.stress.changes import mapped

Array = npt.NDArray[Any]
POWERS = (-24, -13, 11, 26)  # a camera needs a target 1e-9 m off and more, places end at 1e9 m
SIZE, MAP = 48, 64
SCENES = ("cornell_box", "stage:faces=600", "ring:faces=600")


def lamps(scene: Scene) -> tuple[Any, ...]:
    """Return the scene's lamp, a point at its place and parallel light along its axis."""
    spot = scene.lights[0]
    return spot, PointLight(spot.position, spot.intensity), DirectionalLight(spot.direction, spot.intensity)


def buffers(scene: Scene, dtype: Any) -> Iterator[tuple[str, int, Array]]:
    """Yield name, power of length and numbers of each buffer."""
    frame = Frame(scene, width=SIZE, height=SIZE, dtype=dtype, rsm_resolution=MAP)
    seen, rsm = frame.gbuffer, frame.rsms[0]
    for of, buffer in (("", seen), ("map's ", rsm)):
        depth, place, normal = buffer.resolve("depth", "position", "normal")
        yield f"{of}depth", 1, depth
        yield f"{of}position", 1, place
        yield f"{of}normal", 0, normal
        yield f"{of}triangles", 0, buffer.triangle_id
    yield "face normals", 0, facing_normals(scene.geometry, seen.triangle_id, seen.normal)
    yield "shadows", 0, shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm)
    yield "direct light", 0, frame.direct
    yield "map's flux", 2, rsm.flux


def other_unit(rng: np.random.Generator) -> Case:
    """Return how many numbers of a scene's buffers differ from those in another unit."""
    name, dtype = str(rng.choice(SCENES)), (np.float32, np.float64)[int(rng.integers(2))]
    power, which = int(rng.choice(POWERS)), int(rng.integers(3))
    scene = load_scene(name)
    scene = scene.with_lights(lamps(scene)[which])
    factor = 2.0**power
    of_light = 1.0 if which == 2 else factor**2  # irradiance stays
    other = mapped(scene, lambda p: p * factor, power=of_light)
    wrong = {}
    for (key, length, one), (_, _, two) in zip(buffers(scene, dtype), buffers(other, dtype), strict=True):
        back = two if length == 0 else two / two.dtype.type(factor**length)
        differ = int(np.count_nonzero((one != back) & ~((one != one) & (back != back))))
        if differ:
            wrong[key] = differ
    what = f"{name}, {('spot', 'point', 'directional')[which]}, x 2^{power}, {np.dtype(dtype)}"
    return Case(sum(wrong.values()), f"{what}: {wrong or 'all the same'}")


PROMISES = (
    Promise("buffers.unit", "length x 2^k, numbers that differ", "buffers, shadows, direct light",
            "built-in scenes, spot, point and directional light, 2^-24 .. 2^26, float32 and float64", other_unit,
            "numbers", 0, "exact", "a power of two rounds nothing, and no step knows a length of its own", 150, 12,
            adds=True),
)
