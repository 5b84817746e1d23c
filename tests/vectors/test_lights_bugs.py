"""The literal forms that bugs of the pixel lights' stages are put into have none of their own."""

import numpy as np
import pytest

from refgi.lights.warp import Warp
from refgi.vectors.bugs.lights import literal_lights
from refgi.vectors.bugs.warp import literal_warp
from refgi.vectors.cases.sii import QUICK
from tests.vectors.splat_ports import expect_within, made

KINDS = "position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent"


@pytest.mark.parametrize("id", ["sii-warp-a", "sii-warp-b"])
def test_the_warp_that_bugs_are_put_into_has_none_of_its_own(id):
    case, known = made(id)
    for name in [key.removesuffix(".warp") for key in case.facts if key.endswith(".warp")]:
        how = Warp(**case.facts[f"{name}.warp"])
        points, weights = literal_warp(known[f"{name}.points"].astype(np.float64),
                                       known[f"{name}.importance"].astype(np.float64), case.facts[name]["maps"], how)
        expect_within(id, f"{name}.warp", {f"{name}.warped": points, f"{name}.density_weight": weights})


@pytest.mark.parametrize("id", [*QUICK, "multires-no-flux"])
def test_the_list_of_lights_that_bugs_are_put_into_has_none_of_its_own(id):
    case, known = made(id)
    names = [key.removesuffix(".lights") for key in case.facts if key.endswith(".lights")]
    shapes = [(maps := case.facts[name]["maps"], known[f"{name}.flux"].shape[1] // maps, known[f"{name}.flux"].shape[2])
              for name in names]
    kinds = [kind for kind in KINDS if f"lights.{kind}" in known]
    expect_within(id, "lights", literal_lights(known, kinds, shapes))
