"""How a port's own tests use the kit: stage by stage, on the kit's inputs."""

import my_port
import pytest

from refgi.testing import assert_stage_close
from refgi.vectors.check import Asked

CASE = "sii-halton"


@pytest.fixture
def inputs(refgi_kit):
    """Every array of the case by name."""
    (case,) = refgi_kit.cases(Asked(cases=(CASE,)))
    return {name: refgi_kit.array(case, name) for name in case.arrays}


def test_lights(inputs):
    lights = my_port.lights_of(inputs["lights.texels0.texel"], inputs["lights.texels0.weight"],
                               inputs["rsm.map_surface0.position"], inputs["rsm.map_surface0.normal"],
                               inputs["rsm.reflected_flux0.flux"])
    for name, array in zip(("position", "normal", "flux"), lights, strict=True):
        assert_stage_close(array, CASE, f"lights.pixel_lights.{name}")


def test_sum(inputs):
    lights = [inputs[f"lights.pixel_lights.{name}"] for name in ("position", "normal", "flux")]
    total = my_port.irradiance(inputs["rsm.surface.position"], inputs["rsm.surface.normal"],
                               inputs["rsm.visible_triangles"] >= 0, lights)
    assert_stage_close(total, CASE, "pairs.sum")
