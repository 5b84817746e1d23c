"""Every setting of pixel lights reaches each method: the lights that it sums are those that the settings choose.

`test_lights` shows which those are.
"""

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.lights.selection import choose_lights
from refgi.splat import MultiresSettings, SiiSettings, multires, sii
from refgi.stages import observe
from refgi.truth.vpl import VplSettings, vpl
from tests.wiring.cases import under
from tests.wiring.features import LIGHTS, featured
from tests.wiring.light_cases import BASE, LIGHT_CASES

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

METHODS = {"sii": (sii, SiiSettings, {}), "multires": (multires, MultiresSettings, {}),
           "val": (val, ValSettings, {"clusters.count": 3, "maps.resolution": 8, "interleaving.block": 1}),
           "vpl": (vpl, VplSettings, {"visibility": False})}
SUMS = ("pairs.sum", "multires.evaluate", "cluster.irradiance", "vpl.light")
CASES = under("lights", LIGHT_CASES)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", featured(CASES, LIGHTS))
def test_the_method_sums_the_chosen_lights(name, method):
    function, kind, over = METHODS[method]
    case = CASES[name]
    settings = case.settings(kind, {f"lights.{key}": value for key, value in BASE.items()} | over)
    frame = case.seen()
    with observe(record=True) as log:
        function(frame, settings)
    expected = choose_lights(frame, settings.lights)
    summed = [run.arguments["lights"] for run in log.runs if run.name in SUMS]
    assert summed
    for lights in summed:
        for field in ("position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent"):
            np.testing.assert_array_equal(getattr(lights, field), getattr(expected, field), err_msg=field)
