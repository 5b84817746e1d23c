"""Which lights are chosen: importance kinds on a corner in open ground, lights in the open, a steady pattern."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights import Warp, choose_pixel_lights, importance
from refgi.lights.selection import choose_lights, roulette, scale_flux
from refgi.lights.settings import LightSettings
from refgi.methods import find_method
from refgi.rays import Tracer, openness
from refgi.rsm import reflective_shadow_map
from refgi.scene import Material, PointLight, SpotLight, load_scene, material_table
from refgi.settings import of, replaced
from refgi.splat import PairSettings, Receivers, irradiance
from tests.rsm.shapes import geometry
from tests.wiring.cases import Case

ROUNDING = 1e-12
STANDARD_ERRORS = 4.0  # of a mean: one in 16,000 means of unbiased estimates is farther off
RADIUS = 2.0  # m, within which blockers count
NEAR = of(PairSettings, clamp="distance", clamp_value=0.2)  # keeps single pairs from deciding a comparison
MATERIALS = material_table((Material(diffuse=(0.5, 0.6, 0.4)),
                            Material(diffuse=(0.1, 0.1, 0.1), specular=(0.6, 0.6, 0.6), exponent=40.0)))  # fmt: skip
LIGHT = SpotLight((7.0, 7.0, 7.0), (-0.55, -0.9, -0.55), math.radians(30), math.radians(50), (100.0, 100.0, 100.0))


def corner():
    """Two walls 3 m high that meet on a ground of 30 x 30 m, and a glossy tile before them."""
    quads = [((-15, 0, -15), (0, 0, 30), (30, 0, 0), 0), ((0, 0, 0), (0, 3, 0), (0, 0, 3), 0),
             ((0, 0, 0), (3, 0, 0), (0, 3, 0), 0), ((0.7, 0.01, 0.7), (0, 0, 1.2), (1.2, 0, 0), 1)]  # fmt: skip
    vertices = [np.add(a, b) for a, u, v, _ in quads for b in ((0, 0, 0), u, np.add(u, v), v)]
    faces = [[4 * k + i for i in face] for k in range(4) for face in ((0, 1, 2), (0, 2, 3))]
    return geometry(vertices, faces, materials=[quad[3] for quad in quads for _ in range(2)])


@pytest.fixture(scope="module")
def scene():
    """The corner's map with its openness, receivers on its walls, and what all texels give them."""
    shape = corner()
    rsm = reflective_shadow_map(shape, MATERIALS, LIGHT, 128, np.float64)
    tracer = Tracer(shape)
    share = openness(tracer, rsm.position, rsm.normal, rsm.covered, radius=RADIUS)
    a, b = (side.reshape(-1) for side in np.meshgrid(np.linspace(0.1, 2.9, 10), np.linspace(0.15, 2.85, 10)))
    on_x, on_z = np.stack([0 * a, b, a]), np.stack([a, b, 0 * a])
    up = np.repeat(np.array([[1.0, 0, 0], [0, 0, 1.0]]).T, len(a), axis=1)
    receivers = Receivers(np.concatenate([on_x, on_z], axis=1)[:, None], up[:, None], np.ones((1, 200), bool))
    full = irradiance(receivers, choose_pixel_lights([rsm], count=None, pattern="all"), NEAR)
    return rsm, share, receivers, full


def errors(scene, worth, warp, count=128, sets=24):
    """Return the relative RMSE over shifted Halton sets, and the mean's distance in standard errors."""
    rsm, _, receivers, full = scene
    off = []
    for seed in range(1, sets + 1):
        lights = choose_pixel_lights([rsm], count=count, pattern="halton", seed=seed, warp=warp,
                                     importance=None if warp is None else [worth])
        off.append(irradiance(receivers, lights, NEAR) - full)
    mean = np.mean(off, axis=(1, 2, 3))
    return math.sqrt(np.mean(np.square(off)) / np.mean(full**2)), mean.mean() / (mean.std(ddof=1) / math.sqrt(sets))


@pytest.mark.feature("SII-14")
def test_each_kind_of_importance_lowers_the_error_on_a_corner_in_open_ground(scene, evidence):
    rsm, share, _, _ = scene
    found = {"uniform": errors(scene, None, None)}
    for kind in ("flux", "peak", "openness"):
        worth = importance(rsm, kind, share if kind == "openness" else None)
        found[kind] = errors(scene, worth, Warp("A", 5))
    assert found["uniform"][0] > found["flux"][0] > found["peak"][0] > found["openness"][0]
    assert max(abs(z) for _, z in found.values()) < STANDARD_ERRORS
    evidence("RMSE at 128 lights: " + ", ".join(f"{kind} {rmse:.1%}" for kind, (rmse, _) in found.items()))


def reached(receivers, lights, i_low):
    """Count pairs of diffuse light and receiver with Phi/pi cos / r^2 >= I_low, the light's share of Sec. 3.4."""
    count = 0
    x = receivers.position.reshape(3, -1)
    for k in range(lights.flux.shape[1]):
        d = x - lights.position[:, k, None]
        r2 = (d * d).sum(axis=0)
        cosine = (lights.normal[:, k, None] * d).sum(axis=0) / np.sqrt(r2)
        count += int((lights.flux[:, k].max() / math.pi * np.maximum(cosine, 0) >= i_low * r2).sum())
    return count


def ground_and_walls(n):
    """Receivers all over the scene, as a picture of it would have them."""
    side = (np.arange(n) + 0.5) / n
    a, b = (axis.reshape(-1) for axis in np.meshgrid(side * 12, side * 12))
    ground = np.stack([a, 0 * a, b]), np.repeat([[0.0], [1.0], [0.0]], n * n, axis=1)
    wall = np.stack([0 * a, b / 4, a / 4]), np.repeat([[1.0], [0.0], [0.0]], n * n, axis=1)
    position, normal = (np.concatenate(parts, axis=1) for parts in zip(ground, wall, strict=True))
    return Receivers(position[:, None], normal[:, None], np.ones((1, 2 * n * n), bool))


@pytest.fixture(scope="module")
def chosen(scene):
    """256 lights of an unwarped pattern, as in Table 3, each with a broad lobe too, and their openness."""
    rsm, share, _, _ = scene
    lights = choose_pixel_lights([rsm], count=256, pattern="grid")
    lights = lights._replace(lobe_flux=0.2 * lights.flux, lobe_axis=lights.normal,
                             lobe_exponent=np.full_like(lights.lobe_exponent, 3.0))
    return lights, share.reshape(-1)[lights.texel]


@pytest.mark.feature("SII-16")
def test_scaling_by_openness_saves_pairs_and_says_what_it_loses(chosen, evidence):
    lights, share = chosen
    scaled, lost = scale_flux(lights, share)
    expected = np.zeros(3)
    for k in range(len(share)):
        expected += (lights.flux[:, k] + lights.lobe_flux[:, k]) * share[k]
        np.testing.assert_allclose(scaled.flux[:, k], lights.flux[:, k] * (1 - share[k]), rtol=ROUNDING)
        np.testing.assert_allclose(scaled.lobe_flux[:, k], lights.lobe_flux[:, k] * (1 - share[k]), rtol=ROUNDING)
    np.testing.assert_allclose(lost, expected, rtol=ROUNDING)
    np.testing.assert_array_equal(scaled.position, lights.position)
    receivers = ground_and_walls(24)
    i_low = 0.05 * lights.flux.max() / math.pi  # 5 % of the brightest light at 1 m
    before, after = (reached(receivers, some, i_low) for some in (lights, scaled))
    assert after < before
    total = (lights.flux + lights.lobe_flux).sum(axis=1)
    evidence(f"corner, 256 lights: {lost[1] / total[1]:.0%} of the flux lost; pairs within 5 % x {before / after:.1f} "
             "fewer")


@pytest.mark.feature("SII-16")
def test_as_printed_flux_is_scaled_by_openness(chosen):
    """Oracle: Phi O, with O the share of free directions."""
    lights, share = chosen
    scaled, lost = scale_flux(lights, share, as_printed=True)
    np.testing.assert_allclose(scaled.flux, lights.flux * share, rtol=ROUNDING)
    np.testing.assert_allclose(scaled.lobe_flux, lights.lobe_flux * share, rtol=ROUNDING)
    np.testing.assert_allclose(lost, ((lights.flux + lights.lobe_flux) * (1 - share)).sum(axis=1), rtol=ROUNDING)


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # reported: tests/pairs/test_loss
def test_printed_forms_of_openness_and_importance_are_settings():
    """Oracle: lights by hand, from the maps, the openness of their texels and the printed Phi P and Phi O."""
    frame = Case({}).seen()
    options = {"count": 40, "pattern": "halton", "openness.radius": 1.0}
    warped = of(LightSettings, **options, **{"source.warp": "A", "source.warp.importance": "peak"})
    printed = replaced(warped, {"source.as_published": {"sii_peak"}})
    by_hand = [(rsm.flux + rsm.lobe_exponent * rsm.lobe_flux).max(axis=0) for rsm in frame.rsms]
    expected = choose_pixel_lights(frame.rsms, count=40, pattern="halton", warp=Warp("A", 3), importance=by_hand)
    assert same_lights(choose_lights(frame, printed), expected)
    assert not same_lights(choose_lights(frame, warped), expected)

    plain, scaled = of(LightSettings, **options), of(LightSettings, **options, **{"openness.flux": "scale"})
    lights = choose_lights(frame, plain)
    free = 1 - powers(choose_lights(frame, scaled)) / powers(lights)
    got = choose_lights(frame, replaced(scaled, {"openness.as_published": {"sii_openness"}}))
    assert 0.1 < free.mean() < 0.9
    np.testing.assert_allclose(powers(got), powers(lights) * free, rtol=ROUNDING, atol=ROUNDING * powers(lights).max())


def same_lights(one, other):
    return np.array_equal(one.position, other.position) and np.array_equal(one.flux, other.flux)


def powers(lights):
    """Return the flux of each light, diffuse and lobe together, of all channels."""
    return (lights.flux + lights.lobe_flux).sum(axis=0)


@pytest.mark.parametrize(("key", "change"), [
    ("source.as_published", {"source.as_published": {"sii_peak"}}),
    ("source.as_published", {"source.as_published": {"sii_peak"}, "source.warp": "A"}),
    ("openness.as_published", {"openness.as_published": {"sii_openness"}}),
    ("openness.as_published", {"openness.as_published": {"sii_openness"}, "openness.flux": "roulette"})])
def test_printed_forms_without_what_they_change_are_refused(key, change):
    with pytest.raises(InputError, match=key):
        of(LightSettings, **change)


@pytest.mark.feature("SII-16")
def test_roulette_saves_lights_and_loses_nothing_in_the_mean(scene, chosen, evidence):
    lights, share = chosen
    _, _, receivers, _ = scene
    wanted = irradiance(receivers, lights, NEAR)
    powers, sums, counts, off = [], [], [], []
    for seed in range(200):
        survivors = roulette(lights, share, 0.1, seed)
        powers.append((survivors.flux + survivors.lobe_flux).sum(axis=1))
        counts.append(survivors.flux.shape[1])
        if seed < 60:
            sums.append(irradiance(receivers, survivors, NEAR).mean(axis=(1, 2)))
            off.append(((irradiance(receivers, survivors, NEAR) - wanted) ** 2).mean())
    for got, exact in ((powers, (lights.flux + lights.lobe_flux).sum(axis=1)), (sums, wanted.mean(axis=(1, 2)))):
        z = (np.mean(got, axis=0) - exact) / (np.std(got, axis=0, ddof=1) / math.sqrt(len(got)))
        assert np.abs(z).max() < STANDARD_ERRORS
    assert np.mean(counts) == pytest.approx(np.maximum(0.1, 1 - share).sum(), rel=0.1)
    off.append(((irradiance(receivers, scale_flux(lights, share)[0], NEAR) - wanted) ** 2).mean())
    by_chance, scaled = math.sqrt(np.mean(off[:-1])) / wanted.mean(), math.sqrt(off[-1]) / wanted.mean()
    evidence(f"floor 0.1: {np.mean(counts):.0f} of {len(share)} lights stay, mean of flux and of E kept; RMSE against "
             f"all of them {by_chance:.0%}, scaled instead {scaled:.0%}")


@pytest.mark.feature("SII-16")
def test_survivors_are_some_of_the_lights_with_their_flux_over_their_chance(chosen):
    lights, share = chosen
    survivors = roulette(lights, share, 0.1, 7)
    place = {int(texel): k for k, texel in enumerate(lights.texel)}
    kept = [place[int(texel)] for texel in survivors.texel]
    assert kept == sorted(kept)
    chance = np.maximum(0.1, 1 - share)[kept]
    np.testing.assert_allclose(survivors.flux, lights.flux[:, kept] / chance, rtol=ROUNDING)
    np.testing.assert_allclose(survivors.lobe_flux, lights.lobe_flux[:, kept] / chance, rtol=ROUNDING)
    for name in ("position", "normal", "lobe_axis", "lobe_exponent", "map_index"):
        np.testing.assert_array_equal(getattr(survivors, name), getattr(lights, name)[..., kept])
    assert survivors.drawn == lights.drawn
    everyone = roulette(lights, np.zeros_like(share), 0.1, 7)
    np.testing.assert_array_equal(everyone.flux, lights.flux)


def test_lights_without_lobes_are_scaled_and_removed_too(chosen):
    lights, share = chosen
    plain = lights._replace(lobe_flux=None, lobe_axis=None, lobe_exponent=None)
    scaled, lost = scale_flux(plain, share)
    np.testing.assert_allclose(lost, (plain.flux * share).sum(axis=1), rtol=ROUNDING)
    assert scaled.lobe_flux is None
    assert roulette(plain, share, 0.1, 7).lobe_flux is None
    single = plain._replace(flux=plain.flux.astype(np.float32))
    assert scale_flux(single, share)[0].flux.dtype == roulette(single, share, 0.1, 7).flux.dtype == np.float32


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda lights, _: scale_flux(lights, np.ones(3)), "openness: expected shape .* one for each light"),
        (lambda lights, share: scale_flux(lights, share + 1), "openness: expected numbers from 0 to 1"),
        (lambda lights, share: roulette(lights, share, 0.0, 1), "floor: expected above 0, up to 1, got 0.0"),
        (lambda lights, share: roulette(lights, share, 0.1, -1), "seed: expected a whole number >= 0, got -1"),
        (lambda lights, share: roulette(lights, share * np.nan, 0.1, 1), "openness: expected numbers from 0 to 1"),
    ],
)
def test_errors_name_what_is_wrong(chosen, call, message):
    with pytest.raises(InputError, match=message):
        call(*chosen)


@pytest.mark.feature("SII-28")
def test_a_fixed_pattern_is_steadier_under_a_moving_light_than_fresh_ones(evidence):
    """The light of the box glides by 1 mm a frame; energy of the difference of E between frames over that of E."""
    box = load_scene("cornell_box")
    materials, light = material_table(box.materials), box.lights[0]
    low, high = box.geometry.bounds
    rng = np.random.default_rng(2)
    floor = low + (high - low) * np.stack([rng.random(300), np.full(300, 0.001), rng.random(300)], axis=1)
    receivers = Receivers(floor.T[:, None], np.repeat([[0.0], [1.0], [0.0]], 300, axis=1)[:, None],
                          np.ones((1, 300), bool))  # fmt: skip
    maps = [reflective_shadow_map(box.geometry, materials, moved(light, step * 1e-3), 128, np.float64)
            for step in range(10)]
    cases = {"all texels": {"count": None, "pattern": "all"},
             "fixed": {"count": 256, "pattern": "halton", "seed": 1},
             "fixed, warp": {"count": 256, "pattern": "halton", "seed": 1, "warp": Warp("A", 3)},
             "fixed, filtered": {"count": 256, "pattern": "halton", "seed": 1, "filtered": True},
             "fresh": {"count": 256, "pattern": "random"}}  # fmt: skip
    energy = {}
    for name, options in cases.items():
        pictures = np.array([irradiance(receivers, choose_pixel_lights(
            [rsm], **options, **({"seed": step} if name == "fresh" else {})), NEAR) for step, rsm in enumerate(maps)])
        energy[name] = (np.diff(pictures, axis=0) ** 2).mean() / (pictures**2).mean()
    assert energy["all texels"] < energy["fixed"] < 0.1 * energy["fresh"]
    assert energy["fixed, warp"] < 0.1 * energy["fresh"]
    evidence("frame-difference energy: " + ", ".join(f"{name} {value:.1e}" for name, value in energy.items()))


def moved(light, step):
    x, y, z = light.position
    return SpotLight((x + step, y, z), light.direction, light.inner_half_angle, light.outer_half_angle, light.intensity)


SAG = 1e-3  # twice by how much less than 1 m the middles of the ball's faces are away from its centre
FACETS = 2 * SAG  # of irradiance, which goes by the square of the radius
QUADRATURE = 5e-6  # of a spot's falloff over texels of a map that does not look along its axis


@pytest.mark.feature("SII-02")
@pytest.mark.parametrize("shape", ["auto", "cube", "paraboloid"])
def test_a_ball_is_lit_alike_by_maps_of_any_shape(shape, evidence):
    """Closed form: all power of the lamps arrives, and a sphere's wall gets rho times it over 4 pi everywhere."""
    spot = SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), math.radians(30), math.radians(60), (3, 2, 1), "ramp")
    point = PointLight((-0.2, 0.1, 0.3), (1.0, 2.0, 3.0))
    inner, outer = math.cos(spot.inner_half_angle), math.cos(spot.outer_half_angle)
    arriving = (2 * math.pi * (1 - (inner + outer) / 2) * np.array(spot.intensity)
                + 4 * math.pi * np.array(point.intensity))
    ball = load_scene("integrating_sphere").with_lights(spot, point)
    sent = np.array(ball.materials[0].diffuse) * arriving
    frame = Frame(ball, width=12, height=8, rsm_resolution=24, dtype=np.float64)
    every, some = {"source.projection": shape, "source.pattern": "all"}, {"source.projection": shape, "count": 1024}
    lights = choose_lights(frame, of(LightSettings, **every))
    assert lights.texel.max() >= 24 * 24 * (1 if shape == "paraboloid" else 2)  # of two maps at least
    assert np.abs(np.linalg.norm(lights.position, axis=0) - 1).max() < SAG
    assert np.abs(lights.flux.sum(axis=1) / sent - 1).max() < QUADRATURE
    drawn = np.abs(choose_lights(frame, of(LightSettings, **some)).flux.sum(axis=1) / sent - 1).max()
    random = deviation(lights, [rsm.texels for rsm in frame.rsms_as(shape)], some["count"])
    assert drawn < random  # Halton points are more even
    errors = {}
    for name, more in (("sii", {}), ("multires", {"subsplats": "geometry"}), ("val", {"visibility": None}),
                       ("vpl", {"visibility": False})):
        method, clamp = find_method(name), {} if name == "vpl" else {"pairs.clamp": None}
        settings = of(method.settings, **{f"lights.{key}": value for key, value in every.items()}, **more, **clamp)
        light = method.function(frame, settings)
        errors[name] = np.abs(light / (sent / (4 * math.pi))[:, None, None] - 1).max()
    assert max(errors.values()) < FACETS
    evidence(f"{shape}: irradiance within {max(errors.values()):.0e} of the sphere's, flux of 1024 lights "
             f"within {drawn:.1%}, of random ones {random:.1%}")


def deviation(lights, texels, count):
    """Return the standard deviation of the sum of N random lights' flux, shared out by it, as a share of all of it."""
    flux = [lights.flux[:, lights.map_index == lamp].sum(axis=0) for lamp in range(len(texels))]
    total = sum(one.sum() for one in flux)
    variance = sum((size * (one**2).sum() - one.sum() ** 2) / (count * one.sum() / total)
                   for one, size in zip(flux, texels, strict=True))
    return math.sqrt(variance) / total
