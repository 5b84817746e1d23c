"""Radiance towards the camera: to the bit the plain sum, product and quotient of arrays."""

import numpy as np
import pytest

from refgi import stages
from refgi.frame import compose
from refgi.rsm import gbuffer, leaving_radiance
from refgi.rsm.buffers.leaving import glossy_points
from refgi.scene import Camera, Material, material_table
from tests.rsm.shapes import geometry, soup

CAMERA = Camera((0.4, 0.3, 2.5), (0.1, 0, 0), width=44, height=36)


@pytest.mark.parametrize("emission", [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_radiance_equals_its_definition(dtype, emission):
    flat = soup(np.random.default_rng(11), 20)
    shape = geometry(flat.vertices, flat.faces, materials=np.arange(20) % 2)
    materials = material_table([Material(diffuse=(0.1, 0.2, 0.3)), Material(emission=emission)], dtype)
    seen = gbuffer(shape, materials, CAMERA, dtype=dtype)
    direct, indirect = np.random.default_rng(2).random((2, 3, 36, 44)).astype(dtype)
    emitted = np.zeros_like(direct)
    emitted[:, seen.material_id == 1] = np.array(emission, dtype)[:, None]
    assert (~seen.covered).any()
    for more in (None, indirect):
        arriving = direct if more is None else direct + more
        radiance = leaving_radiance(direct, more, seen, materials)
        np.testing.assert_array_equal(radiance, arriving * seen.albedo / dtype(np.pi) + emitted)
        assert radiance.dtype == dtype
        with stages.observe(record=True, steps=True) as log:
            compose(direct, more, seen, materials)
        made = log.runs[0].steps
        np.testing.assert_array_equal(made, radiance)
        assert [run.name for run in log.runs if run.name.startswith("rsm.")] == [
            *(["rsm.emission"] if any(emission) else []), "rsm.leaving_radiance"]


def test_glossy_points_are_the_pixels_of_glossy_materials():
    """Property: the first triangle is glossy, and pixels without surface are none of its."""
    flat = soup(np.random.default_rng(11), 20)
    shape = geometry(flat.vertices, flat.faces, materials=np.arange(20) % 2)
    materials = material_table([Material(specular=(0.1, 0.2, 0.3), exponent=5.0), Material()], np.float32)
    seen = gbuffer(shape, materials, CAMERA)
    assert (~seen.covered).any()
    points = glossy_points(seen, materials, CAMERA.eye)
    np.testing.assert_array_equal(points.pixel, np.flatnonzero(seen.material_id == 0))
    np.testing.assert_array_equal(points.position, seen.position.reshape(3, -1)[:, points.pixel])
    np.testing.assert_array_equal(points.normal, seen.normal.reshape(3, -1)[:, points.pixel])
    assert (points.exponent == 5).all()
    np.testing.assert_array_equal(points.specular, np.float32([[0.1], [0.2], [0.3]]) + np.zeros(len(points.pixel)))
