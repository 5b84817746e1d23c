"""Gathering: the weight of its samples, its limit, the interpolation between coarse pixels."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.scene import DirectionalLight, PointLight, load_scene
from refgi.settings import of
from refgi.splat import GatherSettings, Receivers, SiiSettings, gather, sii
from refgi.splat.gather.gather import gather_counted, gather_irradiance
from refgi.splat.gather.gather_sum import SimilarityLimits, coarse_pixels, disc_pattern, interpolate
from tests.literal.whole import gather as naive

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

WHOLE_MAP = 1.5  # a disc around any texel with this radius holds the map


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=64, height=64, rsm_resolution=64)


@pytest.fixture(scope="module")
def full_sum(box):
    return sii(box, of(SiiSettings, pattern="all", clamp="none"))


def relative(image, reference):
    return float(np.abs(image - reference).mean() / reference.mean())


@pytest.mark.feature("SII-25")
def test_weight_xi1_integrates_the_disc(evidence):
    """The disc integral of exp(-4 rho) is 2 pi (1 - 5 e^-4) / 16 = 0.3567; normalised xi_1^2 gives 0.2244."""
    exact = 2 * math.pi * (1 - 5 * math.exp(-4)) / 16
    found = []
    for squared, expected in ((False, exact), (True, 0.2244)):
        down, right, weight = disc_pattern(100_000, 0, squared).T
        found.append(float((weight * np.exp(-4 * np.hypot(down, right))).mean()))
        assert found[-1] == pytest.approx(expected, abs=1e-4)
    evidence(f"exp(-4 rho): {found[0]:.4f} with xi_1 (exact {exact:.4f}), {found[1]:.4f} with xi_1^2")


@pytest.mark.parametrize("seed", [0, 3])
def test_pattern_lies_in_the_disc(seed):
    down, right, weight = disc_pattern(1000, seed).T
    assert (np.hypot(down, right) <= 1).all()
    assert weight.mean() == pytest.approx(math.pi, rel=0.01)
    assert (np.hypot(down.mean(), right.mean())) < 0.02


@pytest.mark.feature("SII-25")
@pytest.mark.parametrize("offset", [0.0, 0.03])
def test_sum_is_that_of_the_literal_text(offset):
    frame = Frame(load_scene("cornell_box"), width=12, height=12, dtype=np.float64, rsm_resolution=32)
    settings = of(GatherSettings, samples=60, radius=0.4, interpolation="none", offset=offset)
    expected = naive.every_sum(frame.gbuffer, frame.rsms, settings.disc)
    assert np.count_nonzero(frame.gbuffer.covered & np.isfinite(frame.rsms[0].project(frame.gbuffer.position)[0])) > 50
    np.testing.assert_allclose(gather(frame, settings), expected, rtol=1e-10, atol=1e-15)


@pytest.mark.feature("SII-25")
def test_converges_to_the_full_sum(box, full_sum, evidence):
    errors = [relative(gather(box, of(GatherSettings, samples=s, radius=WHOLE_MAP, interpolation="none")), full_sum)
              for s in (156, 1020, 10_000, 100_000)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 5e-3
    slope = math.log(errors[-1] / errors[0]) / math.log(100_000 / 156)
    assert slope < -0.5
    evidence("mean |error| to the sum over all texels, 156 .. 100,000 samples: "
             + ", ".join(f"{e:.4f}" for e in errors) + f" (~ S^{slope:.2f})")


@pytest.mark.feature("SII-25")
def test_paper_presets_of_samples_and_radius(box, full_sum, evidence):
    """A small disc misses the light of the rest of the map; the preset's samples lower the noise, not that loss."""
    found = []
    for samples in (156, 308, 1020):
        got = gather(box, of(GatherSettings, samples=samples))
        assert got.mean() < full_sum.mean()
        found.append(f"S = {samples}: {got.mean() / full_sum.mean():.3f}")
    wide = [gather(box, of(GatherSettings, samples=5000, radius=r, interpolation="none")).mean()
            for r in (0.1, 0.3, 0.6, WHOLE_MAP)]
    assert wide == sorted(wide)
    evidence("share of the full sum at r_max = 0.3: " + ", ".join(found))


@pytest.mark.feature("SII-25")
def test_published_weight_loses_light(box, full_sum, evidence):
    how = {"samples": 20_000, "radius": WHOLE_MAP, "interpolation": "none"}
    plain = gather(box, of(GatherSettings, **how))
    squared = gather(box, of(GatherSettings, **how, as_published=frozenset({"rsm_weight_squared"})))
    assert relative(plain, full_sum) < 0.02
    assert relative(squared, full_sum) > 0.1
    evidence(f"rsm_weight_squared: {squared.mean() / full_sum.mean():.3f} of the full sum, mean |error| "
             f"{relative(squared, full_sum):.2f} against {relative(plain, full_sum):.3f}")


@pytest.mark.feature("SII-25")
@pytest.mark.parametrize("light", [PointLight((0.278, 0.4, -0.2), (1.0, 1.0, 1.0)),
                                   DirectionalLight((0.3, -1.0, 0.4), (1.0, 1.0, 1.0))])
def test_other_lights_converge_too(box, light):
    frame = Frame(box.scene.with_lights(light), width=16, height=16, rsm_resolution=32)
    full = sii(frame, of(SiiSettings, pattern="all", clamp="none"))
    got = gather(frame, of(GatherSettings, samples=200_000, radius=10.0 if isinstance(light, PointLight) else WHOLE_MAP,
                                  interpolation="none"))
    assert full.mean() > 0
    assert relative(got, full) < 0.05


@pytest.mark.feature("SII-25")
def test_interpolation_saves_work_and_costs_little(evidence):
    frame = Frame(load_scene("cornell_box"), width=256, height=256, rsm_resolution=64)
    exact = gather(frame, of(GatherSettings, interpolation="none"))
    result = gather_counted(frame, of(GatherSettings, grid=64))
    assert result.covered == np.count_nonzero(frame.gbuffer.covered)
    assert result.evaluated < 0.4 * result.covered
    assert relative(result.irradiance, exact) < 0.06
    all_of_them = gather_counted(frame, of(GatherSettings, grid=64, reach=0.0))
    np.testing.assert_array_equal(all_of_them.irradiance, exact)
    assert all_of_them.evaluated == result.covered
    evidence(f"64^2 of 256^2: {result.evaluated} of {result.covered} pixels run the sum, mean |difference| "
             f"{relative(result.irradiance, exact):.3f}; nobody agrees: equal to the bit")


def plane(height, width):
    """A flat floor seen from above, one metre a pixel."""
    y, x = np.mgrid[:height, :width].astype(float)
    position = np.stack([x, y, np.zeros_like(x)])
    normal = np.zeros_like(position)
    normal[2] = 1
    return Receivers(position, normal, np.ones((height, width), bool))


@pytest.mark.feature("SII-25")
def test_interpolation_is_bilinear_on_a_plane():
    floor = plane(20, 30)
    light = np.stack([1 + floor.position[0], 2 + floor.position[1], floor.position[0] * 0 + 5])
    coarse = coarse_pixels(20, 30, 5)
    got, done = interpolate(floor, light, coarse, SimilarityLimits(0.9, 100.0))
    assert done.all()
    inside = np.s_[:, coarse[0][0] : coarse[0][-1] + 1, coarse[1][0] : coarse[1][-1] + 1]
    np.testing.assert_allclose(got[inside], light[inside], rtol=1e-12)


@pytest.mark.feature("SII-25")
def test_interpolation_keeps_to_one_side_of_a_step():
    floor = plane(16, 16)
    floor.position[2, :, 8:] = 50  # a cliff
    light = np.where(floor.position > 1e9, 0, np.where(np.arange(16) < 8, 1.0, 9.0))
    got, done = interpolate(floor, light, coarse_pixels(16, 16, 4), SimilarityLimits(0.9, 20.0))
    np.testing.assert_allclose(got[:, done], light[:, done])
    assert 0.4 < done.mean() < 1


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (5, 64)])
def test_interpolation_at_any_size(size):
    floor = plane(*size)
    light = np.ones((3, *size))
    got, done = interpolate(floor, light, coarse_pixels(*size, 4), SimilarityLimits(0.9, 1e9))
    np.testing.assert_allclose(got[:, done], 1)
    assert done.any()


@pytest.mark.feature("REF-19")
def test_same_bits_for_any_threads_and_neighbours(box, evidence):
    how = of(GatherSettings, samples=100, grid=16)
    whole = gather(box, how)
    with threads(1):
        np.testing.assert_array_equal(gather(box, how), whole)
    buffer = box.gbuffer
    some = buffer.covered & (np.random.default_rng(1).random(buffer.covered.shape) < 0.3)
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    np.testing.assert_array_equal(gather_irradiance(receivers._replace(covered=some), box.rsms, how.disc),
                                  gather_irradiance(receivers, box.rsms, how.disc) * some)
    evidence("equal bits for 1 and 2 threads, and for 30 % of the pixels alone")


def test_settings_are_checked():
    for change in ({"samples": 0}, {"radius": 0.0}, {"seed": -1}, {"grid": -1}, {"least_cosine": 2.0}, {"reach": -1.0},
                   {"offset": math.inf}, {"offset": 1e300}, {"radius": 1e300}, {"as_published": {"xi"}}):
        with pytest.raises(InputError, match=next(iter(change))):
            of(GatherSettings, **change)
