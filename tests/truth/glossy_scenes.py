"""Small scenes of glossy senders of every exponent: near and far, flat and curved, and lamps of every kind.

All lie in a room of 2 m, or beside one; pictures are 24 x 18 pixels. `reference` holds the irradiance of every pixel by
`tests.naive.face_quadrature`, or what a scene's own lobes reflect to the eye, stored in glossy_references.npz; `python
-m tests.truth.glossy_scenes` makes it again.
"""

import dataclasses
import math
import sys
from functools import cache
from pathlib import Path

import numpy as np

from refgi.frame import Frame
from refgi.scene import Camera, DirectionalLight, Material, Mesh, PointLight, Scene, SpotLight, merge
from refgi.scene.builtin.surfaces import sphere
from tests.naive.face_quadrature import glossy_of, irradiance, receivers_of, reflected
from tests.truth.scenes import rectangle

REFERENCES = Path(__file__).with_name("glossy_references.npz")
GREY = Material("grey", (0.5, 0.5, 0.5))
WALL = Material("wall", (0.6, 0.3, 0.2))
ROOM = Camera((0.9, 1.1, 1.6), (-0.3, 0.35, -0.5), vfov=math.radians(50), width=24, height=18)
INTO_THE_CORNER = Camera((-0.5, 0.4, -0.4), (-0.95, 0.02, -0.95), vfov=math.radians(40), width=24, height=18)


def lobe(exponent, specular=(0.7, 0.6, 0.5), diffuse=(0.1, 0.15, 0.2)):
    return Material(f"lobe {exponent:g}", diffuse, specular, exponent)


def room(floor, back, left=None):
    """Return a floor and two walls that meet in a corner."""
    return [rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), floor), rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), back),
            rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), left or back)]


def block(corner, along, height, across, material):
    """Return a block without its underside, standing on a corner."""
    corner, along, height, across = (np.asarray(v, float) for v in (corner, along, height, across))
    top = corner + height
    return [rectangle(top, along, across, material), rectangle(corner, along, height, material),
            rectangle(corner + across, height, along, material), rectangle(corner, height, across, material),
            rectangle(corner + along, across, height, material)]


def rounded_block(center, half, material):
    """Return a block whose corners' normals point away from its middle, as smoothing an export leaves them."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    faces = sides[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return Mesh(np.asarray(center) + signs * half, faces, signs / math.sqrt(3), material)


def made(name, meshes, camera, *lights):
    geometry, materials = merge(meshes, smooth=any(mesh.normals is not None for mesh in meshes))
    return Scene(name, geometry, materials, camera, lights)


def diffuse(name):
    """No lobe at all: what the tests say of a truth that is right."""
    return made(name, [*room(GREY, WALL), *block((-0.7, 0, -0.3), (0.5, 0, 0.1), (0, 0.5, 0), (-0.1, 0, -0.4), GREY)],
                ROOM, PointLight((0.3, 1.4, 0.4), (1.0, 1.5, 2.0)))


def far_wall(name):
    """A wall of 60, floor and block far from it; a spot that lights the wall alone."""
    shapes = [*room(GREY, lobe(60.0), WALL), *block((0.1, 0, 0.1), (0.4, 0, 0.1), (0, 0.4, 0), (-0.1, 0, 0.4), GREY)]
    return made(name, shapes, ROOM, SpotLight((0.7, 1.5, 0.6), (-0.3, -0.4, -1.0), 0.3, 0.5, (3.0, 2.0, 1.5)))


def corner(name):
    """Floor and walls of 200, seen where they meet: the nearest pixels lie a few mm from the next wall."""
    return made(name, room(lobe(200.0), lobe(200.0, (0.5, 0.6, 0.7))), INTO_THE_CORNER,
                PointLight((-0.2, 0.8, 0.1), (1.0, 1.5, 2.0)))


def corner_600_900(name):
    """A floor of 600 and walls of 900, a corner, and a lamp of each kind."""
    return made(name, room(lobe(600.0), lobe(900.0)), dataclasses.replace(INTO_THE_CORNER, eye=(-0.1, 0.7, 0.2)),
                PointLight((0.4, 1.1, 0.3), (1.0, 0.5, 0.2)),
                SpotLight((-0.3, 1.5, 0.6), (-0.3, -1.0, -0.9), 0.2, 0.4, (0.5, 1.0, 2.0)),
                DirectionalLight((-0.5, -1.0, -0.7), (0.4, 0.4, 0.6)))


def lamp_close(name):
    """A point lamp 2 cm above a floor of 20."""
    shapes = [*room(lobe(20.0), WALL), *block((-0.7, 0, -0.6), (0.4, 0, 0.1), (0, 0.5, 0), (-0.1, 0, -0.3), GREY)]
    return made(name, shapes, ROOM, PointLight((0.1, 0.02, 0.1), (0.3, 0.4, 0.5)))


def lamp_close_1000(name):
    """A point lamp 2 cm above a floor of 1000: a wide cone of light from a few square centimetres."""
    return made(name, room(lobe(1000.0), WALL, GREY), ROOM, PointLight((0.1, 0.02, 0.1), (0.3, 0.4, 0.5)))


def coarse_ball(name):
    """A smooth ball of 60 faces and exponent 1000 between walls, in a spot's light."""
    ball = sphere((-0.35, 0.36, -0.35), 0.35, 60, lobe(1000.0), "ball")
    return made(name, [*room(GREY, WALL), ball], ROOM,
                SpotLight((0.8, 1.5, 0.8), (-1.15, -1.15, -1.15), 0.25, 0.4, (4.0, 3.0, 2.0)))


def small_ball(name):
    """A smooth ball of 96 faces and 2 cm of exponent 60, floating before a lamp."""
    ball = sphere((-0.2, 0.5, -0.2), 0.02, 96, lobe(60.0, (0.9, 0.8, 0.7), (0.0, 0.0, 0.0)), "ball")
    return made(name, [*room(GREY, WALL), ball], ROOM, PointLight((0.1, 0.7, 0.2), (2.0, 2.5, 3.0)))


def ball_and_block(name):
    """A smooth ball and a block of 200, by a wide camera close to both, as users send them."""
    ball = sphere((0.42, -0.15, 0.16), 0.27, 100, lobe(200.0, (0.17, 0.3, 0.23), (0.4, 0.54, 0.67)), "ball")
    stone = rounded_block((0.1, -0.6, 0.0), (0.9, 0.15, 0.7), lobe(200.0, (0.66, 0.07, 0.22), (0.1, 0.4, 0.44)))
    camera = Camera((-0.1, 0.2, 0.8), (0.2, -0.4, 0.0), vfov=math.radians(65), width=24, height=18)
    return made(name, [ball, stone], camera, PointLight((-0.42, 0.72, 0.76), (11.6, 18.5, 4.5)))


def sun_on_blocks(name):
    """A floor of 1 and a flat block of 5 in the sun, with a lamp beside it."""
    shapes = [*room(lobe(1.0), GREY), *block((-0.6, 0, -0.4), (0.6, 0, 0.2), (0, 0.4, 0), (-0.2, 0, -0.4), lobe(5.0))]
    return made(name, shapes, ROOM, DirectionalLight((-0.6, -1.0, -0.4), (1.0, 0.9, 0.8)),
                PointLight((0.5, 0.5, 0.3), (0.1, 0.2, 0.4)))


def mirror_like(name):
    """A plate of 1e4 that throws a spot's light on a wall, and stands in a corner with the floor."""
    shapes = [*room(GREY, WALL, GREY), rectangle((-0.3, 0, 0.2), (0.7, 0, -0.3), (0.1, 0.6, 0.2), lobe(1e4))]
    return made(name, shapes, dataclasses.replace(ROOM, eye=(0.9, 1.3, 1.2)),
                SpotLight((0.4, 1.3, 0.3), (-0.35, -1.0, -0.2), 0.15, 0.35, (3.0, 2.0, 1.5)))


def mirror_floor(name):
    """A floor of 1e4 up to the walls, with a block of 600: highlights near and far."""
    shapes = [*room(lobe(1e4), WALL), *block((-0.6, 0, -0.5), (0.4, 0, 0.1), (0, 0.5, 0), (-0.1, 0, -0.3), lobe(600.0))]
    return made(name, shapes, ROOM, PointLight((0.3, 1.2, 0.5), (1.0, 1.5, 2.0)))


MAKERS = (diffuse, far_wall, corner, corner_600_900, lamp_close, lamp_close_1000, coarse_ball, small_ball,
          ball_and_block, sun_on_blocks, mirror_like, mirror_floor)
SCENES = {maker.__name__: maker for maker in MAKERS}
EXPONENTS = {"diffuse": "-", "far_wall": "60", "corner": "200", "corner_600_900": "600, 900", "lamp_close": "20",
             "lamp_close_1000": "1000", "coarse_ball": "1000", "small_ball": "60", "ball_and_block": "200",
             "sun_on_blocks": "1, 5", "mirror_like": "1e4", "mirror_floor": "600, 1e4"}


@cache
def frame(name):
    """Return the frame of a scene in float64: its G-buffer holds what the reference was made of."""
    return Frame(SCENES[name](name), dtype=np.float64)


BY_LOBES = ("corner", "corner_600_900", "lamp_close_1000", "ball_and_block", "sun_on_blocks", "mirror_floor")
EVERY = [*((name, False) for name in SCENES), *((name, True) for name in BY_LOBES)]  # name, and whether by lobes


@cache
def reference(name, lobes=False):
    """Return a scene's irradiance (3, h, w), or with `lobes` the radiance that pixels' lobes reflect.

    It is stored for the receivers (6, n) that it was made of.
    """
    with np.load(REFERENCES) as stored:
        to, values = receivers_of(frame(name), lobes), stored[_key(name, lobes)]
    found = np.concatenate([to.position, to.normal], axis=1)
    if found.shape != (len(values), 6) or np.abs(found - values[:, :6]).max() > 1e-6:
        raise AssertionError(f"{REFERENCES.name} holds other receivers of {name}: make it again")
    seen = glossy_of(frame(name)) if lobes else frame(name).gbuffer.covered
    picture = np.zeros((3, *seen.shape))
    picture[:, seen] = values[:, 6:].T
    return picture


def oracle(name, lobes=False, some=slice(None), tolerance=1e-4):
    """Return receivers (6, n) of a scene, what they get, and how far that moved last."""
    to, scene = receivers_of(frame(name), lobes), frame(name).scene
    to = type(to)(*(field[some] for field in to))
    if not lobes:
        return to, *irradiance(scene, to, tolerance)
    seen = frame(name).gbuffer.triangle_id[glossy_of(frame(name))][some]
    specular = np.array([m.specular for m in scene.materials])[scene.geometry.material_of_face[seen]]
    return to, *reflected(scene, to, specular, tolerance=tolerance)


def _key(name, lobes):
    return f"{name}, lobes" if lobes else name


def main(names):
    """Compute the references of scenes by name, of all without names."""
    for name, lobes in [one for one in EVERY if one[0] in (names or SCENES)]:
        to, value, moved = oracle(name, lobes)
        stored = dict(np.load(REFERENCES)) if REFERENCES.exists() else {}
        stored[_key(name, lobes)] = np.concatenate([to.position, to.normal, value], axis=1)
        np.savez_compressed(REFERENCES, **{key: stored[key] for key in sorted(stored)})
        print(f"{_key(name, lobes)}: {len(value)} receivers, mean {value.mean(axis=0)}, moved by "
              f"{(moved / value.mean()).max():.1e}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
