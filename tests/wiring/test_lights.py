"""Which pixel lights there are: every setting against the twin that chooses light by light, and their footprints.

Each method sums those that the settings choose.
"""

from functools import cache

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.pairs.settings import PairSettings
from refgi.rsm import incident_flux
from refgi.settings import of
from refgi.splat import MultiresSettings, SiiSettings, multires, sii
from refgi.stages import observe
from refgi.truth.vpl import VplSettings, vpl
from tests.naive.light_maps import drawn_maps
from tests.naive.lights import drawn, pixel_lights
from tests.wiring.cases import uncovered, under
from tests.wiring.features import LIGHTS, featured
from tests.wiring.fold import fold
from tests.wiring.part_cases import LIGHT_BASE, LIGHT_CASES

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss
EXACT = 1e-9  # of the largest: sums of some thousand float64 numbers in another order
# Embree's rays are float32 and start 1e-6 m off a surface: three bounces on walls and a ball put places and directions
# 2e-5 off, one way within glass 1e-7, and with it what Fresnel's law lets through and the footprint
PATHS, WITHIN_GLASS = 1e-4, 1e-6
SHOWS = 1e-3  # of the largest: what a setting changes at least
FOOTPRINTS = of(PairSettings, clamp="disc")  # a clamp that needs them
PLACES = ("position", "normal", "lobe_axis")
FIELDS = ("position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")
METHODS = {"sii": (sii, SiiSettings, {}), "multires": (multires, MultiresSettings, {}),
           "val": (val, ValSettings, {"clusters.count": 3, "maps.resolution": 8, "interleaving.block": 1}),
           "vpl": (vpl, VplSettings, {"visibility": False})}
SUMS = ("pairs.sum", "multires.evaluate", "cluster.irradiance", "vpl.light")
FOLDED = under("lights", fold(LightSettings, LIGHT_CASES, LIGHT_BASE, elsewhere=("",)))


def test_every_field_has_a_case():
    assert not uncovered(LightSettings, LIGHT_CASES, LIGHT_BASE)


@pytest.mark.parametrize("name", featured(LIGHT_CASES, LIGHTS))
def test_the_lights_are_those_of_the_twin(name):
    case = LIGHT_CASES[name]
    settings = case.settings(LightSettings, LIGHT_BASE)
    got, expected = chosen(case, settings), by_the_twin(case, settings)
    assert got.keys() == expected.keys()
    for field, values in expected.items():
        assert np.shape(got[field]) == values.shape, field
        assert apart(got[field], values) <= tolerance(field, settings), field


@pytest.mark.parametrize("name", LIGHT_CASES)
def test_each_key_counts(name):
    case = LIGHT_CASES[name]
    lights = chosen(case, case.settings(LightSettings, LIGHT_BASE))
    for key, other in case.without(LightSettings, LIGHT_BASE):
        assert differ(lights, chosen(case, other)) >= SHOWS, key


@cache
def frame_of(scene, options):
    """Return the frame of cases that share one."""
    return next(case for case in LIGHT_CASES.values() if frame_key(case) == (scene, options)).seen()


def frame_key(case):
    return case.scene, tuple(sorted(case.frame.items()))


def chosen(case, settings):
    """Return the planes of the lights that the method has, and their footprints."""
    frame = frame_of(*frame_key(case))
    lights = choose_lights(frame, settings)
    planes = {field: getattr(lights, field) for field in (*FIELDS, "drawn")}
    if lights.lobe_flux is None:
        dark = np.zeros_like(lights.flux)
        planes |= {"lobe_flux": dark, "lobe_axis": dark, "lobe_exponent": dark[0]}
    if lights.texel is not None:
        planes |= {"texel": lights.texel, "map_index": lights.map_index}
    if settings.has_footprints:
        planes["footprint"] = footprints(frame, settings, FOOTPRINTS)
    return planes


def by_the_twin(case, settings):
    """Return the same planes from the twin."""
    frame = frame_of(*frame_key(case))
    maps = drawn_maps(frame, getattr(settings.source, "projection", "auto"))
    arriving = [incident_flux(rsm.light, rsm.projection, None, np.float64) for rsm in maps]
    lights = pixel_lights(frame, arriving, settings)
    fields = [*FIELDS, *(("texel", "map_index") if settings.source.name() == "rsm" else ()),
              *(("footprint",) if settings.has_footprints else ())]
    planes = {field: np.array([getattr(light, field) for light in lights]).T for field in fields}
    return planes | {"drawn": np.array(drawn(frame, arriving, settings))}


def tolerance(field, settings):
    """Return how far a field may be off, as a share of its largest value."""
    if settings.source.name() == "walk":
        return PATHS if field in PLACES else EXACT
    refraction = settings.source.refraction
    traced = refraction is not None and refraction.name() == "two_interface"
    return WITHIN_GLASS if traced and field in (*PLACES, "lobe_flux", "footprint") else EXACT


def apart(got, expected):
    """Return the largest difference, as a share of the largest value of both."""
    largest = max(np.abs(values).max(initial=0) for values in (got, expected))
    return np.abs(got - expected).max(initial=0) / largest if largest else 0.0


def differ(lights, others):
    """Return by how much the flux or places of lights differ; by all where there are not as many."""
    return max(1.0 if lights[field].shape != others[field].shape else apart(lights[field], others[field])
               for field in FIELDS)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", featured(FOLDED, LIGHTS))
def test_the_method_sums_the_chosen_lights(name, method):
    function, kind, over = METHODS[method]
    case = FOLDED[name]
    settings = case.settings(kind, {f"lights.{key}": value for key, value in LIGHT_BASE.items()} | over)
    frame = case.seen()
    with observe(record=True) as log:
        function(frame, settings)
    expected = choose_lights(frame, settings.lights)
    summed = [run.arguments["lights"] for run in log.runs if run.name in SUMS]
    assert summed
    for lights in summed:
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(lights, field), getattr(expected, field), err_msg=field)
