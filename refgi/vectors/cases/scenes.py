"""The scenes of the kits, small and without symmetry, and cases as plans of what they differ in."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from refgi.frame import Shadows
from refgi.scene import Camera, DirectionalLight, Geometry, Material, Mesh, PointLight, Scene, SpotLight, merge
from refgi.types import Array
from refgi.vectors.recorded import recorded_case
from refgi.vectors.spec import Case


class Plan(NamedTuple):
    """A case in the making."""

    what: str
    scene: Scene
    size: tuple[int, int]  # columns and rows of the picture
    maps: int  # texels along the side of a map
    lights: int = 0  # pixel lights of each map
    choices: Mapping[str, Any] = MappingProxyType({})  # settings by their keys
    shadows: Shadows | None = None  # of direct light; None: as a frame has them by default


Plans = Mapping[str, Callable[[], Plan]]


@dataclass(frozen=True)
class Planned:
    """What makes a case: a method as planned, from the scene to the indirect irradiance."""

    id: str
    method: str
    plan: Callable[[], Plan]  # its scene is built when the case is
    settings: Callable[[Plan], Any]
    finish: Callable[[Case], Case] = lambda case: case

    def __call__(self) -> Case:
        """Return the case."""
        plan = self.plan()
        return self.finish(recorded_case(
            self.id, plan.scene, self.method, self.settings(plan), what=plan.what, indirect=True, width=plan.size[0],
            height=plan.size[1], rsm_resolution=plan.maps, shadows=plan.shadows))


def cases_of(plans: Plans, method: str, settings: Callable[[Plan], Any], **more: Any) -> dict[str, Planned]:
    """Return what makes the planned cases of a method, by id."""
    return {id: Planned(id, method, plan, settings, **more) for id, plan in plans.items()}


# strongest and weakest differ by a factor of 8 and in hue, so that neither order nor channel can be mistaken
SPOT = SpotLight((0.5, 1.5, 0.625), (-0.6, -0.8, -0.7), 0.4, 0.8, (4.0, 2.6, 1.3))
BULB = PointLight((0.2, 0.9, 0.3), (0.1, 0.25, 0.5))
SUN = DirectionalLight((-0.5, -0.9, -0.3), (0.5, 0.3, 0.9))
DOWN = SpotLight((0.1, 1.7, 0.2), (0.0, -1.0, 0.0), 0.3, 0.7, (3.0, 1.0, 2.0))  # along the frame's usual up
VIEW = Camera((1.7, 1.4, 1.5), (-0.4, 0.35, -0.5), (0.1, 1.0, 0.0), math.radians(70))  # rolled
RAMP = SpotLight((-0.1, 1.6, 0.3), (0.2, -1.0, -0.5), 0.1, 0.8, (1.5, 3.0, 2.0), "squared_ramp")  # glTF's falloff
BEHIND = SpotLight((-0.9, 1.1, -0.7), (0.9, -0.35, 0.8), 0.5, 0.9, (4.0, 0.0, 1.3))  # no green, half void
UNDER = SpotLight((0.1, 0.45, -0.3), (0.3, -0.6, 0.7), 0.4, 1.0, (0.5, 1.0, 0.3))  # the shelf is behind it
AWAY = SpotLight((1.5, 1.5, 0.5), (1.0, 0.2, 0.1), 0.2, 0.5, (4.0, 2.0, 1.0))  # into the void
POLE = Camera((0.2, 2.5, 0.1), (0.2, 0.0, 0.1), (0.0, 0.0, -1.0), math.radians(50))  # straight down

FLOOR = Material("floor", (0.6, 0.55, 0.4))
WALL = Material("glossy wall", (0.3, 0.2, 0.4), (0.4, 0.5, 0.2), 12.0)
SIDE = Material("side wall", (0.1, 0.6, 0.2))
BLOCK = Material("purely glossy", (0.0, 0.0, 0.0), (0.7, 0.5, 0.6), 4.0)
BALL = Material("ball", (0.5, 0.3, 0.2), (0.2, 0.3, 0.4), 20.0)


def room(*lights: Any, matte: bool = False, smooth: bool = False, camera: Camera = VIEW) -> Scene:
    """Return a corner with a floor, a glossy wall and a side wall, a purely glossy shelf, a box's lid wound inwards.

    `matte`: without lobes. `smooth`: with a ball and interpolated normals.
    """
    def painted(material: Material) -> Material:
        if not matte:
            return material
        diffuse = material.diffuse if any(material.diffuse) else material.specular
        return dataclasses.replace(material, diffuse=diffuse, specular=(0.0, 0.0, 0.0))

    meshes = [
        quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), painted(FLOOR)),
        quad((-1, 0, -1), (2, 0, 0), (0, 2, 0), painted(WALL)),
        quad((-1, 0, 1), (0, 0, -2), (0, 2, 0), painted(SIDE)),
        quad((-0.4, 0.5, -0.1), (0.6, 0, 0), (0, 0, -0.5), painted(BLOCK)),
        # wound inwards:
        quad((0.3, 0.3, 0.5), (0.25, 0, -0.35), (0.35, 0.05, 0.3), painted(FLOOR)),
    ]
    if smooth:
        meshes.append(ball((-0.5, 0.35, 0.3), 0.3, painted(BALL)))
    geometry, materials = merge(meshes, smooth=smooth)
    return stored_scene(Scene("kit room", geometry, materials, camera, lights))


def coloured(scene: Scene) -> Scene:
    """Return a scene with vertex colours, other ones at each vertex and in each channel."""
    count = len(scene.geometry.vertices)
    colours = 0.08 + 0.9 * (np.arange(3 * count) * 0.6180339887498949 % 1).reshape(count, 3)
    geometry = dataclasses.replace(scene.geometry, colours=colours[scene.geometry.faces])
    return stored_scene(dataclasses.replace(scene, geometry=geometry))


def kerbs(*lights: Any, camera: Camera = VIEW) -> Scene:
    """Return a floor before a wall with four slanted kerbs on it: seen from the floor they reach down to its plane."""
    geometry, materials = merge([quad(*sides) for sides in (
        ((-1, 0, 1), (2, 0, 0), (0, 0, -2), FLOOR),
        ((-1, 0, -1), (2, 0, 0), (0, 2, 0), SIDE),
        ((-0.7, 0, 0.55), (0.05, 0, -1.15), (-0.03, 0.17, 0), FLOOR),
        ((-0.6, 0.02, -0.62), (1.1, 0, 0.08), (0, 0.14, -0.04), SIDE),
        ((0.52, 0.01, -0.5), (-0.06, 0, 1), (0.03, 0.12, 0), FLOOR),
        ((0.4, 0, 0.6), (-1, 0, 0.05), (0, 0.15, 0.03), SIDE))], smooth=False)
    return stored_scene(Scene("kit kerbs", geometry, materials, camera, lights))


def stacked(*lights: Any, camera: Camera = VIEW) -> Scene:
    """Return a floor, a wall, a slanted table top and a slab below it: lights on the top have a surface behind them."""
    geometry, materials = merge([quad(*sides) for sides in (
        ((-1, 0, 1), (2, 0, 0), (0, 0, -2), FLOOR),
        ((-1, 0, -1), (2, 0, 0), (0, 2, 0), SIDE),
        ((-0.35, 0.7, 0.3), (0.7, 0.06, 0.05), (0.02, 0.04, -0.65), FLOOR),
        ((-0.25, 0.42, 0.1), (0.4, -0.05, 0.04), (0.05, 0.03, -0.35), SIDE))], smooth=False)
    return stored_scene(Scene("kit stack", geometry, materials, camera, lights))


def sheet(*lights: Any) -> Scene:
    """Return a slanted plate and a slanted sheet on it between camera and lamp: no normal along an axis, void around.

    The sheet is seen from one side and lit from the other; what lies at its foot receives at grazing angles.
    """
    geometry, materials = merge([quad(*sides) for sides in (
        ((-0.8, 0.05, 0.9), (1.7, 0.25, -0.1), (-0.1, 0.2, -1.6), FLOOR),
        ((-0.2, 0.24, 0.25), (0.55, 0.1, -0.4), (0.05, 0.55, 0.12), WALL))], smooth=False)
    near = dataclasses.replace(VIEW, vfov=math.radians(36))
    return stored_scene(Scene("kit sheet", geometry, materials, near, lights))


def far_away(scene: Scene, offset: float) -> Scene:
    """Return a scene moved along x, m, with all that it holds in float32."""
    move = (offset, 0.0, 0.0)

    def moved(point: Any) -> Any:
        return tuple(np.add(point, move).tolist())

    camera = dataclasses.replace(scene.camera, eye=moved(scene.camera.eye), target=moved(scene.camera.target))
    lights = tuple(light if isinstance(light, DirectionalLight) else
                   dataclasses.replace(light, position=moved(light.position)) for light in scene.lights)
    geometry = dataclasses.replace(scene.geometry, vertices=scene.geometry.vertices + move)
    return stored_scene(dataclasses.replace(scene, geometry=geometry, camera=camera, lights=lights))


def stored_scene(scene: Scene) -> Scene:
    """Return a scene whose numbers are all floats of 32 bits, as the kit holds them."""
    def rounded(value: Any) -> Any:
        return tuple(np.asarray(value, np.float32).astype(np.float64).tolist()) if isinstance(value, tuple) else float(
            np.float32(value))

    def each(part: Any, *names: str) -> Any:
        return dataclasses.replace(part, **{name: rounded(getattr(part, name)) for name in names
                                            if hasattr(part, name)})

    geometry, normals, colours = scene.geometry, scene.geometry.vertex_normals, scene.geometry.colours
    return dataclasses.replace(
        scene, geometry=Geometry(_single(geometry.vertices), geometry.faces, geometry.material_of_face,
                                 None if normals is None else _single(normals),
                                 colours=None if colours is None else _single(colours)),
        materials=tuple(each(one, "diffuse", "specular", "exponent") for one in scene.materials),
        camera=each(scene.camera, "eye", "target", "up", "vfov"),
        lights=tuple(each(light, "position", "direction", "intensity", "irradiance", "inner_half_angle",
                          "outer_half_angle") for light in scene.lights))


def quad(corner: Any, u: Any, v: Any, material: Material) -> Mesh:
    """Return a parallelogram of two triangles that faces u x v."""
    c, u, v = (np.asarray(one, np.float64) for one in (corner, u, v))
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return Mesh(np.array([c, c + u, c + u + v, c + v]), np.array([[0, 1, 2], [0, 2, 3]]), np.tile(normal, (4, 1)),
                material)


def ball(center: Any, radius: float, material: Material) -> Mesh:
    """Return an octahedron's eight faces cut in four each, pushed out to a sphere."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(a, b, c) if np.linalg.det(axes[[a, b, c]]) > 0 else (a, c, b) for a in (0, 3) for b in (1, 4)
             for c in (2, 5)]
    corners: list[Array] = []
    for face in faces:
        p, q, r = axes[list(face)]
        corners += [p, p + q, r + p, p + q, q, q + r, r + p, q + r, r, p + q, q + r, r + p]
    points = np.asarray(corners)
    points /= np.linalg.norm(points, axis=1)[:, None]
    return Mesh(np.asarray(center) + radius * points, np.arange(len(points)).reshape(-1, 3), points, material)


def _single(array: Array) -> Array:
    return np.asarray(array, np.float32).astype(np.float64)
