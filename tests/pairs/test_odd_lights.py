"""Lights without flux, of huge flux, with lobes of any exponent and axis: packed and ranged to finite numbers."""

import math

import numpy as np
import pytest

from refgi.pairs.pixel_lights import HEADROOM, PixelLights, pack
from refgi.pairs.settings import PairSettings
from refgi.settings import of
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.threshold import all_peaks, light_range, low_irradiance

UP = np.array([[0.0], [1.0], [0.0]], np.float32)
NORMS = ("none", "full_lobe", "clamped")
SETTINGS = ({}, {"clamp": "disc"}, {"clamp": "sphere", "clamp_value": 1e18}, {"clamp": "distance", "clamp_value": 1e18},
            {"widening": 1e9}, {"cut_share": 1e9, "reference_length": 1e-9}, {"cut_irradiance": 1e300},
            {"as_published": {"per_light_ilow"}, "reference_length": 1e-9})


def odd_lights(flux: float, exponent: float, axis: tuple[float, float, float]) -> PixelLights:
    def planes(values):
        return np.ascontiguousarray(np.broadcast_to(np.asarray(values, np.float32).reshape(3, -1), (3, 3)))

    return PixelLights(planes([1e9] * 3), planes(UP), planes([flux] * 3), planes([flux] * 3), planes(axis),
                       np.full(3, exponent, np.float32), 3)


@pytest.mark.parametrize("flux", [0.0, 1e-45, 1.0, 1e20, 1e38])
@pytest.mark.parametrize("exponent", [0.0, 1e20])
@pytest.mark.parametrize("axis", [(0, 1, 0), (0, -1, 0), (1, -1e-3, 0), (0, 0, 0)])
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_all_that_is_packed_is_finite(flux, exponent, axis, real):
    lights = odd_lights(flux, exponent, axis)
    for norm in NORMS:
        for options in SETTINGS:
            settings = of(SiiSettings, lobe_norm=norm, **options)
            for footprint in (0.0, 3e38):
                packed = pack(lights, settings.pairs, np.full(3, footprint), real)
                assert np.isfinite(packed.diffuse).all()
                assert packed.lobes is None or np.isfinite(packed.lobes.lights).all()
                assert packed.spheres is None or np.isfinite(packed.spheres).all()
                low = low_irradiance(lights, settings)
                assert math.isfinite(low)
                for peak in all_peaks(packed):
                    assert np.isfinite(light_range(peak, low, settings.reach, 0, real).square).all()


def test_peaks_within_the_dtype_are_as_the_equation_says():
    lights = odd_lights(2.0, 9.0, (0, 1, 0))
    packed = pack(lights, of(PairSettings, lobe_norm="full_lobe"), None, np.float64)
    assert packed.lobes.lights[10:13] == pytest.approx(np.full((3, 3), 2 * 10 / (2 * math.pi)), rel=1e-12)
    beyond = pack(odd_lights(1e20, 1e20, (0, 1, 0)), of(PairSettings, lobe_norm="full_lobe"), None, np.float32)
    assert beyond.lobes.lights[10:13].max() == np.float32(np.finfo(np.float32).max / HEADROOM)


def test_a_tiny_share_cuts_nothing_for_any_light():
    settings = of(SiiSettings, as_published={"per_light_ilow"}, cut_share=1e-300, reference_length=1.0)
    reach = light_range(np.array([1.0, 0.0, 1e-30]), 0.0, settings.reach, 0, np.float32)
    farthest = math.sqrt(np.finfo(np.float32).max)
    assert reach.square.tolist() == [np.float32(farthest), 0.0, np.float32(farthest)]
