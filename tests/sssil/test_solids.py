"""Skinned objects moved as rigid: the motion that fits best, and what reprojection is off by at a turning limb."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from refgi.frame import Frame
from refgi.scene import Camera, Material, PointLight, Scene, merge
from refgi.sssil.motion import as_solids, previous_points
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal_filter import earlier_geometry, first_light, history_of, temporal_filter
from tests.truth.scenes import rectangle

ROUNDING = 1e-12  # m
ANGLE, HALF = 0.3, 0.5  # rad that limbs turn, half their length, m
CAMERA = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), vfov=math.radians(50), width=48, height=36)


def figure(angle=0.0, **flags):
    """A wall, and before it a body between two limbs that turn about their middles, one against the other."""
    wall, skin = Material("wall"), Material("skin", **flags)
    limbs = [rectangle((x - HALF, -0.1, 0.2), (2 * HALF, 0, 0), (0, 0.2, 0), skin) for x in (-1.2, 1.2)]
    for limb, sign in zip(limbs, (1, -1), strict=True):
        middle = limb.vertices.mean(axis=0)
        turn = Rotation.from_euler("z", sign * angle).as_matrix()
        limb.vertices[:] = (limb.vertices - middle) @ turn.T + middle
    body = rectangle((-0.3, -0.8, 0.2), (0.6, 0, 0), (0, 1.6, 0), skin)
    geometry, materials = merge([rectangle((-4, -3, 0), (8, 0, 0), (0, 6, 0), wall), body, *limbs])
    return Scene("figure", geometry, materials, CAMERA, (PointLight((0.0, 2.0, 3.0), (9.0, 9.0, 9.0)),))


def cloud(seed):
    """Faces of random points, of three solids: 0, 1 and 2."""
    corners = np.random.default_rng(seed).normal(size=(9, 3, 3))
    geometry, _ = merge([rectangle(*three, Material()) for three in corners])
    return geometry, np.repeat([0, 1, 2], 6)


def moved(geometry, solids, seed, strain):
    """The geometry with each solid turned and moved by itself, and strained by random shifts."""
    random, vertices = np.random.default_rng(seed), geometry.vertices.copy()
    for solid in (1, 2):
        used = np.unique(geometry.faces[solids == solid])
        vertices[used] = Rotation.random(random_state=solid).apply(vertices[used]) + random.normal(size=3)
    return dataclasses.replace(geometry, vertices=vertices + strain * random.normal(size=vertices.shape))


@pytest.mark.feature("HSS-21")
@pytest.mark.parametrize("strain", [0.0, 0.3, 2.0])
def test_the_motion_fits_best(strain, evidence):
    """Oracle: SciPy's fit; the motion itself where it is rigid. Others stay to the bit."""
    now, solids = cloud(1)
    then = moved(now, solids, 2, strain)
    found, off = as_solids(now, then, solids).vertices, 0.0
    for solid in (1, 2):
        used = np.unique(now.faces[solids == solid])
        a, b = now.vertices[used], then.vertices[used]
        turn = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))[0]
        expected = turn.apply(a - a.mean(axis=0)) + b.mean(axis=0)
        off = max(off, np.abs(found[used] - (expected if strain else b)).max())
    others = np.unique(now.faces[solids == 0])
    np.testing.assert_array_equal(found[others], then.vertices[others])
    assert off < ROUNDING * 100
    evidence(f"strained by {strain:g}: off by {off:.0e} m")


@pytest.mark.feature("HSS-21")
def test_normals_turn_with_it_and_what_rests_stays():
    now, solids = cloud(3)
    normals = np.random.default_rng(4).normal(size=now.vertices.shape)
    now = dataclasses.replace(now, vertex_normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))
    then = dataclasses.replace(moved(now, solids, 5, 0.0), vertex_normals=-now.vertex_normals)  # skinned, as they were
    used = np.unique(now.faces[solids == 1])
    found = as_solids(now, then, solids).vertex_normals[used]
    np.testing.assert_allclose(found, Rotation.random(random_state=1).apply(now.vertex_normals[used]), atol=ROUNDING)
    rests = as_solids(now, dataclasses.replace(now), solids)
    np.testing.assert_array_equal(rests.vertices, now.vertices)
    np.testing.assert_array_equal(rests.vertex_normals, now.vertex_normals)


@pytest.mark.feature("HSS-21")
def test_a_mirrored_pose_is_not_mirrored():
    now, solids = cloud(6)
    then = dataclasses.replace(now, vertices=now.vertices * (1, 1, -1))
    used = np.unique(now.faces[solids == 1])
    turned = as_solids(now, then, solids).vertices[used]
    a, b = now.vertices[used], turned
    linear = np.linalg.lstsq(a - a.mean(axis=0), b - b.mean(axis=0), rcond=None)[0]
    assert np.linalg.det(linear) == pytest.approx(1)


@pytest.mark.feature("HSS-21")
def test_reprojection_is_off_by_the_limbs_turn(evidence):
    """Closed form: limbs that turn against each other leave the fit at rest; at r from the joint 2 r sin(a/2)."""
    before, scene = figure(), figure(ANGLE, solid=1)
    frame, earlier = Frame(scene, dtype=np.float64), Frame(before, dtype=np.float64)
    history = history_of(earlier, before.geometry, first_light(np.zeros((3, 36, 48)), TemporalSettings()))
    held = earlier_geometry(frame.scene, frame.origin, history)
    np.testing.assert_allclose(held.vertices, scene.geometry.vertices, atol=ROUNDING)
    solid, exact = (previous_points(frame.gbuffer, scene.geometry, one).position for one in (held, before.geometry))
    limb = frame.gbuffer.triangle_id >= 4
    at = frame.gbuffer.position
    r = np.hypot(np.abs(at[0]) - 1.2, at[1])
    off = np.linalg.norm(solid - exact, axis=0)
    np.testing.assert_allclose(off[limb], 2 * r[limb] * math.sin(ANGLE / 2), rtol=1e-9, atol=ROUNDING)
    assert off[~limb].max() < ROUNDING
    pixel = 2 * math.tan(CAMERA.vfov / 2) * (4 - 0.2) / 36
    assert limb.sum() > 40
    evidence(f"limbs of {2 * HALF:g} m that turn by {math.degrees(ANGLE):.0f} degrees: {off.max() / pixel:.1f} pixels "
             f"at the tip, {off[limb].mean() / pixel:.1f} in the mean; body and wall 0")


@pytest.mark.feature("HSS-21")
def test_the_filter_takes_it_as_resting():
    """Wiring: the light that a resting figure keeps, where by its vertices the limbs have moved."""
    before, settings = figure(), TemporalSettings()
    lights = np.random.default_rng(7).random((2, 3, 36, 48))
    history = history_of(Frame(before, dtype=np.float64), before.geometry, first_light(lights[0], settings))

    def filtered(scene, past):
        return temporal_filter(lights[1], Frame(scene, dtype=np.float64), scene.geometry, past, settings).irradiance

    solid, plain = figure(ANGLE, solid=1), figure(ANGLE)
    resting = history._replace(geometry=dataclasses.replace(plain.geometry))
    np.testing.assert_allclose(filtered(solid, history), filtered(plain, resting), atol=1e-6)
    assert np.abs(filtered(solid, history) - filtered(plain, history)).max() > 0.1
