"""The energy ledger: its lines sum to the whole, each is what a twin or a closed form says, and nothing pays for it."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.ledger import light_terms, pixel_areas
from refgi.lights.selection import choose_lights
from refgi.rsm import texel_shares
from refgi.rsm.raster.projection import CUBE_FORWARD, CUBE_UP
from refgi.scene import Camera, DirectionalLight, Geometry, Material, PointLight, Scene, SpotLight, load_scene
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii
from refgi.splat.sii.approximations import sii_ledger
from refgi.stages import observe
from tests.form_factors import polygon_form_factor
from tests.naive import ledger as naive
from tests.naive.radiometry import lobe_fraction
from tests.textured import room

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

WHOLE = 1e-5  # of emitted: what a float32 account may be off by (REF-04)
FACETS = 4e-4  # of the lights' flux: 20,000 facets have 3.6e-4 less area than their sphere
RIM = 2e-4  # of a plate some 150 pixels wide: those on its rim count wholly or not
GRAZING = 3e-3  # of what slanting lobes send: part of it runs along the light's own facet, 1.8e-3 of 80,000 facets
TWIN = 1e-12  # of emitted: float64 sums in another order
UNCUT = of(SiiSettings, lights=64, clamp="none")

CASES = [
    ("cornell_box", {}),
    ("cornell_box", {"cut_irradiance": 0.3, "stochastic": True}),
    ("cornell_box", {"cut_irradiance": 0.05, "bound": "mesh", "bound_faces": 8, "bound_inflate": False}),
    ("cornell_box", {"clamp": "disc", "cut_share": 0.5}),
    ("cornell_box", {"clamp": "sphere"}),
    ("cornell_box", {"clamp": "geometry", "clamp_value": 30.0, "offset": 0.01}),
    ("cornell_box", {"clamp": "distance", "clamp_value": 0.05, "half_resolution": True}),
    ("cornell_box", {"source": "walk", "bounces": 3}),
    ("cornell_box", {"warp": "A", "importance": "openness", "openness_flux": "scale"}),
    ("cornell_box", {"warp": "B", "openness_flux": "roulette"}),
    ("cornell_box", {"as_published": {"sii_no_pi", "sii_no_tn", "per_light_ilow"}}),
    ("ring", {"lobe_norm": "full_lobe", "cut_share": 0.5}),
    ("ring", {"lobe_norm": "none", "widening": 0.5, "as_published": {"sii_widening"}, "clamp": "distance",
              "clamp_value": 0.05}),
    ("ring", {"stochastic": True, "cut_share": 0.5, "clamp": "disc"}),
    ("glass_ball", {"refraction": "back_face"}),
    ("glass_ball", {"refraction": "none", "pattern": "grid", "lights": 64, "filtered": True}),
]


def balance(ledger):
    return float(np.abs(ledger.difference).max() / ledger.emitted.max())


@pytest.fixture(scope="module")
def frames():
    kept = {}
    return lambda name: kept.setdefault(name, Frame(load_scene(name), width=40, height=32, rsm_resolution=96))


@pytest.mark.feature("REF-04")
def test_lines_sum_to_what_is_emitted(frames, evidence):
    worst = 0.0
    for name, settings in CASES:
        ledger = sii_ledger(frames(name), of(SiiSettings, **{"lights": 200} | settings))
        assert balance(ledger) < WHOLE, (name, settings)
        assert all(row.watts.shape == (3,) and row.watts.dtype == np.float64 for row in ledger.rows)
        worst = max(worst, balance(ledger))
    evidence(f"{len(CASES)} settings of sii, float32: emitted - sum of lines is at most {worst:.0e} of emitted")


@pytest.mark.feature("REF-04")
def test_what_a_setting_does_is_on_its_line(frames):
    """Property: each way to change energy moves its own line, with its sign, and leaves the others at 0."""
    signed = ("sampling", "bounced", "scaled", "printed", "interpolated", "cut", "clamped")

    def lines(name, **settings):
        ledger = sii_ledger(frames(name), of(SiiSettings, **{"lights": 200, "clamp": "none"} | settings))
        return {line: float(getattr(ledger, line)[1] / ledger.emitted[1]) for line in signed if line != "sampling"}

    still = dict.fromkeys(signed[1:], 0.0)
    assert lines("cornell_box") == still
    for line, sign, settings in (
        ("cut", 1, {"cut_irradiance": 0.1}), ("clamped", 1, {"clamp": "distance", "clamp_value": 0.1}),
        ("scaled", 1, {"openness_flux": "scale"}), ("bounced", -1, {"source": "walk", "bounces": 2}),
        ("printed", -1, {"as_published": {"sii_no_pi"}}),
    ):
        found = lines("cornell_box", **settings)
        assert sign * found.pop(line) > 1e-3
        assert not any(found.values()), settings
    assert lines("cornell_box", half_resolution=True)["interpolated"] != 0


def pixels_of(frame):
    """Area, position and shading normal of every covered pixel, the area by the twin."""
    scene, buffer = frame.scene, frame.gbuffer
    for i, j in zip(*np.nonzero(buffer.covered), strict=True):
        x = buffer.position[:, i, j]
        triangle = scene.geometry.vertices[scene.geometry.faces[buffer.triangle_id[i, j]]]
        yield (naive.area(scene.camera, frame.width, frame.height, i, j, x, triangle), x, buffer.normal[:, i, j])


@pytest.mark.parametrize(("name", "threshold"), [("cornell_box", 0.02), ("ring", 0.05)])
@pytest.mark.feature("REF-04")
def test_each_line_is_that_of_the_twin(name, threshold, evidence):
    """Oracle: kept, cut, clamped and behind from loops over pixels and lights, and together the full sum."""
    frame = Frame(load_scene(name), width=11, height=8, rsm_resolution=64, dtype=np.float64)
    settings = of(SiiSettings, lights=24, cut_irradiance=threshold, clamp="distance", clamp_value=0.05)
    ledger = sii_ledger(frame, settings)
    expected = naive.screen(list(pixels_of(frame)), choose_lights(frame, settings.lights), threshold, 0.05)
    error = {line: float(np.abs(getattr(ledger, line) - value).max() / ledger.emitted.max())
             for line, value in expected.items()}
    assert all(value.any() for value in expected.values())
    assert max(error.values()) < TWIN
    front = expected["arrived"] + expected["cut"] + expected["clamped"]
    assert ledger.off_screen == pytest.approx(ledger.lights - front - expected["behind"], rel=1e-7)
    evidence(f"{name}: " + ", ".join(f"{line} {value[1] / ledger.emitted[1]:.2%} (twin: {error[line]:.0e})"
                                     for line, value in expected.items()))


def around(scene, eye, size, **options):
    """Six frames that together see every direction from a point once."""
    for forward, up in zip(CUBE_FORWARD, CUBE_UP, strict=True):
        seen = scene.with_camera(eye=eye, target=tuple(np.add(eye, forward)), up=tuple(map(float, up)),
                                 vfov=math.pi / 2)
        yield Frame(seen, width=size, height=size, **options)


@pytest.mark.feature("REF-04")
def test_off_screen_is_what_the_other_five_views_receive(evidence):
    """Analytic: in a closed convex room without blockers each light arrives exactly once."""
    views = [sii_ledger(frame, UNCUT)
             for frame in around(load_scene("integrating_sphere"), (0.1, -0.1, 0.2), 48, rsm_resolution=64)]
    arrived = np.sum([view.arrived for view in views], axis=0)
    whole = float(np.abs(arrived / views[0].lights - 1).max())
    assert whole < FACETS
    worst = max(float(np.abs(arrived - view.arrived - view.off_screen - view.behind).max()) for view in views)
    assert worst / views[0].lights[0] < FACETS
    evidence(f"six views of a closed sphere: sum arrived / sum Phi_i - 1 = {whole:.1e}; off screen of one view is what "
             f"the other five receive to {worst / views[0].lights[0]:.1e} of sum Phi_i")


@pytest.mark.feature("REF-04")
def test_lobes_below_the_horizon_are_behind(evidence):
    """Analytic: K of a lobe goes up, 1 - K into the surface; what goes up arrives in six views of a closed sphere."""
    slanting = SpotLight((0.0, -0.85, 0.0), (1.0, 0.0, 0.0), 0.3, 0.4, (2.0, 2.0, 2.0))  # some 60 degrees off normal
    glossy = dataclasses.replace(load_scene("integrating_sphere:faces=80000"), lights=(slanting,),
                                 materials=(Material("gloss", (0.1,) * 3, (0.5,) * 3, 3.0),))
    found, stray = [], None
    for norm in ("clamped", "full_lobe", "none"):
        settings = replaced(UNCUT, {"lobe_norm": norm})
        frames = list(around(glossy, (0.1, -0.1, 0.2), 64, rsm_resolution=64))
        views = [sii_ledger(frame, settings) for frame in frames]
        lights = choose_lights(frames[0], settings.lights)
        tilt = np.arccos(np.clip((lights.normal * lights.lobe_axis).sum(axis=0), -1, 1).astype(float))
        above = np.array([lobe_fraction(t, 3.0) for t in tilt])
        whole = 2 * math.pi / 4 if norm == "none" else 1.0
        up = lights.flux[0].sum() + lights.lobe_flux[0] @ (whole * above if norm != "clamped" else np.ones_like(above))
        below = 0.0 if norm == "clamped" else whole * float(lights.lobe_flux[0] @ (1 - above))
        received = sum(view.arrived[0] for view in views)
        assert received == pytest.approx(up, rel=GRAZING)
        assert max(map(balance, views)) < WHOLE
        stray = stray or [view.behind[0] for view in views]  # lights near a facet that lie behind its plane
        least = int(np.argmin(stray))
        assert views[least].behind[0] == pytest.approx(below, abs=2 * stray[least] + 1e-7)
        assert views[0].printed[0] == pytest.approx((1 - whole) * lights.lobe_flux[0].sum(), rel=1e-5, abs=1e-12)
        found.append(f"{norm} {below / views[0].lights[0]:.2%} below, arrived / sent - 1 = {received / up - 1:+.1e}")
    evidence("P = 3: " + "; ".join(found))


def plates(below):
    """A lit floor and a plate over it, seen from between them or from above."""
    floor, plate = 3.0, 0.5
    corners = np.array([(-floor, 0, floor), (floor, 0, floor), (floor, 0, -floor), (-floor, 0, -floor),
                        (-plate, 1, -plate), (plate, 1, -plate), (plate, 1, plate), (-plate, 1, plate)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)], np.int32)
    geometry = Geometry(corners, faces, np.zeros(4, np.int32))
    height = 0.2 if below else 1.8
    camera = Camera((0.1, height, 0.05), (0.0, 1.0, 0.0), up=(0.0, 0.0, 1.0), vfov=math.radians(84))
    light = SpotLight((0.0, 0.95, 0.0), (0.0, -1.0, 0.0), 0.6, 0.7, (3.0, 2.0, 1.0))
    return Scene("plates", geometry, (Material("grey", (0.5,) * 3),), camera, (light,)), corners[4:]


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.feature("REF-04")
def test_flux_that_meets_a_plate_has_its_form_factor(below, evidence):
    """Analytic: a light under a plate sends it Phi F; seen from above the plate is met from behind."""
    scene, plate = plates(below)
    frame = Frame(scene, width=256, height=256, rsm_resolution=64)
    ledger, lights = sii_ledger(frame, UNCUT), choose_lights(frame, UNCUT.lights)
    factors = np.array([polygon_form_factor(p, n, plate) for p, n in zip(lights.position.T, lights.normal.T,
                                                                        strict=True)])
    met, missed = lights.flux @ factors, lights.flux @ (1 - factors)
    line = ledger.arrived if below else ledger.behind
    assert line == pytest.approx(met, rel=RIM)
    assert ledger.off_screen == pytest.approx(missed, rel=RIM)
    assert (ledger.behind if below else ledger.arrived) == pytest.approx(0, abs=1e-6)
    evidence(f"{'arrived' if below else 'behind'} / sum Phi F - 1 = {line[0] / met[0] - 1:+.1e}, "
             f"off screen / sum Phi (1 - F) - 1 = {ledger.off_screen[0] / missed[0] - 1:+.1e}")


@pytest.mark.feature("REF-04")
def test_cut_follows_the_law_of_the_range(evidence):
    """Analytic (E-SII-15): of one light facing a plate at distance D a share (D / R0)^(4/3) is out of range."""
    scene, plate = plates(below=True)
    frame = Frame(scene, width=256, height=256, rsm_resolution=64)
    one = replaced(UNCUT, {"lights": 1, "pattern": "grid"})
    light = choose_lights(frame, one.lights)
    factor = polygon_form_factor(light.position[:, 0], light.normal[:, 0], plate)
    found = []
    for reach in (1.05, 1.1):  # R0 in plate distances: the lit disc lies inside the plate
        threshold = float(light.flux[0, 0]) / math.pi / reach**2
        ledger = sii_ledger(frame, replaced(one, {"cut_irradiance": threshold}))
        kept = 1 - reach ** (-4 / 3)
        cut = ledger.cut[0] / ledger.lights[0]
        assert cut == pytest.approx(factor - kept, abs=RIM)
        found.append(f"R0 / D = {reach}: kept {1 - cut - (1 - factor):.4f} (law {kept:.4f})")
    evidence("; ".join(found))


@pytest.mark.feature("REF-12")
@pytest.mark.feature("REF-04")
def test_the_random_range_cuts_nothing_in_the_mean(frames, evidence):
    """Statistical: the signed cut over 64 seeds is 0 within four of its standard errors, the plain cut is not."""
    settings = of(SiiSettings, lights=64, cut_irradiance=0.05)
    plain = sii_ledger(frames("cornell_box"), settings)
    lights = []
    for seed in range(64):
        some = replaced(settings, {"stochastic": True, "seed": seed, "pattern": "grid"})
        lights.append(sii_ledger(frames("cornell_box"), some).cut[1])
    mean, error = np.mean(lights), np.std(lights) / 8
    assert abs(mean) < 4 * error
    assert plain.cut[1] > 20 * error
    evidence(f"cut {plain.cut[1] / plain.emitted[1]:.2%} of emitted; with the random range "
             f"{mean / plain.emitted[1]:+.3%} +- {error / plain.emitted[1]:.3%}")


@pytest.mark.feature("REF-04")
def test_emitted_and_missed_in_closed_form(evidence):
    """Analytic: a point over a square floor, whose solid angle is exact; parallel light on a tilted map; a spot."""
    scene, _ = plates(below=True)
    floor = Geometry(scene.geometry.vertices, scene.geometry.faces[:2], np.zeros(2, np.int32))
    scene = dataclasses.replace(scene, geometry=floor)
    lights = (PointLight((0.0, 1.5, 0.0), (1.0, 2.0, 3.0)), DirectionalLight((0.3, -1.0, 0.2), (1.0, 0.5, 0.0)))
    at = [sii_ledger(Frame(scene.with_lights(light), width=8, height=8, rsm_resolution=256), UNCUT)
          for light in lights]
    share = 4 * math.asin(1 / (1 + (1.5 / 3.0) ** 2)) / (4 * math.pi)  # of a square from above its middle
    assert at[0].emitted == pytest.approx(4 * math.pi * np.array([1, 2, 3]), rel=1e-14)
    assert at[0].missed / at[0].emitted == pytest.approx(1 - share, rel=2e-3)  # 256 texels across a face
    slant = 1.0 / math.sqrt(0.3**2 + 1 + 0.2**2)
    for line in (at[1].absorbed, at[1].reflected):
        assert line == pytest.approx(0.5 * 36.0 * slant * np.array([1, 0.5, 0]), rel=5e-3)
    both = sii_ledger(Frame(scene.with_lights(*lights), width=8, height=8, rsm_resolution=256), UNCUT)
    for line in ("emitted", "missed", "absorbed", "reflected"):
        assert getattr(both, line) == pytest.approx(getattr(at[0], line) + getattr(at[1], line), rel=1e-12)
    evidence(f"missed / emitted = {at[0].missed[0] / at[0].emitted[0]:.5f} (closed form {1 - share:.5f}); "
             "two lights: sum of each to 1e-12")


@pytest.mark.feature("REF-04")
def test_bounces_of_a_walk_are_a_geometric_series(evidence):
    """Analytic: in a closed sphere of albedo 1/2 three bounces send 1/2 + 1/4 + 1/8 of the light's power."""
    frame = Frame(load_scene("integrating_sphere"), width=8, height=8, rsm_resolution=32)
    ledger = sii_ledger(frame, of(SiiSettings, source="walk", bounces=3, lights=100))
    shares = [float(line[0] / ledger.emitted[0]) for line in (ledger.reflected, ledger.bounced, ledger.lights)]
    assert shares[0] == pytest.approx(0.5, rel=1e-6)
    assert -shares[1] / (shares[2] + shares[1]) == pytest.approx(0.75, rel=1e-9)
    evidence("reflected {:.4f}, bounced {:.4f}, lights {:.4f} of emitted".format(*shares))


@pytest.mark.feature("REF-04")
def test_areas_are_those_of_the_faces():
    """Analytic: pixels on the whole of a tilted plate have its area together, up to its rim."""
    scene, _ = plates(below=False)
    upper = Geometry(scene.geometry.vertices, scene.geometry.faces[2:], np.zeros(2, np.int32))
    for eye in ((0.1, 1.8, 0.05), (0.7, 2.1, 0.6)):
        seen = dataclasses.replace(scene.with_camera(eye=eye), geometry=upper)
        buffer = Frame(seen, width=256, height=256).gbuffer
        areas = pixel_areas(buffer, upper)
        assert areas.sum() == pytest.approx(1.0, rel=5e-3)
        assert not areas[~buffer.covered].any()


def test_a_dark_scene_and_a_view_of_nothing_balance():
    scene = load_scene("cornell_box")
    black = dataclasses.replace(scene, materials=tuple(Material("black", (0.0,) * 3) for _ in scene.materials))
    away = scene.with_camera(eye=(0.0, 0.0, 50.0), target=(0.0, 0.0, 60.0))
    for one in (black, away):
        ledger = sii_ledger(Frame(one, width=16, height=16, rsm_resolution=32), of(SiiSettings, lights=32))
        assert balance(ledger) < WHOLE
        assert not np.any([ledger.arrived, ledger.cut, ledger.behind])
    assert np.array_equal(ledger.off_screen, ledger.lights)


def test_who_does_not_ask_does_not_pay(frames):
    frame = frames("cornell_box")
    with observe() as log:
        sii(frame, of(SiiSettings, lights=32, cut_irradiance=0.1))
    assert not {"sii.ledger", "sii.cut_irradiance"} & {run.name for run in log.runs}


@pytest.mark.feature("REF-22")
@pytest.mark.parametrize("chosen", ["nearest", "trilinear"])
@pytest.mark.parametrize("settings", [{}, {"filtered": True, "pattern": "grid", "lights": 64}, {"source": "walk"}])
def test_lines_sum_to_the_whole_with_textures(chosen, settings, evidence):
    frame = Frame(room(chosen), rsm_resolution=96)
    ledger = sii_ledger(frame, of(SiiSettings, **settings))
    evidence(f"{chosen}: {balance(ledger):.1e} of the emitted power is missing")
    assert balance(ledger) <= WHOLE


@pytest.mark.feature("REF-04")
def test_a_textured_wall_absorbs_what_its_texels_leave():
    """In float64, texel by texel: shares of the light's power times 1 - albedo."""
    frame = Frame(room(), rsm_resolution=48, dtype=np.float64)
    terms, rsm = light_terms(frame.rsms[0], frame.scene.geometry, frame.materials), frame.rsms[0]
    power = np.array(frame.scene.lights[0].intensity)
    share = texel_shares(rsm.light, rsm.projection)
    seen = rsm.covered
    expected = [(share * (1 - rsm.albedo[c]))[seen].sum() * power[c] for c in range(3)]
    np.testing.assert_allclose(terms.absorbed, expected, rtol=1e-12)
    np.testing.assert_allclose(terms.absorbed + terms.reflected + terms.missed, terms.emitted, rtol=1e-6)
    assert rsm.albedo[0][seen].std() > 0.2


@pytest.mark.feature("REF-04")
@pytest.mark.parametrize("falloff", ["smoothstep", "squared_ramp", "ramp"])
def test_coloured_walls_and_every_falloff_leave_nothing_over(falloff):
    """What is emitted has a closed form, what is absorbed is the texels' own."""
    scene = load_scene("cornell_box").with_camera(width=8, height=8)
    corners = scene.geometry.vertices[scene.geometry.faces]
    colours = 0.5 + 0.5 * np.sin(9 * corners)
    light = dataclasses.replace(scene.lights[0], inner_half_angle=0.1, falloff=falloff)
    frame = Frame(dataclasses.replace(scene, lights=(light,), geometry=dataclasses.replace(
        scene.geometry, colours=colours)), rsm_resolution=48, dtype=np.float64)
    terms, rsm = light_terms(frame.rsms[0], frame.scene.geometry, frame.materials), frame.rsms[0]
    share, seen = texel_shares(rsm.light, rsm.projection), rsm.covered
    expected = [(share * (1 - rsm.albedo[c]))[seen].sum() * light.intensity[c] for c in range(3)]
    np.testing.assert_allclose(terms.absorbed, expected, rtol=1e-12)
    np.testing.assert_allclose(terms.absorbed + terms.reflected + terms.missed, terms.emitted, rtol=1e-6)


def test_glass_beside_a_texture_absorbs_nothing():
    scene = room()
    glass = dataclasses.replace(scene, materials=(Material("glass", (0.0, 0.0, 0.0), ior=1.5), scene.materials[1]))
    frame = Frame(glass, rsm_resolution=48, dtype=np.float64)
    terms = light_terms(frame.rsms[0], frame.scene.geometry, frame.materials)
    assert terms.glass.min() > 0.1
    np.testing.assert_allclose(terms.absorbed + terms.glass + terms.reflected + terms.missed, terms.emitted, rtol=1e-6)
