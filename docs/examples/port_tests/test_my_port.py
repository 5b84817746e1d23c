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
    lights = my_port.lights_of(inputs["rsm0.texel"], inputs["rsm0.weight"], inputs["rsm0.position"],
                               inputs["rsm0.normal"], inputs["rsm0.flux"])
    for name, array in zip(("position", "normal", "flux"), lights, strict=True):
        assert_stage_close(array, CASE, f"lights.{name}")


def test_sum(inputs):
    lights = [inputs[f"lights.{name}"] for name in ("position", "normal", "flux")]
    total = my_port.irradiance(inputs["gbuffer.position"], inputs["gbuffer.normal"],
                               inputs["gbuffer.triangle_id"] >= 0, lights)
    assert_stage_close(total, CASE, "sum.irradiance")
