"""Light from further cameras comes back where it was missing, never takes any away and never makes too much."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import Camera, Material, Scene, SpotLight, merge
from refgi.settings import of
from refgi.sssil import CameraSettings, HssilSettings
from refgi.sssil.cameras import frame_through, join_cameras
from refgi.sssil.hssil import hssil
from refgi.stages import observe

ALBEDO = np.array((0.8, 0.2, 0.1))
BACK = -0.4  # z of the lit side, m
LIGHT = np.array((0.0, 0.5, -1.5))  # m; shines along +z
HALF_ANGLE = math.radians(20)  # the cone ends within the side
INTENSITY = 3.0  # W/sr
SIDE_VIEW = Camera((2.2, 1.1, -1.2), (0.0, 0.6, -1.2), vfov=math.radians(70))  # in the gap: lit side and wall


def hidden_side(width=96, height=64, shift=(0.0, 0.0, 0.0)):
    """Return a box on a floor before a wall; the camera looks at the box's front, a spot lights its back."""
    pale, red = Material("pale", (0.7, 0.7, 0.7)), Material("red", tuple(ALBEDO))
    move = np.asarray(shift)
    sides = [((-2, 0, 2), (4, 0, 0), (0, 0, -4), pale), ((-2, 0, -2), (4, 0, 0), (0, 2.5, 0), pale),
             ((-0.5, 0, 0.4), (1, 0, 0), (0, 1, 0), red), ((0.5, 0, BACK), (-1, 0, 0), (0, 1, 0), red),
             ((-0.5, 0, BACK), (0, 0, 0.8), (0, 1, 0), red), ((0.5, 0, 0.4), (0, 0, -0.8), (0, 1, 0), red),
             ((-0.5, 1, 0.4), (1, 0, 0), (0, 0, -0.8), red)]
    geometry, materials = merge([rectangle(tuple(move + corner), a, b, material, "side")
                                 for corner, a, b, material in sides])
    camera = Camera(tuple(np.add(move, (0, 1.1, 5))), tuple(np.add(move, (0, 0.8, 0))), vfov=math.radians(40),
                    width=width, height=height)
    light = SpotLight(tuple(move + LIGHT), (0, 0, 1), HALF_ANGLE, HALF_ANGLE, (INTENSITY,) * 3)
    return Scene("hidden_side", geometry, materials, camera, (light,))


def from_the_lit_side(position, normal, rings=24, spokes=48):
    """Return the irradiance (3, ...) that the lit disc sends to points, W/m^2: nothing lies between.

    Midpoint rule in polar coordinates: the disc at distance h has E = I cos^3 / h^2 and reflects albedo E / pi.
    """
    height = BACK - LIGHT[2]
    width = height * math.tan(HALF_ANGLE) / rings
    total = np.zeros(position.shape[1:])
    for ring in range(rings):
        radius = (ring + 0.5) * width
        direct = INTENSITY * height / (height**2 + radius**2) ** 1.5
        for angle in 2 * math.pi * (np.arange(spokes) + 0.5) / spokes:
            at = np.array((LIGHT[0] + radius * math.cos(angle), LIGHT[1] + radius * math.sin(angle), BACK))
            way = np.moveaxis(at - np.moveaxis(position, 0, -1), -1, 0)
            square = (way * way).sum(axis=0)
            cosines = np.maximum((way * normal).sum(axis=0), 0) * np.maximum(way[2], 0)
            area = radius * width * 2 * math.pi / spokes
            total += direct / math.pi * area * np.divide(cosines, square**2, out=np.zeros_like(total), where=square > 0)
    return ALBEDO[:, None, None] * total


# every pixel sends to every other: what is left is the pixels' size. Depth changes by up to 5 % from one pixel of so
# small a picture to the next, where it looks along a surface.
BRUTE = {"levels": 1, "start": "full", "pattern": "all", "radius": None, "form_factor": "point",
         "depth_tolerance": 0.1}
PIXELS = 0.06  # those of the further view are 3 cm long on the lit disc of 80 cm, and up to 40 cm on the wall's far end
FACETS = 0.01  # of the sphere, and of its pixels
QUICK = {"levels": 3, "samples": 8, "radius": None}
BOX_VIEWS = (Camera((0.17, 0.52, 0.38), (0.91, -0.03, 0.78), vfov=math.radians(72)),
             Camera((0.28, 0.3, 0.41), (-0.01, -0.62, 0.67), vfov=math.radians(72)))
SPHERE_VIEWS = (Camera((0.42, -0.07, 0.02), (-0.39, -0.3, -0.52), vfov=math.radians(88)),
                Camera((0.12, -0.4, 0.72), (-0.21, -0.58, -0.2), vfov=math.radians(88)))


@pytest.fixture(scope="module")
def basket():
    return Frame(hidden_side(), shadows="exact")


@pytest.fixture(scope="module")
def exact(basket):
    return from_the_lit_side(*(plane.astype(float) for plane in basket.gbuffer.resolve("position", "normal")))


def on_the_wall(frame):
    """Return pixels of the wall off its edges, where light has no steps."""
    x, y, z = frame.gbuffer.position
    return (z < -1.99) & (np.abs(x) < 1.8) & (y > 0.25) & (y < 2.3)


@pytest.mark.feature("HSS-15")
def test_light_of_a_side_that_the_camera_does_not_see_comes_back(basket, exact, evidence):
    """Analytic (Fig. 9): one camera finds none at all, a view from the side what quadrature gives."""
    assert not hssil(basket, of(HssilSettings, **BRUTE)).any()
    found = hssil(basket, of(HssilSettings, views=(SIDE_VIEW,), **BRUTE))
    wall = on_the_wall(basket)
    assert (found[0, wall] > 0).mean() > 0.7
    near = wall & (found[0] > 0) & (basket.gbuffer.position[0] > 0)  # where the view from the side is not a grazing one
    ratio = found[0, near] / exact[0, near]
    assert abs(ratio - 1).max() < PIXELS
    over = (found - exact)[:, wall].max() / exact.max()
    assert over < PIXELS
    evidence(f"Fig. 9: 0 with one camera; with a side view {ratio.min():.3f} to {ratio.max():.3f} of the closed form "
             f"near it, nowhere more above it than {over:.3f} of the brightest")


@pytest.mark.feature("HSS-15")
def test_it_is_never_darker_than_one_camera(evidence):
    """Property: to the bit, in every pixel and channel, for a noisy pattern as well."""
    frame = Frame(load_scene("cornell_box"), width=45, height=34, rsm_resolution=64)
    one = hssil(frame, of(HssilSettings, **QUICK))
    more = hssil(frame, of(HssilSettings, views=BOX_VIEWS, **QUICK))
    assert (more >= one).all()
    assert more.sum() > 1.01 * one.sum()
    evidence(f"Cornell box: nowhere darker to the bit, {more.sum() / one.sum():.3f} times the light by two more")


@pytest.mark.feature("HSS-15")
def test_it_is_never_above_what_all_surfaces_send(evidence):
    """Analytic: inside a sphere all surfaces together light every point alike, a camera sees a part of them."""
    scene = load_scene("integrating_sphere:faces=2000").with_camera(eye=(0, 0.1, 0.3), target=(-0.3, -1, -0.3))
    frame = Frame(scene, width=48, height=48, shadows="exact")
    light, inner, outer = scene.lights[0], math.cos(math.radians(20)), math.cos(math.radians(32))
    flux = light.intensity[0] * 2 * math.pi * (1 - inner + (inner - outer) / 2)  # the falloff's mean is 1/2
    whole = 0.5 * flux / (4 * math.pi)  # albedo Phi / (4 pi R^2)
    one, more = (hssil(frame, of(HssilSettings, views=views, **BRUTE)) / whole for views in ((), SPHERE_VIEWS))
    assert one.mean() < 0.2
    assert more.mean() > 0.9
    assert more.max() < 1 + FACETS
    evidence(f"sphere: {one.mean():.3f} of all by one camera, "
             f"{more.mean():.3f} with two more, at most {more.max():.3f}")


@pytest.mark.feature("HSS-15")
def test_the_camera_itself_as_a_further_view_changes_nothing():
    """Property: each point is found where it is, to the bit."""
    frame = Frame(load_scene("cornell_box"), width=45, height=34, rsm_resolution=64)
    np.testing.assert_array_equal(hssil(frame, of(HssilSettings, views=(frame.scene.camera,), **QUICK)),
                                  hssil(frame, of(HssilSettings, **QUICK)))


@pytest.mark.feature("HSS-15")
def test_the_largest_counts_not_the_last():
    """Property: views in any order, and a view twice, give the same."""
    frame = Frame(load_scene("cornell_box"), width=45, height=34, rsm_resolution=64)
    first, second, twice = (hssil(frame, of(HssilSettings, views=given, **QUICK))
                            for given in (BOX_VIEWS, BOX_VIEWS[::-1], (*BOX_VIEWS, BOX_VIEWS[0])))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, twice)


@pytest.mark.feature("HSS-15")
def test_views_of_a_scene_far_from_the_origin_are_moved_with_it(basket):
    """Property: 2^14 m off, where float32 would have no places left; to the bit."""
    far = np.array((2.0**14, 0.0, -(2.0**14)))
    frame = Frame(hidden_side(shift=far), shadows="exact")
    assert any(frame.origin)
    view = Camera(tuple(far + SIDE_VIEW.eye), tuple(far + SIDE_VIEW.target), vfov=SIDE_VIEW.vfov)
    near = hssil(basket, of(HssilSettings, views=(SIDE_VIEW,), **BRUTE))
    np.testing.assert_array_equal(hssil(frame, of(HssilSettings, views=(view,), **BRUTE)), near)


def test_maps_and_rays_are_shared_and_the_picture_is_as_large():
    frame = Frame(load_scene("cornell_box"), width=21, height=13, rsm_resolution=64)
    with observe() as log:
        hssil(frame, of(HssilSettings, views=(Camera((0.2, 0.2, -0.5), (0.3, 0.2, 0.5), width=99),), **QUICK))
    assert log.status("rsm.reflective_shadow_map") == ["ran"]
    assert log.status("rsm.gbuffer") == ["ran", "ran"]
    other = frame_through(frame, frame.scene.camera)
    assert other.rsms is frame.rsms
    assert (other.width, other.height, other.rsm_resolution) == (21, 13, 64)


def test_the_light_given_is_left_as_it_was():
    frame = Frame(load_scene("cornell_box"), width=9, height=7, rsm_resolution=64)
    light = np.zeros((3, 7, 9), np.float32)
    joined = join_cameras(frame, light, CameraSettings(views=(frame.scene.camera,)), lambda _: light + 1)
    assert not light.any()
    assert (joined == frame.gbuffer.covered).all()
