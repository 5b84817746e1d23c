"""Promises of what a camera sees of one huge floor: no holes, and depth, distance and position in closed form.

The camera stands at height h over a square of two triangles, in any of six attitudes of the whole, tilted and turned.
A pixel's ray (right, down, forward) meets the floor at depth t = h / -(its component upwards); the reference is that in
extended precision, of the camera's frame rounded to float64 as docs/conventions.md states it.

A scene x 2^k has the same bits, lengths apart: pictures are asked for this in part `pictures`, here G-buffer,
reflective shadow maps, face normals of smooth-shaded triangles, shadows and direct light are.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.stability.promise import Case, Promise
from refgi import Frame, load_scene
from refgi.rsm import shadow_map_visibility
from refgi.rsm.buffers.gbuffer import facing_normals
from refgi.scene import Camera, DirectionalLight, Geometry, Material, PointLight, Scene
from refgi.stress.changes import mapped
from refgi.types import Array

SIZE = 48  # pixels along a side
LARGEST_SHARE = 1e6  # half the floor's side over the camera's height
HORIZON = 1e-3  # rays that fall less than this are not asked
FRAME = 8.0  # roundings of the frame's vectors and of a ray's upward component, over which depth divides
STEPS = 12.0  # others


class Seen:
    """A floor and what a camera over it must see."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.height = 10 ** rng.uniform(-6, 3)
        self.share = 10 ** rng.uniform(0, np.log10(min(LARGEST_SHARE, 5e8 / self.height)))
        axis, sign = int(rng.integers(3)), float(rng.choice([-1.0, 1.0]))
        turn = np.roll(np.eye(3), axis, axis=0)  # rows: two along the floor, one upwards
        along, over, up = turn[0], turn[1], sign * turn[2]
        half = self.share * self.height
        corners = np.array([a * along * half + b * over * half for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        middle = half * rng.uniform(-0.3, 0.3, 2)
        eye = self.height * up + middle[0] * along + middle[1] * over
        down = rng.uniform(0.2, 1.0) if rng.random() < 0.8 else 1.0
        way = np.sqrt(1 - down * down) * (along * np.cos(t := rng.uniform(0, 6.28)) + over * np.sin(t)) - down * up
        self.camera = Camera(tuple(eye), tuple(eye + way * max(1.0, self.height)),
                             tuple(along if down > 0.9 else up), np.radians(rng.uniform(1, 100)), SIZE, SIZE)
        floor = Geometry(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.int64))
        self.scene = Scene("floor", floor, (Material("floor", (0.5, 0.5, 0.5)),), self.camera,
                           (PointLight(tuple(eye), (1.0, 1.0, 1.0)),))
        self._ends, self._up = (along, over, half), up

    def exact(self) -> tuple[Array, Array, Array, Array]:
        """Return depth, distance and position (3) at each pixel, and the condition; NaN where nothing is asked."""
        camera = self.camera
        ahead = np.subtract(camera.target, camera.eye)
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, np.divide(camera.up, np.linalg.norm(camera.up)))
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(ahead, right), ahead]).astype(np.longdouble)
        half = np.longdouble(np.tan(camera.vfov / 2))
        place = ((np.arange(SIZE) + np.longdouble(0.5)) * 2 / SIZE - 1) * half
        u, v = np.meshgrid(place, place)
        ray = u * frame[0][:, None, None] + v * frame[1][:, None, None] + frame[2][:, None, None]
        (along, over, end), up = self._ends, self._up
        falls = -np.einsum("c,chw->hw", up, ray)
        height = np.longdouble(np.dot(up, camera.eye))
        with np.errstate(all="ignore"):
            depth = height / falls
            at = np.asarray(camera.eye, np.longdouble)[:, None, None] + depth * ray
            size = (1 + abs(u) + abs(v)) / falls
            inside = np.maximum(abs(np.einsum("c,chw->hw", along, at)), abs(np.einsum("c,chw->hw", over, at)))
        asked = (falls > HORIZON) & (inside < end * (1 - 1e-6))
        hidden = np.where(asked, 0, np.longdouble(np.nan))
        return depth + hidden, depth * np.sqrt((ray * ray).sum(axis=0)) + hidden, at + hidden, size


def holes(rng: np.random.Generator) -> Case:
    """Return how many pixels that look at the floor see none."""
    seen = Seen(rng)
    depth, *_ = seen.exact()
    covered = Frame(seen.scene, width=SIZE, height=SIZE).gbuffer.covered
    asked = ~np.isnan(depth)
    missed = int(np.count_nonzero(asked & ~covered))
    return Case(missed, f"{seen.share:.3g} heights of {seen.height:.3g} m to its edge: {missed} of "
                        f"{np.count_nonzero(asked)} pixels see no floor")


def off_plane(dtype: Any, rng: np.random.Generator) -> Case:
    """Return the error of depth, distance and position over its bound."""
    seen = Seen(rng)
    depth, distance, place, condition = seen.exact()
    buffer = Frame(seen.scene, width=SIZE, height=SIZE, dtype=dtype).gbuffer
    eye = np.abs(seen.camera.eye).max()
    u64, last = 2.0**-53, float(np.finfo(dtype).eps)
    relative = (STEPS + FRAME * condition) * u64 + last / 2
    worst = 0.0
    with np.errstate(all="ignore"):
        for got, exact, scale in ((buffer.depth, depth, depth), (buffer.distance, distance, distance),
                                  (buffer.position, place, distance + eye)):
            off = abs(got - exact) / (scale * relative)
            worst = max(worst, float(np.nanmax(np.where(buffer.covered & ~np.isnan(exact), off, 0))))
    return Case(worst, f"{seen.share:.3g} heights of {seen.height:.3g} m to its edge: {worst:.3g} of the bound")


DOMAIN = "camera 1e-6 .. 1e3 m over a square of two triangles, 1 to 1e6 heights to its edge, 1 to 100 degrees"
BOUND = "8 roundings of the frame over the ray's fall, 12 others in float64, half a ULP of the buffer"


POWERS = (-24, -13, 11, 26)  # a camera needs a target 1e-9 m off and more, places end at 1e9 m
MAP = 64
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
    Promise("floor.holes", "pixels of a floor that see none", "G-buffer", DOMAIN, holes, "pixels", 0, "exact",
            "a triangle is seen from a share of 1e-9 of its size and more", 1500, 40, adds=True),
    Promise("floor.float32", "float32 depth, distance, position of a plane", "G-buffer", DOMAIN,
            lambda rng: off_plane(np.float32, rng), "of the bound", 1.0, "derived", BOUND, 700, 20),
    Promise("floor.float64", "float64 depth, distance, position of a plane", "G-buffer", DOMAIN,
            lambda rng: off_plane(np.float64, rng), "of the bound", 1.0, "derived", BOUND, 700, 20),
    Promise("buffers.unit", "length x 2^k, numbers that differ", "buffers, shadows, direct light",
            "built-in scenes, spot, point and directional light, 2^-24 .. 2^26, float32 and float64", other_unit,
            "numbers", 0, "exact", "a power of two rounds nothing, and no step knows a length of its own", 150, 12,
            adds=True),
)
