"""Every printed form of every method, and its factor: the picture under the switch against the default's (REF-20).

The lamps are three, of unlike kind and power and one colour each, so that a channel of a picture is one lamp's and no
lamp can have another's N, T, distance or peak. Where a factor is that of single lights there is one light a lamp.
Expected values come from section "Printed forms" of docs/radiometry, in closed form from the default's lights.
"""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.cluster.visibility.pcf import (
    cone_tangent,
    disc,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from refgi.lights.importance import importance
from refgi.lights.selection import choose_lights
from refgi.lights.shares import map_shares
from refgi.literal.multires_upsample import upsample
from refgi.methods import METHODS
from refgi.scene import Material
from refgi.settings import of, replaced
from refgi.splat import GatherSettings, MultiresSettings, SiiSettings, gather, multires, sii
from refgi.splat.multires import shared_subsplats
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil
from refgi.stages import observe
from tests import lamps
from tests.literal.whole import gather as literal_gather
from tests.naive.radiometry import lobe_fraction, solid_angle_of_rectangle
from tests.wiring.cases import needed

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

DOCS = Path(__file__).parents[1] / "docs"
LEAST = 1e-3  # below, errors are absolute: of black pixels
CLOSED_FORM = 1e-9  # float64 sums of some dozen terms; K by quadrature of the twin
ONE_EACH = {"lights": 3, "seed": 16}  # of few seeds with which each lamp's one light is lit
P, WIDENING = 12.0, 1.3
GLOSSY = Material("glossy", (0.0, 0.0, 0.0), (0.3, 0.4, 0.5), P)
SMALL_VAL = of(ValSettings, lights=48, clusters_count=4, maps_resolution=16)


def pair_of(method, frame, settings, switch):
    """Return the pictures with and without a switch, (3, h, w) each."""
    return method(frame, replaced(settings, {"as_published": {switch}})), method(frame, settings)


def ratio(printed, plain):
    """Return one picture over the other where the latter is lit; else 1."""
    return np.divide(printed, plain, out=np.ones_like(plain), where=plain > 0), plain > 0


def times(method, frame, settings, switch, factor):
    """Return the ratio of pictures and what it should be: a factor, or one a channel or a pixel."""
    found, lit = ratio(*pair_of(method, frame, settings, switch))
    assert lit.any(axis=(1, 2)).sum() > 1
    return found[lit], np.broadcast_to(np.asarray(factor), found.shape)[lit]


def one_each(frame, settings):
    """Return the light of each lamp in the order of channels, with vectors to the pixels (3, h, w) and distances."""
    lights = choose_lights(frame, settings.lights)
    assert lights.map_index.tolist() == [0, 1, 2]
    away = frame.gbuffer.position[:, None] - lights.position[:, :, None, None]
    return lights, away, np.linalg.norm(away, axis=0)


def joined(*parts):
    """Return found and expected values of several comparisons."""
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def no_pi():
    frame = lamps.corner()
    cases = ((sii, of(SiiSettings, lights=48)), (multires, of(MultiresSettings, lights=48)), (val, SMALL_VAL))
    return joined(*(times(method, frame, settings, "sii_no_pi", math.pi) for method, settings in cases))


def no_tn():
    """N/T of each lamp's own map, of 16^2, 6 x 16^2 and 16^2 texels; its N of the 48 by its flux."""
    frame = lamps.corner()
    drawn = np.array([share.drawn for share in map_shares(frame.rsms, 48, "halton")])
    factor = (drawn / (256, 1536, 256))[:, None, None]
    cases = ((sii, of(SiiSettings, lights=48)), (multires, of(MultiresSettings, lights=48, pattern="halton")),
             (val, SMALL_VAL))
    return joined(*(times(method, frame, settings, "sii_no_tn", factor) for method, settings in cases))


def equal_solid_angle():
    """The mean solid angle of the texels that a lamp shines into over that of its light's texel."""
    frame, settings = lamps.corner(), of(SiiSettings, clamp="none", **ONE_EACH)
    lights, _, _ = one_each(frame, settings)
    half = math.tan(lamps.RED.outer_half_angle)
    spot, face = solid_angles(16, half), solid_angles(16, 1.0)
    side = np.abs(np.linspace(-half, half, 17))
    nearest = np.minimum(side[1:], side[:-1])  # to the axis, of each texel
    inside = np.hypot(nearest[:, None], nearest) < half * (1 - 1e-12)
    factor = [spot[inside].mean() / spot.reshape(-1)[lights.texel[0]],
              face.mean() / face.reshape(-1)[lights.texel[1] % 256], 1.0]
    return times(sii, frame, settings, "equal_solid_angle", np.array(factor)[:, None, None])


def solid_angles(n, half):
    """Return the solid angles of a perspective map of n x n texels by quadrature of (1 + x^2 + y^2)^(-3/2)."""
    edge = np.linspace(-half, half, n + 1)
    return np.array([[solid_angle_of_rectangle(lambda x, y: (1 + x * x + y * y) ** -1.5, *edge[j : j + 2],
                                               *edge[i : i + 2], nodes=8) for j in range(n)] for i in range(n)])


def widened(switch):
    """c(P) cos^P'' over c(P') cos^P', P' = P min(1, r/a), P'' as printed; one lobe a lamp."""
    def found():
        frame = lamps.corner(material=GLOSSY)
        settings = of(SiiSettings, **ONE_EACH, lobe_widening=WIDENING)
        lights, away, r = one_each(frame, settings)
        cosine = np.einsum("ik,ikhw->khw", lights.lobe_axis, away) / r
        tilt = np.arccos(np.minimum(1, (lights.normal * lights.lobe_axis).sum(axis=0)))
        ours = P * np.minimum(1, r / WIDENING)
        printed = np.minimum(P, P / r / WIDENING) if switch == "sii_widening" else ours
        norm = np.array([[(P + 1) / (p + 1) * lobe_fraction(t, p) / lobe_fraction(t, P) for p in row.reshape(-1)]
                         for t, row in zip(tilt, ours, strict=True)]).reshape(r.shape)
        return times(sii, frame, settings, switch, norm * np.maximum(cosine, 1e-6) ** (printed - ours))
    return found


def per_light_ilow():
    """Each light reaches its own sqrt(cos alpha / x) L: the uncut picture where cos alpha / r^2 >= x / L^2."""
    share, length = 0.05, 0.2
    frame = lamps.corner()
    settings = of(SiiSettings, **ONE_EACH, cut_share=share, reference_length=length)
    lights, away, r = one_each(frame, settings)
    cosine = np.einsum("ik,ikhw->khw", lights.normal, away) / r
    own = cosine >= share / length**2 * r**2
    shared = cosine * lights.flux.max(axis=0)[:, None, None] >= share / length**2 * r**2 * lights.flux.max()
    uncut = sii(frame, replaced(settings, {"cut": "none"}))
    printed, plain = pair_of(sii, frame, settings, "per_light_ilow")
    return joined(((printed / uncut.max()).ravel(), (uncut * own / uncut.max()).ravel()),
                  ((plain / uncut.max()).ravel(), (uncut * shared / uncut.max()).ravel()))


def demo_disc():
    """cos cos / (r^2 + L^2 / 1.5 N), L the way from each light's own lamp, N its lights of the 8."""
    frame = lamps.corner(lamps.RED, lamps.GREEN)
    settings = of(MultiresSettings, lights=8, pattern="halton", clamp="disc", coarsest=4096)
    lights, normal, covered = choose_lights(frame, settings.lights), frame.gbuffer.normal, frame.gbuffer.covered
    drawn = [share.drawn for share in map_shares(frame.rsms, 8, "halton")]
    source = np.array([lamps.RED.position, lamps.GREEN.position])[lights.map_index].T
    expected = np.zeros((3, *covered.shape))
    for k in range(lights.flux.shape[1]):
        away = frame.gbuffer.position - lights.position[:, k, None, None]
        square, reach = (away**2).sum(axis=0), ((lights.position[:, k] - source[:, k]) ** 2).sum()
        emitted, received = np.tensordot(lights.normal[:, k], away, 1), -(normal * away).sum(axis=0)
        cosines = np.maximum(emitted, 0) * np.maximum(received, 0)
        form = cosines / square / (square + reach / (1.5 * drawn[lights.map_index[k]]))
        expected += lights.flux[:, k, None, None] / math.pi * form * covered
    printed, _ = pair_of(multires, frame, settings, "ams_disc")
    return (printed / expected.max()).ravel(), (expected / expected.max()).ravel()


def albedo_within_the_splat():
    """Albedo of the cell's own pixel (its middle one) over that of each pixel, without a filter."""
    frame = lamps.corner(extra=lamps.tiles(16), width=32, height=32)
    settings = of(MultiresSettings, lights=48, coarsest=8, finest=2, upsampling="nearest")
    albedo = frame.gbuffer.albedo
    factor = albedo[:, 2::4, 2::4].repeat(4, axis=1).repeat(4, axis=2) / np.where(albedo > 0, albedo, 1)
    whole = frame.gbuffer.covered.reshape(8, 4, 8, 4).all(axis=(1, 3)).repeat(4, axis=0).repeat(4, axis=1)
    found, lit = ratio(*pair_of(multires, frame, settings, "ams_rho_in_splat"))
    assert (factor[:, whole] != 1).any()
    return found[lit & whole], factor[lit & whole]


def filtered_again():
    """(1, 2, 1) x (1, 2, 1) / 16 over pixels that were all rendered, away from the background."""
    frame = lamps.corner()
    printed, plain = pair_of(multires, frame, of(MultiresSettings, lights=48, coarsest=4096), "ams_filter_all")
    rows = plain[:, :-2] + 2 * plain[:, 1:-1] + plain[:, 2:]
    blurred = (rows[..., :-2] + 2 * rows[..., 1:-1] + rows[..., 2:]) / 16
    inside = np.lib.stride_tricks.sliding_window_view(frame.gbuffer.covered, (3, 3)).all(axis=(2, 3))
    assert inside.sum() > 50
    return (printed[:, 1:-1, 1:-1][:, inside] / plain.max()).ravel(), (blurred[:, inside] / plain.max()).ravel()


def corners_always():
    """Upsampling by the literal text of the method's own subsplats, texels across a corner counted as all others."""
    frame, settings = lamps.corner(), of(MultiresSettings, lights=48, coarsest=4)
    with observe(record=True) as log:
        printed, plain = pair_of(multires, frame, settings, "ams_all_corners")
    assert np.abs(printed - plain).max() > LEAST * plain.max()
    values = next(run.output for run in log.runs if run.name == "multires.evaluate")
    listed, covered = shared_subsplats(frame.gbuffer, settings.subsplats), frame.gbuffer.covered
    columns = (part.astype(int) for part in (listed.level, listed.row, listed.column))
    expected = upsample(np.where(covered, 0, -1), *columns, values, listed.top, "tent", corner_rule=False)
    return printed[:, covered].ravel() / plain.max(), expected[:, covered].ravel() / plain.max()


def peak_of_a_lobe():
    """Importance of purely glossy texels: P over (P + 1) / 2."""
    found = []
    for rsm in lamps.corner(material=GLOSSY).rsms:
        printed, plain = (importance(rsm, "peak", as_printed=form) for form in (True, False))
        found.append(printed[plain > 0] / plain[plain > 0])
    found = np.concatenate(found)
    return found, np.full(found.shape, 2 * P / (P + 1))


def scaled_by_openness():
    """O and 1 - O of each lamp's one light share its flux: the two pictures add up to the one that is not scaled."""
    frame, plain = lamps.corner(), of(SiiSettings, **ONE_EACH)
    scale = replaced(plain, {"openness_flux": "scale", "openness_radius": 2.0})
    printed, scaled = pair_of(sii, frame, scale, "sii_openness")
    whole = sii(frame, plain)
    assert all(0.1 < part.sum() / whole.sum() < 0.9 for part in (printed, scaled))
    found, lit = ratio(printed, scaled)
    return found[lit], ((whole - scaled)[lit] / scaled[lit])


def square_of_xi():
    """Gather with the weight 3/2 xi_1^2 of the literal text, lamp by lamp."""
    frame = lamps.corner(lamps.RED, lamps.BLUE)
    settings = of(GatherSettings, samples=60, radius=0.4, interpolation="none")
    printed, _ = pair_of(gather, frame, settings, "rsm_weight_squared")
    squared = dataclasses.replace(settings.disc, as_published=frozenset({"rsm_weight_squared"}))
    expected, seen = np.zeros_like(printed), np.zeros(printed.shape, bool)
    for channel, rsm in zip((0, 2), frame.rsms, strict=True):
        seen[channel] = frame.gbuffer.covered & np.isfinite(rsm.project(frame.gbuffer.position)[0])
        expected[channel] = literal_gather.every_sum(frame.gbuffer, [rsm], squared)[channel]
    return printed[seen] / expected.max(), expected[seen] / expected.max()


def tangents_of_the_whole_view():
    """4 / ((1 - t_h^2) (1 - t_v^2)), t = tan(f / 2), of a picture wider than high."""
    t = math.tan(math.radians(25))
    frame = lamps.corner(camera=lamps.seen_under(50), width=24, height=16)
    settings = of(HssilSettings, radius=None, levels=2, samples=24, form_factor="point")
    return times(hssil, frame, settings, "hss_tan_f", 4 / ((1 - t * t) * (1 - (1.5 * t) ** 2)))


def disc_without_pi():
    settings = of(HssilSettings, radius=None, levels=2, samples=24)
    return times(hssil, lamps.corner(width=24, height=16), settings, "hss_disc_pi", 1 / math.pi)


def level_factor():
    """4^k of each level alone."""
    frame = lamps.corner(width=48, height=32)
    cases = [of(HssilSettings, radius=None, levels=3, samples=24, only_level=level) for level in range(3)]
    return joined(*(times(hssil, frame, settings, "hss_level_factor", 4.0**level)
                    for level, settings in enumerate(cases)))


CONES = [(0.3, 2.0, 0.5), (2.0, 2.0, 1.0), (0.1, 3.0, 2.9)]  # Delta, d, z


def angle_from_the_axis():
    """tan(arctan(q) / 2) over q / 2, q = Delta (d - z) / (d z): 45 in place of 53.1 degrees at q = 1."""
    widths = [delta * (d - z) / (d * z) for delta, d, z in CONES]
    return (np.array([published_tangent(*cone) / cone_tangent(*cone) for cone in CONES]),
            np.array([math.tan(math.atan(q) / 2) / (q / 2) for q in widths]))


def angle_over_pi():
    """(2 / pi) (1 + cos theta) of a narrow cone: 1.27 in the middle of the map, 0.637 at its rim."""
    thetas, tangent = np.linspace(0, math.pi / 2, 7), 1e-6
    at = [(math.sin(theta), 0.0, max(math.cos(theta), 0.0), 1.0, tangent) for theta in thetas]
    return (np.array([published_square(*place)[2] / disc(*place)[2] for place in at]),
            2 / math.pi * (1 + np.cos(thetas)))


def half_way_search():
    """Delta / 2d over the exact cone's Delta (d - z) / (2 d z): z / (d - z), too narrow for blockers before d/2."""
    return (np.array([solid_angle_tangent(delta, d) / cone_tangent(delta, d, z) for delta, d, z in CONES]),
            np.array([z / (d - z) for _, d, z in CONES]))


FACTORS = {
    "sii_no_pi": no_pi, "sii_no_tn": no_tn, "equal_solid_angle": equal_solid_angle,
    "sii_widening": widened("sii_widening"), "sii_widening_unnorm": widened("sii_widening_unnorm"),
    "per_light_ilow": per_light_ilow, "ams_disc": demo_disc, "ams_rho_in_splat": albedo_within_the_splat,
    "ams_filter_all": filtered_again, "ams_all_corners": corners_always, "sii_peak": peak_of_a_lobe,
    "sii_openness": scaled_by_openness, "rsm_weight_squared": square_of_xi, "hss_tan_f": tangents_of_the_whole_view,
    "hss_disc_pi": disc_without_pi, "hss_level_factor": level_factor, "val_alpha": angle_from_the_axis,
    "val_alpha_over_pi": angle_over_pi, "val_search_solid_angle": half_way_search,
}


def test_every_printed_form_of_every_method_is_here_and_in_the_documentation():
    switches = {word.partition(" = ")[2] for method in METHODS.values() for word in needed(method.settings)
                if ".as_published = " in word}
    assert set(FACTORS) == switches
    pages = "".join(page.read_text() for page in (DOCS / "methods").glob("*.md"))
    assert switches <= set(re.findall(r"^\| `(\w+)`", pages, re.MULTILINE))


@pytest.mark.feature("REF-20")
@pytest.mark.parametrize("switch", FACTORS)
def test_a_printed_form_has_its_factor(switch, evidence):
    found, expected = FACTORS[switch]()
    off = (np.abs(found - expected) / np.maximum(expected, LEAST)).max()
    least, most = expected.min(), expected.max()
    evidence(f"{switch}: {least:.4g}{f' to {most:.4g}' if most > least else ''}, {len(found)} values to {off:.0e}")
    assert off < CLOSED_FORM


@pytest.mark.feature("REF-20")
@pytest.mark.parametrize("switch", ["val_alpha", "val_alpha_over_pi", "val_search_solid_angle"])
def test_printed_filter_sizes_reach_the_picture(switch):
    """What is measured above on single cones; the twin of `val` has them in whole pictures."""
    printed, plain = pair_of(val, lamps.corner(), SMALL_VAL, switch)
    assert np.abs(printed - plain).max() > 1e-3 * plain.max()


@pytest.mark.feature("REF-20")
@pytest.mark.parametrize("norm", ["none", "full_lobe"])
def test_printed_norms_of_lobes_have_their_factor(norm, evidence):
    """Section 0: 2 pi K / (P + 1) of SII Eq. 3, and K of the lobe that is not clamped; each lamp's own K."""
    frame = lamps.corner(material=GLOSSY)
    settings = of(SiiSettings, **ONE_EACH)
    lights, _, _ = one_each(frame, settings)
    tilt = np.arccos(np.minimum(1, (lights.normal * lights.lobe_axis).sum(axis=0)))
    share = np.array([lobe_fraction(t, P) for t in tilt])
    factor = share * (2 * math.pi / (P + 1) if norm == "none" else 1)
    found, lit = ratio(sii(frame, replaced(settings, {"lobe_norm": norm})), sii(frame, settings))
    expected = np.broadcast_to(factor[:, None, None], found.shape)
    np.testing.assert_allclose(found[lit], expected[lit], rtol=CLOSED_FORM)
    assert np.ptp(share) > 1e-3
    evidence(f"lobe.norm={norm}: {', '.join(f'{f:.4f}' for f in factor)} of three lamps")
