"""Stand-ins of the paper's face counts: a four-legged body in the Cornell box and in the atrium, a blob, plain boxes.

The body is cut from a field of balls along a skeleton, as the built-in metaballs are, so that it has legs and a neck
that throw thin shadows beside a trunk that throws a broad one.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from refgi.scene import Camera, Material, Mesh, Scene, SpotLight, load_scene
from refgi.scene.builtin.cornell import CAMERA, cornell_box, shell
from refgi.scene.builtin.metaballs import HALF_SIZE, MIDDLE, Balls, blob, metaballs
from refgi.scene.model import merge

Array = npt.NDArray[np.float64]

HIDE = Material("hide", (0.6, 0.55, 0.48))
FIELD_CUBE = 2.2  # units of the skeleton along a side of the grid
# joints of the skeleton, x ahead, y up, z aside, and radii there; each row is a limb from joint to joint
TRUNK = ((-0.42, 0.86, 0.0, 0.2), (0.36, 0.9, 0.0, 0.2))
NECK = ((0.42, 1.0, 0.0, 0.14), (0.72, 1.42, 0.0, 0.085))
HEAD = ((0.72, 1.45, 0.0, 0.09), (0.95, 1.28, 0.0, 0.06))
TAIL = ((-0.58, 0.92, 0.0, 0.06), (-0.78, 0.45, 0.0, 0.04))
LEGS = ((-0.42, 0.16), (-0.4, -0.16), (0.38, 0.15), (0.36, -0.15))  # where they leave the trunk: x, z
BALLS_A_LIMB = 9
BODY_CELLS = 55  # along the grid of its field: 17 thousand faces with the box
ATRIUM_FACES = 98_000
MOVING_CELLS, MOVING_ATRIUM_FACES = 28, 90_500  # 100 thousand faces in all
BLOB_CELLS = 22  # 5.1 thousand faces

WIDE, NARROW = math.radians(62), math.radians(12)  # half-angles of Figure 13's spots


@cache
def body(cells: int = BODY_CELLS, stride: float = 0.0) -> Mesh:
    """Build the body, 1.6 units high, standing on y = 0 above the origin and looking along x.

    Parameters
    ----------
    cells : int
        Along each side of the field's grid.
    stride : float
        How far its legs swing, rad.

    Returns
    -------
    Mesh
        Watertight, with smooth normals.
    """
    limbs = [TRUNK, NECK, HEAD, TAIL, *(_leg(x, z, stride * side) for (x, z), side in zip(LEGS, (1, -1, -1, 1),
                                                                                          strict=True))]
    balls = np.concatenate([np.linspace(*limb, BALLS_A_LIMB) for limb in limbs])
    scale = 2 * HALF_SIZE / FIELD_CUBE
    foot = MIDDLE - np.array([0.0, 0.8 * scale, 0.0])
    cut = blob(Balls(foot + scale * balls[:, :3], 0.8 * scale * balls[:, 3]), cells)
    vertices = (np.asarray(cut.vertices) - foot) / scale
    vertices[:, 1] -= vertices[:, 1].min()
    return dataclasses.replace(cut, vertices=vertices, material=HIDE, name="body")


def placed(mesh: Mesh, at: tuple[float, float, float], size: float, turn: float) -> Mesh:
    """Scale a mesh, turn it about y and move it.

    Parameters
    ----------
    mesh : Mesh
        Any, with normals.
    at : tuple of float
        Where its origin goes, m.
    size : float
        Metres a unit.
    turn : float
        Angle, rad.

    Returns
    -------
    Mesh
        In the scene's place.
    """
    rotation = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    normals = None if mesh.normals is None else np.asarray(mesh.normals) @ rotation.T
    return dataclasses.replace(mesh, vertices=size * np.asarray(mesh.vertices) @ rotation.T + np.asarray(at),
                               normals=normals)


def horse() -> Scene:
    """Build the stand-in for the Cornell box with a horse.

    Returns
    -------
    Scene
        About 17 thousand faces, 4 materials.
    """
    return _boxed("horse", SpotLight((0.1, 0.5, 0.03), (0.62, -0.38, 0.68), math.radians(24), math.radians(34),
                                     (0.9, 0.85, 0.76)), "A four-legged body in the Cornell box.")


def corner() -> Scene:
    """Build Figure 9's scene: the body in the box and a spot at one of the box's corners.

    Returns
    -------
    Scene
        As `horse`, lit otherwise.
    """
    light = SpotLight((0.3, 0.3, 0.02), (0.42, 0.28, 0.86), math.radians(15), math.radians(21), (1.6, 1.5, 1.35))
    return _boxed("corner", light, "A spot at a corner of the box: most of the light is indirect.")


def spot(half_angle: float) -> Scene:
    """Build Figure 13's scene: the body and a spot at the left wall.

    Parameters
    ----------
    half_angle : float
        Of the spot, rad; its flux is the same for all.

    Returns
    -------
    Scene
        As `horse`, lit otherwise.
    """
    strength = 0.35 / (1 - math.cos(half_angle))
    colour = (strength * 0.33, strength * 0.31, strength * 0.28)
    light = SpotLight((0.3, 0.34, 0.06), (0.95, 0.02, 0.3), 0.9 * half_angle, half_angle, colour)
    return _boxed("spot", light, f"A spot of {math.degrees(2 * half_angle):.0f} degrees at the left wall.")


def plain_box() -> Scene:
    """Build the Cornell box with its two blocks.

    Returns
    -------
    Scene
        30 faces.
    """
    return cornell_box()


def atrium() -> Scene:
    """Build the stand-in for Sponza.

    Returns
    -------
    Scene
        About 98 thousand faces.
    """
    return load_scene(f"atrium:faces={ATRIUM_FACES}")


def blob_at(t: float) -> Scene:
    """Build the scene of Figure 12 at a time.

    Parameters
    ----------
    t : float
        The motion repeats after 1.

    Returns
    -------
    Scene
        About 5.1 thousand faces; their number and how they hang together change with time.
    """
    return metaballs(t, BLOB_CELLS)


def march(t: float) -> Scene:
    """Build Figure 11's scene at a time: two bodies that walk through the atrium.

    Parameters
    ----------
    t : float
        0 to 1: a way of two metres.

    Returns
    -------
    Scene
        About 100 thousand faces.
    """
    hall = load_scene(f"atrium:faces={MOVING_ATRIUM_FACES}")
    pieces = [placed(body(MOVING_CELLS, 0.35 * math.sin(2 * math.pi * t + n)), (x + along * t, 0.0, z), 1.15, turn)
              for n, (x, z, along, turn) in enumerate(((-5.2, -0.2, 2.0, 0.0), (1.5, -1.1, -2.0, math.pi - 0.5)))]
    geometry, materials = merge([_whole(hall), *pieces])
    of = np.concatenate([hall.geometry.material_of_face,
                         np.full(sum(len(p.faces) for p in pieces), len(hall.materials), np.int32)])
    geometry = dataclasses.replace(geometry, material_of_face=of)
    return dataclasses.replace(hall, name="march", geometry=geometry, materials=(*hall.materials, materials[-1]),
                               camera=Camera((-9.2, 2.3, 1.3), (2.0, 1.6, -0.4), vfov=math.radians(52)))


def _leg(x: float, z: float, swing: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    reach = 0.72
    foot = (x + reach * math.sin(swing), 0.8 - reach * math.cos(swing), z, 0.055)
    return (x, 0.78, z, 0.095), foot


def _boxed(name: str, light: SpotLight, said: str) -> Scene:
    geometry, materials = merge([*shell(), placed(body(), (0.27, 0.0, 0.3), 0.21, math.radians(-35))], smooth=True)
    return Scene(name, geometry, materials, CAMERA, (light,), said, exposure=1.3)


def _whole(scene: Scene) -> Mesh:
    return Mesh(scene.geometry.vertices, scene.geometry.faces, None, scene.materials[0], scene.name)


BUILDERS: dict[str, Callable[[], Scene]] = {
    "horse": horse, "corner": corner, "plain box": plain_box, "atrium": atrium, "blob": lambda: blob_at(0.0),
    "march": lambda: march(0.0), "wide": lambda: spot(WIDE), "narrow": lambda: spot(NARROW)}
