"""Direct light on coarse meshes with vertex normals: the map's shadows are those of rays, face by face."""

import dataclasses

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import DirectionalLight, PointLight, Scene, SpotLight
from refgi.scene.mesh import Mesh
from refgi.scene.model import merge
from tests.smooth_shapes import CAMERA, CLAY, CONVEX, FLOOR, LAMP, SHAPES, scene

RESOLUTION = 256
AROUND = 2.0  # texels: what a map's edge may be off by
LIGHTS = {
    "spot": LAMP,
    "wide spot": SpotLight(LAMP.position, LAMP.direction, 0.5, 1.45, (20.0, 19.0, 18.0)),
    "point": PointLight(LAMP.position, (20.0, 19.0, 18.0)),
    "directional": DirectionalLight((1.0, -1.2, -1.0), (3.0, 3.0, 3.0)),
}


def both(shape, light, floor=True):
    """Return the frame, and its direct light by map and by rays."""
    made = scene(shape, floor, lights=(light,))
    frame = Frame(made, rsm_resolution=RESOLUTION)
    return frame, frame.direct, Frame(made, shadows="exact").direct


def near_edges(frame, pixels):
    """Return which pixels' shadow changes within `AROUND` texels across the light, on the plane of their face, (n,)."""
    buffer, light, maps = frame.gbuffer, frame.scene.lights[0], frame.rsms[0].projection
    at, up = (plane[:, pixels].T.astype(float) for plane in (buffer.position, buffer.facing))
    if isinstance(light, DirectionalLight):
        away, far = np.broadcast_to(light.direction / np.linalg.norm(light.direction), at.shape), 1.0
    else:
        away = at - light.position
        far = np.linalg.norm(away, axis=1, keepdims=True)
        away = away / far
    side = 2 * far * max(maps.half[0] / maps.width, maps.half[1] / maps.height)
    across = np.cross(away, (0.3, 0.5, -0.8))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    seen = []
    for a, b in np.stack(np.meshgrid(*2 * [np.linspace(-AROUND, AROUND, 9)]), -1).reshape(-1, 2):
        step = side * (a * across + b * np.cross(away, across))
        moved = at + step - away * ((step * up).sum(1) / (away * up).sum(1))[:, None]  # back onto the face's plane
        seen.append(frame.tracer.visible_from_light(moved.T[:, None], up.T[:, None], np.ones((1, len(at)), bool),
                                                    light)[0])
    return ~(np.all(seen, axis=0) | ~np.any(seen, axis=0))


@pytest.mark.feature("REF-32")
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("shape", CONVEX)
def test_a_convex_mesh_alone_has_no_shadow_but_where_faces_turn_away(shape, light, evidence):
    """The map's light is that of rays, to the bit; some of it would be lost over interpolated normals' planes."""
    _, by_map, by_rays = both(shape, LIGHTS[light], floor=False)
    assert by_rays.any()
    evidence(f"{shape}, {light}: {int(by_rays.any(axis=0).sum())} lit pixels, as by rays")
    np.testing.assert_array_equal(by_map, by_rays)


@pytest.mark.feature("REF-32")
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_map_differs_from_rays_along_the_edges_of_true_shadows_alone(shape, light, evidence):
    frame, by_map, by_rays = both(shape, LIGHTS[light])
    differs = (by_map != by_rays).any(axis=0)
    at_edges = near_edges(frame, differs)
    lit = int(by_rays.any(axis=0).sum())
    evidence(f"{shape}, {light}: {int(differs.sum())} of {lit} lit pixels differ, {int((~at_edges).sum())} off edges")
    assert at_edges.all()
    assert differs.sum() < 0.01 * lit


@pytest.mark.parametrize("shadows", ["map", "exact"])
@pytest.mark.parametrize("light", LIGHTS)
def test_a_face_turned_from_the_light_is_dark_though_its_normal_is_not(shadows, light):
    """A sheet seen from above and lit from below, its normals tilted towards the light beyond its edge."""
    tilted = np.tile([0.8, 0.6, 0.0], (4, 1))
    sheet = Mesh(FLOOR.vertices / 3, FLOOR.faces, tilted, CLAY, "sheet")
    below = {"position": (4.0, -1.0, 0.0), "direction": (-4.0, 1.0, 0.0)}
    lamp = dataclasses.replace(LIGHTS[light], **{key: below[key] for key in below if hasattr(LIGHTS[light], key)})
    geometry, materials = merge([sheet], smooth=True)
    frame = Frame(Scene("sheet", geometry, materials, CAMERA, (lamp,)), rsm_resolution=RESOLUTION, shadows=shadows)
    assert (frame.gbuffer.normal[0][frame.gbuffer.covered] > 0.7).all()
    assert frame.rsms[0].covered.any()
    assert not frame.direct.any()


def test_flat_meshes_take_their_normals_as_they_are():
    frame = Frame(scene("icosahedron", smooth=False))
    assert frame.gbuffer.facing is frame.gbuffer.normal
