"""Eq. 2 for diffuse lights: oracle, closed forms, properties, sameness; the order of tiles."""

import math

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi.errors import InputError
from refgi.jit import threads
from refgi.literal import pairs as literal
from refgi.pairs.pair_sum import GROUP, TILE, geometry_term, sum_pairs
from refgi.pairs.pixel_lights import pack_diffuse
from refgi.pairs.tiles import block_by_block, bound_tile, lights_in_reach
from refgi.settings import of
from refgi.splat import PairSettings, Receivers, irradiance
from tests.pairs import sets

PLAIN = PairSettings()
# one term: about 15 roundings, each of half a unit; a group of 64 and its partial sums add a few more
ROUNDING = {np.float32: 3e-6, np.float64: 1e-14}
SPHERE = {np.float32: 1e-5, np.float64: 1e-12}  # what the issue asks of the integrating sphere


def summed(receivers, lights, settings=PLAIN, footprint=None):
    return irradiance(receivers, lights, settings, footprint)[:, 0].astype(np.float64)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-04")
def test_sum_is_that_of_the_twin(real, evidence):
    rng = np.random.default_rng(1)
    receivers, lights = sets.room(rng, 37, real)
    to, of_lights = ([part.astype(np.float64) for part in parts] for parts in (receivers[:2], lights[:3]))
    expected = literal.irradiance(*to, np.zeros((1, 37)), *of_lights)[:, 0]
    got = summed(receivers, lights)
    assert not got[expected == 0].any()
    error = np.abs(got - expected)[expected > 0].max() / expected.mean()
    assert error < 10 * ROUNDING[real]  # near pairs count most and lose a digit by cancellation
    evidence(f"{np.dtype(real).name}: max error against the literal sum {error:.1e} of its mean over 37^2 pairs")


@pytest.mark.feature("SII-04")
def test_one_light_by_hand():
    # light at the origin facing +z; receiver 2 m away at 60 degrees, facing it: E = Phi/pi * 1/2 * 1 / 4
    x = 2 * np.array([[math.sin(math.pi / 3)], [0.0], [math.cos(math.pi / 3)]])
    lights = sets.lights(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), [[1.0], [2.0], [4.0]])
    got = summed(sets.receivers(x, -x / 2), lights)
    np.testing.assert_allclose(got[:, 0], np.array([1, 2, 4]) / (8 * math.pi), rtol=1e-15)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-04", "REF-06")
def test_integrating_sphere_is_exact_for_any_lights(real, evidence):
    """The kernel is 1 / (4 R^2) for every pair. Lights fill the sphere up to z = 0.3 R, receivers lie above 0.6 R:
    of points much nearer than that the float32 positions themselves are off the sphere."""
    rng = np.random.default_rng(2)
    radius, worst = 3.0, 0.0
    above = sets.random_directions(rng, 20000)
    above = above[:, above[2] > 0.6]
    for count, spread in ((1, 9.0), (2, 9.0), (63, 9.0), (1000, 9.0), (4097, 0.05), (30000, 9.0)):
        around = sets.unit(np.array([[0.3], [0.4], [-0.8]]) + spread * rng.normal(size=(3, count)))
        around[2] = np.where(around[2] > 0.3, -around[2], around[2])
        flux = rng.random((3, count)) ** 8 * 1e3
        lights = sets.lights(*sets.in_sphere(around, radius), flux, real)
        got = summed(sets.receivers(*sets.in_sphere(above, radius), real), lights)
        expected = lights.flux.astype(np.float64).sum(axis=1) / (4 * math.pi * radius**2)
        worst = max(worst, np.abs(got / expected[:, None] - 1).max())
    assert worst < SPHERE[real]
    evidence(f"{np.dtype(real).name}: E = sum Phi / (4 pi R^2) to {worst:.1e} for six sets of lights")


@pytest.mark.feature("SII-04")
def test_a_sphere_around_a_light_collects_its_flux(evidence):
    x, w = np.polynomial.legendre.leggauss(32)
    cosine, weight = (x + 1) / 2, w / 2
    n = sets.unit(np.array([[1.0], [2.0], [-2.0]]))
    across = sets.unit(np.cross(n[:, 0], [0, 1, 0])[:, None])
    worst = 0.0
    for radius in (1e-3, 1.0, 50.0):
        directions = n * cosine + across * np.sqrt(1 - cosine**2)
        got = summed(sets.receivers(radius * directions, -directions), sets.lights(np.zeros((3, 1)), n, 5.0))
        collected = 2 * math.pi * radius**2 * (got * weight).sum(axis=1)
        worst = max(worst, np.abs(collected / 5 - 1).max())
    assert worst < 1e-13
    evidence(f"flux through spheres of 1 mm to 50 m: Phi to {worst:.0e}")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("REF-05")
def test_reciprocity(real, evidence):
    """Swapping light and receiver changes nothing: both cosines and r are symmetric."""
    rng = np.random.default_rng(4)
    places, facing = rng.uniform(-1, 1, (3, 400)), sets.random_directions(rng, 400)
    there = np.array([summed(sets.receivers(places[:, [a]], facing[:, [a]], real),
                             sets.lights(places[:, [b]], facing[:, [b]], 1.0, real))[0, 0]
                      for a, b in zip(range(200), range(200, 400), strict=True)])
    back = np.array([summed(sets.receivers(places[:, [b]], facing[:, [b]], real),
                            sets.lights(places[:, [a]], facing[:, [a]], 1.0, real))[0, 0]
                     for a, b in zip(range(200), range(200, 400), strict=True)])
    assert (there > 0).sum() > 30
    np.testing.assert_array_equal(there, back)
    evidence(f"{np.dtype(real).name}: E unchanged to the bit over 200 swapped pairs")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("REF-05")
def test_linear_in_flux_to_the_bit(real, evidence):
    receivers, lights = sets.room(np.random.default_rng(5), 300, real)
    once, twice = (summed(receivers, lights._replace(flux=lights.flux * real(s))) for s in (1, 2))
    np.testing.assert_array_equal(2 * once, twice)
    parts = [sets.PixelLights(*(part[:, a : a + 150] for part in lights[:3]), None, None, None, 150) for a in (0, 150)]
    np.testing.assert_allclose(sum(summed(receivers, part) for part in parts), once, rtol=ROUNDING[real])
    evidence("twice the flux: twice E, to the bit; E of two halves of the lights adds up")


@pytest.mark.feature("SII-04", "REF-05")
@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**16), scale=st.sampled_from([0.25, 2.0, 1024.0]))
def test_properties(seed, scale):
    rng = np.random.default_rng(seed)
    receivers, lights = sets.room(rng, 40)
    plain = summed(receivers, lights)
    # lengths by a power of two: E by its inverse square, to the bit
    grown = summed(receivers._replace(position=receivers.position * scale),
                   lights._replace(position=lights.position * scale))
    np.testing.assert_array_equal(grown, plain / scale**2)
    # the order of the lights matters to rounding alone
    order = rng.permutation(40)
    shuffled = lights._replace(**{key: getattr(lights, key)[:, order] for key in ("position", "normal", "flux")})
    np.testing.assert_allclose(summed(receivers, shuffled), plain, rtol=ROUNDING[np.float64], atol=1e-300)
    # rigid motion
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shift = rng.normal(size=(3, 1))
    places, facing = turn @ receivers.position[:, 0] + shift, turn @ receivers.normal[:, 0]
    moved = summed(sets.receivers(places, facing),
                   lights._replace(position=turn @ lights.position + shift, normal=turn @ lights.normal))
    np.testing.assert_allclose(moved, plain, rtol=1e-9, atol=1e-12)


@pytest.mark.feature("SII-04")
def test_zero_behind_either_plane():
    rng = np.random.default_rng(6)
    below = rng.uniform(-1, 1, (3, 50)) * [[1], [1], [0]] + [[0], [0], [-0.5]]
    up, down = np.tile([[0.0], [0], [1]], 50), np.tile([[0.0], [0], [-1]], 50)
    above = below * [[1], [1], [0]] + [[0], [0], [0.5]]
    assert not summed(sets.receivers(below, up), sets.lights(above, up, 1.0)).any()  # behind the light
    assert not summed(sets.receivers(above, up), sets.lights(below, up, 1.0)).any()  # light behind the receiver
    assert summed(sets.receivers(above, down), sets.lights(below, up, 1.0)).all()


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_coincident_and_nearly_coincident_lights_stay_finite(real):
    rng = np.random.default_rng(7)
    places = rng.uniform(-1, 1, (3, 64))
    facing = sets.random_directions(rng, 64)
    got = summed(sets.receivers(places, facing, real), sets.lights(places, facing, 1.0, real))
    assert np.isfinite(got).all()
    at = np.zeros((3, 1))
    up, down = np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [-1]])
    assert not summed(sets.receivers(at, up, real), sets.lights(at, up, 1.0, real)).any()
    for distance in 10.0 ** -np.arange(1, 45 if real is np.float32 else 300, 4):
        got = summed(sets.receivers(distance * up, down, real), sets.lights(at, up, 1.0, real))
        assert np.isfinite(got).all()


@pytest.mark.parametrize("clamp", ["none", "distance", "geometry", "disc", "sphere"])
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("REF-19")
def test_same_bits_for_any_threads_tiles_and_neighbours(real, clamp, evidence):
    rng = np.random.default_rng(8)
    receivers, lights = sets.room(rng, 1111, real)
    footprint = rng.random(1111)
    how = of(PairSettings, clamp=clamp, **({"clamp_value": 0.1} if clamp in ("distance", "geometry") else {}))
    whole = irradiance(receivers, lights, how, footprint)
    for count in range(1, numba.config.NUMBA_NUM_THREADS + 1):
        with threads(count):
            np.testing.assert_array_equal(irradiance(receivers, lights, how, footprint), whole)
    for cut in (1, 255, 256, 700):  # other tiles, other neighbours, scattered pixels
        sides = [irradiance(Receivers(*(np.ascontiguousarray(part[..., side]) for part in receivers)), lights, how,
                            footprint) for side in (np.s_[:cut], np.s_[cut:])]
        np.testing.assert_array_equal(np.concatenate(sides, axis=-1), whole)
    covered = rng.random((1, 1111)) < 0.4
    some = irradiance(receivers._replace(covered=covered), lights, how, footprint)
    np.testing.assert_array_equal(some, whole * covered)
    evidence(f"{np.dtype(real).name}, clamp {clamp}: equal bits for 1 and 2 threads, four cuts, 40 % coverage")


def test_passing_over_lights_changes_no_bit_and_saves_some():
    """A cube seen as six walls: receivers in order share tiles with their wall, shuffled ones with all walls."""
    rng = np.random.default_rng(13)
    wall = np.repeat(np.arange(6), 1024)
    places = rng.uniform(-1, 1, (3, 6144))
    facing = np.zeros((3, 6144))
    facing[wall // 2, np.arange(6144)] = 1 - 2 * (wall % 2)
    places[wall // 2, np.arange(6144)] = 1 - 2 * (wall % 2)  # outer faces: no light of one wall reaches another
    facing[:, 3000:] *= -1  # and some inner ones
    lights = sets.lights(places[:, ::3], facing[:, ::3], rng.random((3, 2048)), np.float32)
    ordered = summed(sets.receivers(places, facing, np.float32), lights)
    order = rng.permutation(6144)
    shuffled = summed(sets.receivers(places[:, order], facing[:, order], np.float32), lights)
    np.testing.assert_array_equal(shuffled, ordered[:, order])
    assert (ordered > 0).any()
    tile = np.concatenate([places, facing])[:, :TILE].astype(np.float32)  # a piece of the outside of one wall
    box = tile.min(axis=1), tile.max(axis=1)
    packed = pack_diffuse(lights, PLAIN, np.float32, np.ones(2048, bool))
    listed = lights_in_reach(packed, 0, 2048, *box, np.empty(2048, bool), np.empty(2049, np.int64))
    assert listed < 0.6 * 2048


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**16), spread=st.sampled_from([1e-4, 0.1, 2.0]), far=st.sampled_from([0.0, 100.0]))
def test_no_light_that_adds_anything_is_passed_over(seed, spread, far):
    rng = np.random.default_rng(seed)
    middle, n = rng.normal(size=(3, 1)) + far, sets.random_directions(rng, 1)
    tile = np.zeros((6, TILE), np.float32)
    tile[:3] = middle + spread * rng.normal(size=(3, TILE))
    tile[3:] = sets.unit(n + spread * rng.normal(size=(3, TILE)))
    lights = sets.lights(middle + rng.normal(size=(3, 200)), sets.random_directions(rng, 200), 1.0, np.float32)
    on_plane = n - n * (n * lights.normal).sum(axis=0)  # half of them in the tile's plane or with it in theirs
    lights.position[:, ::4] = middle + on_plane[:, ::4]
    packed = pack_diffuse(lights, PLAIN, np.float32, np.ones(200, bool))
    low, high = np.empty(6, np.float32), np.empty(6, np.float32)
    bound_tile(tile, TILE, low, high)
    chosen = np.empty(201, np.int64)
    listed = chosen[: lights_in_reach(packed, 0, 200, low, high, np.empty(200, bool), chosen)]
    for k in set(range(200)) - set(listed.tolist()):
        for lane in range(0, TILE, 17):
            d = packed[:3, k] - tile[:3, lane]
            assert geometry_term(*d, *packed[3:6, k], *tile[3:, lane]) == 0


def test_black_lights_change_no_bit():
    rng = np.random.default_rng(9)
    receivers, lights = sets.room(rng, 129)
    flux = lights.flux * (rng.random(129) < 0.5)
    packed = pack_diffuse(lights._replace(flux=flux), PLAIN, np.float64, np.ones(129, bool))
    assert packed.shape == (9, 130)
    assert not packed[6:, -1].any()
    bare = np.zeros((3, 129))
    sum_pairs(*(np.ascontiguousarray(part[:, 0]) for part in receivers[:2]), packed, None, True, bare)
    # the public function drops black lights, which moves the others into other groups: rounding may differ
    np.testing.assert_allclose(summed(receivers, lights._replace(flux=flux)), bare, rtol=ROUNDING[np.float64])


@pytest.mark.parametrize("culls", [True, False])
def test_a_light_behind_all_receivers_is_passed_over(culls):
    """Only where it culls: what is not a number there is not even read."""
    up = np.array([[0.0], [0.0], [1.0]])
    lights = sets.lights(np.array([[0.0, 0.0], [0, 0], [1, -1]]), np.repeat(-up, 2, axis=1), 1.0)
    packed = pack_diffuse(lights, PLAIN, np.float64, np.ones(2, bool))
    packed[6:, 1] = np.nan  # of the light below the receiver
    found = np.zeros((3, 1))
    sum_pairs(0 * up, up, packed, None, culls, found)
    assert np.isnan(found).all() != culls
    if culls:
        np.testing.assert_allclose(found, 1 / np.pi)


def test_many_float32_lights_add_up_without_drift():
    """A plain float32 sum of 200,000 equal terms drifts by 1e-4 and more; groups keep it at rounding."""
    count = 200_000
    rng = np.random.default_rng(10)
    around = sets.unit(np.array([[0.0], [0.0], [-1.0]]) + 0.2 * rng.normal(size=(3, count)))
    lights = sets.lights(*sets.in_sphere(around), 1 / count, np.float32)
    x = sets.unit(np.array([[0.1], [0.2], [1.0]]))
    got = summed(sets.receivers(*sets.in_sphere(x), np.float32), lights)
    np.testing.assert_allclose(got, 1 / (4 * math.pi), rtol=ROUNDING[np.float32])
    assert GROUP < TILE


def test_no_lights_and_no_pixels():
    receivers, lights = sets.room(np.random.default_rng(11), 3)
    none = sets.PixelLights(*(part[:, :0] for part in lights[:3]), None, None, None, 0)
    assert not irradiance(receivers, none, PLAIN).any()
    assert not irradiance(receivers._replace(covered=np.zeros((1, 3), bool)), lights, PLAIN).any()


@pytest.mark.parametrize(("change", "message"), [
    ({"clamp": "soft"}, "clamp: expected"), ({"clamp": "distance"}, "clamp.value: expected"),
    ({"clamp": "geometry", "clamp_value": math.inf}, "clamp.value"), ({"offset": math.nan}, "offset"),
    ({"clamp_value": 1e19, "clamp": "sphere"}, "clamp.value"),
    ({"widening": -1.0}, "widening"), ({"lobe_norm": "x"}, "lobe.norm"), ({"as_published": {"no_pi"}}, "as_published"),
])


def test_settings_are_checked(change, message):
    with pytest.raises(InputError, match=message):
        of(PairSettings, **change)


def test_arrays_are_checked():
    receivers, lights = sets.room(np.random.default_rng(12), 4)
    with pytest.raises(InputError, match=r"lights\.flux: expected finite numbers"):
        irradiance(receivers, lights._replace(flux=lights.flux * np.nan), PLAIN)
    with pytest.raises(InputError, match=r"lights\.normal: expected shape"):
        irradiance(receivers, lights._replace(normal=lights.normal[:, :2]), PLAIN)
    with pytest.raises(InputError, match=r"receivers\.normal"):
        irradiance(receivers._replace(normal=receivers.normal[:2]), lights, PLAIN)
    for clamp in ("disc", "sphere"):
        with pytest.raises(InputError, match=f"footprint: .* 4 lights for the clamp '{clamp}'"):
            irradiance(receivers, lights, of(PairSettings, clamp=clamp))


def in_blocks(covered):
    """Blocks of 16 row by row; within one 8 x 8 after 8 x 8, within these 4 x 4 after 4 x 4, row by row."""
    height, width = covered.shape
    places = []
    for top in range(0, height, 16):
        for left in range(0, width, 16):
            for eight in range(4):
                for four in range(4):
                    for pixel in range(16):
                        y = top + 8 * (eight // 2) + 4 * (four // 2) + pixel // 4
                        x = left + 8 * (eight % 2) + 4 * (four % 2) + pixel % 4
                        if y < height and x < width and covered[y, x]:
                            places.append(y * width + x)
    return places


@pytest.mark.parametrize("shape", [(16, 16), (32, 48), (33, 47), (15, 64), (1, 1), (3, 40)])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.999, 1.0])
def test_pixels_go_block_by_block(shape, share):
    covered = np.random.default_rng(3).random(shape) < share
    assert block_by_block(covered).tolist() == in_blocks(covered)
    nth = np.flatnonzero(np.random.default_rng(4).random(int(covered.sum())) < 0.3)  # few of them, or none
    assert block_by_block(covered, nth).tolist() == [in_blocks(covered)[i] for i in nth]
