"""The sum over pairs of pixel light and glossy receiver: against the definition, to rounding, and always the same."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.lights import PixelLights
from refgi.pairs.glossy_sum import FARTHEST, TILE_ROWS, M, load_lobes, receiver_lobes_of
from refgi.pairs.irradiance import block_order, glossy_radiance, glossy_summed
from refgi.pairs.lobe_culling import CORNERS, bound_receivers, lights_in_lobes
from refgi.pairs.pair_sum import GROUP, load_tile
from refgi.pairs.pixel_lights import Range, pack
from refgi.pairs.ranged_sum import LANES
from refgi.pairs.settings import DiscClamp, DistanceClamp, GeometryClamp, LobeSettings, PairSettings, SphereClamp
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.skips import count_skips, without_skip
from tests.glossy import defined
from tests.pairs.sets import random_directions

FLOAT64 = 2e-13  # of the largest: P = 10^6 multiplies the rounding of unit vectors by 10^3 where half is reflected
CUT_CONES = 1e-6  # the twin's quadrature where a horizon cuts a cone
U = 2.0**-24
PLAIN = PairSettings(clamp=None)
CLAMPS = {"distance": DistanceClamp(0.3), "geometry": GeometryClamp(2.0), "disc": DiscClamp()}


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def scattered(rng, count, lamps, exponent, real=np.float64, *, near=None):
    """Return receivers and lights anywhere, and the receivers' directions to the eye.

    `near`: a light is put in the lobe of each receiver, off its axis by about `near` times its width.
    """
    position, normal, w_o = rng.uniform(-1, 1, (3, count)), random_directions(rng, count), random_directions(rng, count)
    w_o = w_o * np.sign((w_o * normal).sum(axis=0))
    mirror = 2 * (w_o * normal).sum(axis=0) * normal - w_o
    exponents = np.broadcast_to(np.asarray(exponent, float), (count,))
    points = GlossyPoints(np.arange(count), position, normal, mirror, exponents, rng.uniform(0.1, 1, (3, count)))
    place, facing, flux = rng.uniform(-1, 1, (3, lamps)), random_directions(rng, lamps), rng.random((3, lamps))
    axis = random_directions(rng, lamps)
    if near is not None:
        of = np.arange(lamps) % count
        off = near / np.sqrt(exponents[of] + 1) * random_directions(rng, lamps)
        place = position[:, of] + rng.uniform(0.3, 2, lamps) * (mirror[:, of] + off)
        facing = -mirror[:, of]
    axis = axis * np.sign((axis * facing).sum(axis=0))
    lights = PixelLights(place, facing, flux, rng.random((3, lamps)), axis, rng.uniform(0, 30, lamps), lamps)
    if real is np.float32:
        points = GlossyPoints(points.pixel, *(part.astype(real) for part in points[1:]))
        lights = lights._replace(**{key: getattr(lights, key).astype(real) for key in (
            "position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")})
    return points, lights, w_o


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("exponent", [0.0, 1.0, 20.0, 1e3, 1e6])
def test_it_is_the_sum_of_the_definition(exponent, rng, evidence):
    """Some receivers see nothing in their lobe, others a light near its axis."""
    points, lights, w_o = scattered(rng, 300, 90, exponent, near=1.0)
    got, expected = glossy_radiance(points, lights, PLAIN), defined(points, lights, w_o, PLAIN)
    assert expected.max() > 0
    worst = np.abs(got - expected).max() / expected.max()
    assert worst < FLOAT64
    evidence(f"P = {exponent:g}: {worst:.1e} of the largest")


@pytest.mark.feature("REF-27")
def test_exponents_of_receivers_are_their_own(rng):
    exponents = np.resize([0.0, 3.0, 50.0, 700.0], 260)
    points, lights, w_o = scattered(rng, 260, 70, exponents)
    np.testing.assert_allclose(glossy_radiance(points, lights, PLAIN), defined(points, lights, w_o, PLAIN), rtol=1e-11,
                               atol=1e-13)


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("name", CLAMPS)
def test_pairs_are_clamped_as_those_of_irradiance(name, rng):
    points, lights, w_o = scattered(rng, 200, 80, 5.0)
    pairs, footprint = PairSettings(clamp=CLAMPS[name]), rng.uniform(0.05, 0.5, 80)
    expected = defined(points, lights, w_o, pairs, footprint)
    np.testing.assert_allclose(glossy_radiance(points, lights, pairs, footprint), expected, rtol=1e-11, atol=1e-13)
    assert np.abs(expected - defined(points, lights, w_o, PLAIN)).max() > 1e-3 * expected.max()


@pytest.mark.feature("REF-27")
def test_spheres_keep_the_lobe_of_their_centre(rng):
    points, lights, w_o = scattered(rng, 100, 40, 4.0)
    lights = lights._replace(lobe_flux=None, lobe_axis=None, lobe_exponent=None)
    pairs, footprint = PairSettings(clamp=SphereClamp()), rng.uniform(0.01, 0.1, 40)
    np.testing.assert_allclose(glossy_radiance(points, lights, pairs, footprint),
                               defined(points, lights, w_o, pairs, footprint), rtol=CUT_CONES, atol=1e-12)
    with pytest.raises(InputError, match="sphere"):
        glossy_radiance(points, scattered(rng, 1, 40, 4.0)[1], pairs, footprint)


@pytest.mark.parametrize("pairs", [PairSettings(clamp=None, offset=0.1),
                                   PairSettings(clamp=None, lobe=LobeSettings(norm="full_lobe")),
                                   PairSettings(clamp=None, lobe=LobeSettings(widening=1.5))], ids=str)
def test_senders_are_those_of_irradiance(pairs, rng):
    points, lights, w_o = scattered(rng, 100, 80, 5.0)
    np.testing.assert_allclose(glossy_radiance(points, lights, pairs), defined(points, lights, w_o, pairs), rtol=1e-8,
                               atol=1e-12)


def test_float32_keeps_the_stated_bound(rng, evidence):
    """Diffuse lights near the axis, one for each receiver, against the same numbers in float64."""
    worst = 0.0
    for exponent in (0.0, 1.0, 30.0, 1e3, 1e5):
        points, lights, _ = scattered(rng, 600, 600, exponent, np.float32, near=1.0)
        lights = lights._replace(lobe_flux=None, lobe_axis=None, lobe_exponent=None)
        wide = GlossyPoints(points.pixel, *(part.astype(float) for part in points[1:]))
        for k in range(0, 600, 7):
            one = PixelLights(*(part[..., k : k + 1] for part in lights[:3]), None, None, None, 1)
            here = GlossyPoints(*(part[..., k : k + 1] for part in points))
            got = glossy_radiance(here, one, PLAIN).astype(float)
            exact = glossy_radiance(GlossyPoints(*(part[..., k : k + 1] for part in wide)), one, PLAIN)
            if exact.max() == 0:
                continue
            d = one.position.astype(float) - here.position
            r, n, m = np.linalg.norm(d), here.normal.astype(float), here.mirrored.astype(float)
            w = d / r
            h = 0.5 * float(((m - w) ** 2).sum())
            if h > 0.9:
                continue
            peak = (exponent + 2) / (2 * math.pi) * here.specular.astype(float) * one.flux / math.pi
            lead = peak * (1 - h) ** exponent
            cosines = float((w * n).sum()) - float((w * one.normal).sum())
            bound = U * (exact * (20 + 5 * -exponent * math.log2(1 - h)
                                  + 6.5 * exponent * (math.sqrt(2 * h) + h) / (1 - h)) + 4 * lead * cosines / r**2)
            worst = max(worst, float((np.abs(got - exact) / bound).max()))
    assert worst < 1
    evidence(f"{worst:.2f} of the bound")


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_the_sharpest_lobe_is_finite(real, rng):
    points, lights, _ = scattered(rng, 300, 90, 1e20, real, near=0.0)
    got = glossy_radiance(points, lights, PLAIN)
    assert np.isfinite(got).all()
    assert (got >= 0).all()


def test_lights_at_a_receiver_give_nothing(rng):
    points, lights, _ = scattered(rng, 5, 5, 10.0)
    got = glossy_radiance(points, lights._replace(position=points.position.copy()), PLAIN)
    assert np.isfinite(got).all()


@pytest.mark.feature("REF-19")
def test_bits_do_not_depend_on_order_tiles_threads_or_culling(rng):
    points, lights, _ = scattered(rng, 1500, 150, np.resize([0.0, 9.0, 400.0], 1500), np.float32)
    whole = glossy_radiance(points, lights, PLAIN)
    order = rng.permutation(1500)
    mixed = glossy_radiance(GlossyPoints(*(np.ascontiguousarray(part[..., order]) for part in points)), lights, PLAIN)
    assert np.array_equal(mixed, whole[:, order])
    assert np.array_equal(glossy_radiance(points, lights, PLAIN, width=37), whole)
    for first in (0, 700):
        part = slice(first, first + 333)
        some = GlossyPoints(*(np.ascontiguousarray(plane[..., part]) for plane in points))
        assert np.array_equal(glossy_radiance(some, lights, PLAIN), whole[:, part])
    with threads(1), without_skip("pairs.tiles"):
        assert np.array_equal(glossy_radiance(points, lights, PLAIN), whole)


def patch(exponent, real, count=200):
    """Return receivers of a curved patch seen from above, and lights all around it, some of them on its axes."""
    rng = np.random.default_rng(3)
    x, z = rng.uniform(-0.2, 0.2, (2, count))
    position, normal = np.stack([x, 0.3 * x**2, z]), np.stack([-0.6 * x, np.ones(count), np.zeros(count)])
    normal /= np.linalg.norm(normal, axis=0)
    w_o = np.array([0.3, 2.0, 0.4])[:, None] - position
    w_o /= np.linalg.norm(w_o, axis=0)
    mirror = 2 * (w_o * normal).sum(axis=0) * normal - w_o
    on_axes = (position + rng.uniform(0.3, 2, count) * mirror)[:, :40]
    place = np.concatenate([rng.uniform(-2, 2, (3, 260)), on_axes], axis=1)
    facing = -place / np.linalg.norm(place, axis=0)
    lamps = place.shape[1]
    lights = PixelLights(place, facing, rng.random((3, lamps)), rng.random((3, lamps)), facing,
                         rng.uniform(0, 60, lamps), lamps)
    points = GlossyPoints(np.arange(count), position, normal, mirror, np.resize(exponent, count).astype(float),
                          rng.uniform(0.1, 1, (3, count)))
    points = GlossyPoints(points.pixel, *(part.astype(real) for part in points[1:]))
    return points, lights._replace(**{key: getattr(lights, key).astype(real) for key in (
        "position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")})


@pytest.mark.feature("REF-19")
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("exponent", [0.5, 300.0, 5e3, 1e6, [50.0, 1e5]], ids=str)
def test_lights_off_the_lobes_are_passed_over_to_the_same_bits(exponent, real):
    points, lights = patch(exponent, real)
    for pairs, senders in ((PLAIN, lights), (PairSettings(clamp=None, lobe=LobeSettings(widening=1.5)), lights),
                           (PairSettings(clamp=SphereClamp()), lights._replace(lobe_flux=None))):
        footprint = np.full(lights.position.shape[1], 0.05)
        with count_skips() as counts:
            got = glossy_radiance(points, senders, pairs, footprint)
        with without_skip("pairs.tiles", "pairs.lobe_tiles", "pairs.receiver_lobes"):
            assert np.array_equal(glossy_radiance(points, senders, pairs, footprint), got)
        assert (got > 0).any()
        left_out, pairs_of_tile = counts["pairs.receiver_lobes"]
        assert pairs_of_tile % (4 * 300) == 0
        assert left_out > 0.5 * pairs_of_tile or np.min(exponent) < 5e3


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("exponent", [0.5, 300.0, 1e6])
@pytest.mark.parametrize("turn", range(6))
def test_a_tile_keeps_every_light_that_lies_in_a_lobe_of_it(exponent, real, turn):
    """Whichever way it faces."""
    points, lights = patch(exponent, real, 64)
    sign = real(1 - 2 * (turn % 2))
    points = points._replace(**{key: np.ascontiguousarray(sign * np.roll(getattr(points, key), turn // 2, axis=0))
                                for key in ("position", "normal", "mirrored")})
    lights = lights._replace(position=np.ascontiguousarray(sign * np.roll(lights.position, turn // 2, axis=0)))
    of = receiver_lobes_of(points.mirrored, points.exponent)
    tile = np.zeros((TILE_ROWS, LANES), real)
    load_tile(tile, points.position, points.normal, 0, 64)
    load_lobes(tile, of, 0, 64)
    low, high, chosen = np.empty(CORNERS, real), np.empty(CORNERS, real), np.arange(300)
    cosine = bound_receivers(tile, M, FARTHEST, 64, low, high)
    kept = chosen[: lights_in_lobes(lights.position, low, high, cosine, 300, chosen)]
    d = lights.position[:, :, None].astype(float) - points.position[:, None].astype(float)
    gap = 1 - (d * points.mirrored[:, None]).sum(axis=0) / np.linalg.norm(d, axis=0)
    inside = np.flatnonzero((gap < of.farthest).any(axis=1))
    assert set(inside) <= set(kept)
    assert (np.diff(kept) > 0).all()
    assert len(inside) >= 40
    assert len(kept) < 150 or exponent < 5e3


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("outside", [False, True])
def test_a_range_weighs_pairs_by_what_arrives_at_most(outside, rng):
    """max(1, I_low / B) where B >= xi I_low, B the irradiance without the receiver's cosine; outside, 1 less that."""
    points, lights, w_o = scattered(rng, 150, 60, 5.0)
    packed = pack(lights, PLAIN, None, np.float64)
    square, xi = rng.uniform(0.2, 1, 60), rng.uniform(0.3, 1, 60)
    reach = Range(np.append(square, 1.0), np.append(xi, 1.0), outside), Range(square, xi, outside)

    def factor(part):
        away = points.position[:, None].astype(float) - lights.position[..., None]
        r2, exponent = (away**2).sum(axis=0), lights.lobe_exponent[:, None] if part else 1.0
        axis = (lights.lobe_axis if part else lights.normal)[..., None]
        cosine = np.maximum(0, (away * axis).sum(axis=0)) / np.sqrt(r2)
        above = (away * lights.normal[..., None]).sum(axis=0) > 0
        b = square[:, None] * np.where(above, cosine**exponent, 0) / r2
        kept = np.where(b >= xi[:, None], np.maximum(1, 1 / np.maximum(b, 1e-300)), 0.0)
        return 1 - kept if outside else kept

    assert (lights.lobe_exponent > 0).all()
    np.testing.assert_allclose(glossy_summed(points, packed, reach), defined(points, lights, w_o, PLAIN, factor=factor),
                               rtol=1e-9, atol=1e-12)


def test_blocks_follow_blocks():
    """Each pixel once; 16 x 16 pixels after each other, 8 x 8 within them, 4 x 4 within those."""
    pixel = np.arange(40 * 50)
    order = block_order(pixel, 50)
    assert np.array_equal(np.sort(order), pixel)
    row, column = np.divmod(order[:256], 50)
    assert (row.max(), column.max()) == (15, 15)
    assert (row[:64].max(), column[:64].max()) == (7, 7)
    assert (row[:16].max(), column[:16].max()) == (3, 3)


@pytest.mark.parametrize("lobe", [False, True], ids=["diffuse", "lobe"])
def test_groups_are_summed_apart(lobe):
    """Analytic: lights of a second group that are too dim to be added to the first's sum one by one count together."""
    real, count = np.float32, 2 * GROUP
    share = np.full(count, 2.0**-60)
    share[0], share[GROUP:] = 1.0, 2.0**-25
    above, flux = np.array([[0.0], [0.0], [1.0]], real), np.tile(share, (3, 1)).astype(real)
    everywhere, none = np.repeat(above, count, axis=1), np.zeros((3, count), real)
    points = GlossyPoints(np.zeros(1, int), np.zeros((3, 1), real), above, above, np.full(1, 8, real),
                          np.ones((3, 1), real))
    lights = PixelLights(everywhere, -everywhere, none if lobe else flux, flux if lobe else none, -everywhere,
                         np.full(count, 4, real), count)
    if not lobe:
        lights = lights._replace(lobe_flux=None, lobe_axis=None, lobe_exponent=None)
    alone = lights._replace(**{key: part[..., :1] for key, part in lights._asdict().items()
                               if part is not None and key != "drawn"})
    ratio = glossy_radiance(points, lights, PLAIN).astype(float) / glossy_radiance(points, alone, PLAIN)
    # roundings of both sums and of the norm; joined, the second group's lights would be lost: 32 U
    np.testing.assert_allclose(ratio, 1 + GROUP * 2.0**-25, rtol=0, atol=4 * U)
