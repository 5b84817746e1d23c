"""Vertex colours: linear between corners, in pictures, maps, paths and truth, as a texture of the same ramp."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights import walk_lights
from refgi.methods import find_method, render
from refgi.provenance.record import geometry_digest
from refgi.rays import Tracer
from refgi.rsm import gbuffer, reflective_shadow_map
from refgi.scene import (
    Camera,
    DirectionalLight,
    Image,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
    light_table,
    material_table,
    merge,
)
from refgi.scene.builtin.surfaces import rectangle
from refgi.settings import of

ROUNDING = 1e-12  # of a few products in float64
SINGLE = 1e-6  # pictures in float32
GLOSS = Material("gloss", (0.5, 0.5, 0.5), (0.3, 0.3, 0.3), 20.0)
WHITE = Material("white", (0.8, 0.8, 0.8))


def ramp(position):
    """A factor that is linear in space, from 0.1 to 0.9 within a cube of 2 m: (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(position, float), -1, 0)
    return np.stack([0.5 + 0.2 * x - 0.1 * z, 0.4 + 0.2 * y, 0.5 - 0.3 * z + 0.1 * x], axis=-1)


def coloured(mesh: Mesh) -> Mesh:
    return dataclasses.replace(mesh, colours=ramp(np.asarray(mesh.vertices)[mesh.faces]))


def box(*lights, paint=coloured, material=WHITE) -> Scene:
    """Return a floor and two walls in [-1, 1]^3, seen at a slant; the left wall is plain."""
    geometry, materials = merge([
        paint(rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2), material, "floor")),
        paint(rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), material, "back")),
        rectangle((-1, -1, 1), (0, 0, -2), (0, 2, 0), WHITE, "left")])
    camera = Camera((1.6, 0.9, 1.9), (-0.2, -0.5, -0.4), vfov=math.radians(60), width=32, height=24)
    return Scene("box", geometry, materials, camera, lights)


SPOT = SpotLight((0.6, 0.9, 0.7), (-0.5, -0.9, -0.8), 0.5, 0.8, (4.0, 3.0, 2.0))
LIGHTS = {"spot": SPOT, "point": PointLight((0.5, 0.6, 0.4), (1, 2, 1)),
          "sun": DirectionalLight((-1, -2, -1.5), (1, 1, 2))}


def is_coloured(triangle_id):
    return (triangle_id >= 0) & (triangle_id < 4)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_albedo_is_the_ramp_at_each_pixels_point(dtype):
    scene = box()
    buffer = gbuffer(scene.geometry, material_table(scene.materials), scene.camera, dtype=dtype)
    seen = is_coloured(buffer.triangle_id)
    expected = 0.8 * np.moveaxis(ramp(np.moveaxis(buffer.position, 0, -1)), -1, 0)
    error = np.abs(buffer.albedo - expected)[:, seen].max()
    assert error < (ROUNDING if dtype is np.float64 else SINGLE)
    assert seen.sum() > 100
    plain = buffer.covered & ~seen
    assert plain.any()
    np.testing.assert_array_equal(buffer.albedo[:, plain], dtype(0.8))
    some = np.flatnonzero(buffer.covered)[::3]
    again = gbuffer(scene.geometry, material_table(scene.materials), scene.camera, dtype=dtype)
    np.testing.assert_array_equal(again.at(some, "albedo")[0], buffer.albedo.reshape(3, -1)[:, some])


@pytest.mark.parametrize(("kind", "shape"), [("spot", "perspective"), ("spot", "paraboloid"), ("point", "cube"),
                                             ("point", "paraboloid"), ("sun", "orthographic")])
def test_flux_of_a_map_is_that_of_the_ramp(kind, shape):
    scene, table = box(), material_table(box().materials)
    rsm = reflective_shadow_map(scene.geometry, table, LIGHTS[kind], 24, np.float64, projection=shape)
    bare = dataclasses.replace(scene.geometry, colours=None)
    plain = reflective_shadow_map(bare, table, LIGHTS[kind], 24, np.float64, projection=shape)
    seen = is_coloured(rsm.triangle_id)
    assert seen.any()
    share = np.moveaxis(ramp(np.moveaxis(rsm.position, 0, -1)), -1, 0)
    np.testing.assert_allclose(rsm.flux[:, seen], (plain.flux * share)[:, seen], rtol=1e-10)
    np.testing.assert_array_equal(rsm.flux[:, ~seen], plain.flux[:, ~seen])


def test_light_paths_reflect_by_the_ramp():
    scene = box(SPOT)
    shapes = scene.geometry, dataclasses.replace(scene.geometry, colours=None)
    tinted, plain = (walk_lights(Tracer(shape), shape, material_table(scene.materials), light_table((SPOT,)), 64)
                     for shape in shapes)
    np.testing.assert_array_equal(tinted.position, plain.position)
    left = np.abs(tinted.position[0] + 1) < 1e-6
    share = np.where(left, 1.0, ramp(tinted.position.T).T)
    np.testing.assert_allclose(tinted.flux, plain.flux * share, rtol=SINGLE)  # positions are float32


def textured(mesh: Mesh) -> Mesh:
    """Return the mesh with the ramp as a texture of 2 x 2 texels, its corners at the texels' centres."""
    corners = ramp(mesh.vertices).astype(np.float32)  # in the order of `rectangle`'s vertices
    uv = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]])
    image = Image(corners.reshape(2, 2, 3))
    material = dataclasses.replace(mesh.material, texture=Texture(image, ("clamp", "clamp"), "bilinear"))
    return dataclasses.replace(mesh, material=material, uv=uv[mesh.faces])


@pytest.mark.filterwarnings("ignore:.* of the indirect light")
@pytest.mark.parametrize(("method", "material"), [
    ("sii", WHITE), ("vpl", WHITE), ("truth", WHITE), ("sii", GLOSS), ("vpl", GLOSS),
    pytest.param("truth", GLOSS, marks=pytest.mark.slow)])  # kernels of its own: half a minute
def test_methods_see_the_ramp_as_a_texture_of_it(method, material):
    settings = of(find_method(method).settings, **({"samples": 96, "light_grid": 16} if method == "truth" else
                                                   {"lights": 64}))
    tinted, painted = (render(box(SPOT, paint=paint, material=material), method, settings) for paint in (
        coloured, textured))
    if method == "truth":  # which light is picked may turn on a rounding
        assert np.median(np.abs(tinted.radiance - painted.radiance)) < SINGLE * painted.radiance.max()
        np.testing.assert_allclose(tinted.radiance.mean(axis=(1, 2)), painted.radiance.mean(axis=(1, 2)), rtol=1e-4)
    else:
        np.testing.assert_allclose(tinted.radiance, painted.radiance, rtol=2e-5, atol=SINGLE * painted.radiance.max())


def test_texture_and_colours_multiply():
    both = box(SPOT, paint=lambda mesh: coloured(textured(mesh)))
    one = box(SPOT, paint=textured)
    first, second = (Frame(scene, dtype=np.float64).gbuffer for scene in (both, one))
    seen = is_coloured(first.triangle_id)
    share = np.moveaxis(ramp(np.moveaxis(first.position, 0, -1)), -1, 0)
    np.testing.assert_allclose(first.albedo[:, seen], (second.albedo * share)[:, seen], rtol=1e-10)
    settings = of(find_method("truth").settings, samples=48, light_grid=8)
    brighter, darker = (render(scene, "truth", settings).irradiance.mean() for scene in (one, both))
    assert darker < brighter


def test_faces_take_their_colours_along():
    """Mirrored, merged with plain meshes, without flat faces, chosen."""
    from refgi.scene.motion import transformed_all
    from refgi.scene.repair import repaired

    mesh = coloured(rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2), WHITE, "floor"))
    mirrored, = transformed_all([mesh], np.diag([-1.0, 1, 1, 1])[None])
    for face, attributes in zip(mirrored.faces, mirrored.colours, strict=True):
        np.testing.assert_allclose(attributes, ramp(mirrored.vertices[face] * (-1, 1, 1)))
    flat = dataclasses.replace(mesh, faces=np.vstack([[[0, 0, 1]], mesh.faces]),
                               colours=np.concatenate([np.zeros((1, 3, 3)), mesh.colours]))
    np.testing.assert_array_equal(repaired(flat, "mesh")[0].colours, mesh.colours)
    geometry = box().geometry
    assert (geometry.colours[4:] == 1).all()
    np.testing.assert_array_equal(geometry.selected(np.arange(6) % 2 == 1).colours, geometry.colours[1::2])
    assert geometry_digest(box(SPOT)) != geometry_digest(box(SPOT, paint=lambda mesh: mesh))


def test_factors_beyond_1_are_refused():
    mesh = rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2), WHITE, "floor")
    for value in (1.5, -0.1, math.nan):
        with pytest.raises(InputError, match="colours of face 1"):
            merge([dataclasses.replace(mesh, colours=np.concatenate([np.ones((1, 3, 3)), np.full((1, 3, 3), value)]))])
    with pytest.raises(InputError, match="shape"):
        merge([dataclasses.replace(mesh, colours=np.ones((2, 3)))])


def test_scenes_without_colours_run_no_kernel_of_them(monkeypatch):
    from refgi.rsm.buffers import attributes

    for name in ("_tint_rows", "_tint_texels"):
        monkeypatch.setattr(attributes, name, None)
    scene = box(SPOT, paint=lambda mesh: mesh)
    assert scene.geometry.colours is None
    assert (Frame(scene).gbuffer.albedo[:, Frame(scene).gbuffer.covered] == np.float32(0.8)).all()
