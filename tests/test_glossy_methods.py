"""Lobes of glossy receivers by every method: by loops from the definition, on a room with two lobes and three lamps."""

import dataclasses
import math
import warnings

import numpy as np
import pytest

from refgi import stages
from refgi.cluster.reference import reference_visibility
from refgi.cluster.val import cluster_lights
from refgi.error_target.grid import top_level
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.literal.hssil_crown import every_texel
from refgi.literal.pairs import pair
from refgi.method import _WARNED
from refgi.methods import METHODS, render
from refgi.rays import Tracer
from refgi.rsm.buffers.leaving import glossy_points
from refgi.settings import from_text, of, replaced
from refgi.skips import without_skip
from refgi.splat.multires.multires import glossy_subsplats
from refgi.splat.sii import SiiSettings
from refgi.sssil import HssilSettings
from refgi.sssil.cameras import frame_through
from refgi.sssil.glossy import warped
from refgi.sssil.hssil import view_lobes
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.pattern import chosen_radius
from refgi.sssil.reprojection import SourceView, reproject
from refgi.sssil.temporal import Sequence
from tests.glossy import SIZE, defined, glossy_box
from tests.literal.whole import gather
from tests.literal.whole.multires import upsampled
from tests.naive import crown_points, per_light, receiver_lobes
from tests.naive.bitmask import one_slice
from tests.naive.bitmask import transfer as transfer_of
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.wiring.cases import SCENES, VIEW

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

FLOAT64 = 1e-10  # of the largest: another order, and lobes of exponent 40 on rounded unit vectors
SIGMAS = 4.0  # a chance of 6e-5 that a right mean fails
RAYS = 1e-5  # contributions of pairs with shadow rays are float32
OPTIONS = {"width": 17, "height": 13, "rsm_resolution": 16, "dtype": np.float64}


@pytest.fixture(params=["lamps", "smooth"], scope="module")
def frame(request):
    return Frame(SCENES[request.param](), **OPTIONS)


@pytest.fixture(scope="module")
def room():
    return Frame(SCENES["lamps"](), **OPTIONS)


def close(got, expected, rtol=FLOAT64):
    assert expected.max() > 0
    assert np.abs(got - expected).max() <= rtol * expected.max()


def to_eye(frame, points):
    away = np.asarray(frame.scene.camera.eye)[:, None] - points.position
    return away / np.linalg.norm(away, axis=0)


def spread(frame, points, values):
    result = np.zeros((3, frame.height, frame.width))
    result.reshape(3, -1)[:, points.pixel] = values
    return result


def lobes(frame, method, *changes):
    known = METHODS[method]
    return known.compute_lobes(frame, from_text(known.settings(), changes))[0]


@pytest.mark.feature("REF-27")
def test_receivers_are_the_pixels_with_a_lobe_that_face_the_eye(frame):
    points = frame.glossy_points
    at, materials = receiver_lobes.glossy_pixels(frame)
    w_o = receiver_lobes.unit(np.asarray(frame.scene.camera.eye) - frame.gbuffer.position[:, *at].T)
    normal = frame.gbuffer.normal[:, *at].T
    facing = (normal * w_o).sum(axis=1) > 0
    assert np.array_equal(points.pixel, (at[0] * frame.width + at[1])[facing])
    np.testing.assert_allclose(points.mirrored.T, receiver_lobes.mirrored(normal, w_o)[facing], atol=1e-15)
    assert points.exponent.tolist() == [m.exponent for m, seen in zip(materials, facing, strict=True) if seen]
    assert points.specular.T.tolist() == [list(m.specular) for m, seen in zip(materials, facing, strict=True) if seen]
    assert len(set(points.exponent.tolist())) > 1


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("shadows", ["map", "exact"])
def test_direct_light_is_reflected_with_its_shadows(shadows):
    frame = Frame(SCENES["lamps"](), **OPTIONS, shadows=shadows)
    points, expected = frame.glossy_points, np.zeros((3, 13 * 17))
    normal, to = points.normal.T, to_eye(frame, points).T
    for index, light in enumerate(frame.scene.lights):
        irradiance = Frame(frame.scene.with_lights(light), **OPTIONS, shadows=shadows).direct.reshape(3, -1)
        away = (-np.broadcast_to(light.direction, normal.shape) if index == 2 else
                np.asarray(light.position) - points.position.T)
        w_i = receiver_lobes.unit(away)
        lobe = receiver_lobes.brdf(points.exponent, normal, w_i, to)
        expected[:, points.pixel] += points.specular * lobe * irradiance[:, points.pixel]
    close(frame.direct_lobes, expected.reshape(3, 13, 17))


@pytest.mark.feature("REF-27", "HSS-16")
def test_the_picture_is_diffuse_light_and_lobes():
    frame = Frame(SCENES["lamps"](), **OPTIONS)
    picture = render(frame.scene, "sii", of(SiiSettings, lights=32), **OPTIONS)
    buffer = frame.gbuffer
    diffuse = buffer.albedo / math.pi * (frame.direct + picture.irradiance)
    assert picture.lobes.max() > 0
    np.testing.assert_allclose(picture.radiance, diffuse + frame.direct_lobes + picture.lobes, rtol=1e-12, atol=1e-15)
    direct = buffer.albedo / math.pi * frame.direct + frame.direct_lobes
    np.testing.assert_allclose(frame.radiance(), direct, rtol=1e-12)


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("clamp", ["none", "disc"])
def test_sii_sums_all_lights(frame, clamp):
    settings = of(SiiSettings, lights=48, **{"pairs.clamp": clamp})
    lights, points = choose_lights(frame, settings.lights), frame.glossy_points
    assert lights.lobe_flux.any()
    areas = footprints(frame, settings.lights, settings.pairs)
    got = METHODS["sii"].lobes(frame, settings)
    close(got, spread(frame, points, defined(points, lights, to_eye(frame, points), settings.pairs, areas)))
    if clamp == "none":
        close(got, receiver_lobes.of_lights(frame, lights, settings.pairs))


@pytest.mark.feature("REF-27")
def test_half_resolution_and_lightcuts_leave_lobes_as_they_are(room):
    plain = lobes(room, "sii", "lights=48")
    assert np.array_equal(lobes(room, "sii", "lights=48", "half_resolution=true"), plain)
    assert np.array_equal(lobes(room, "sii", "lights=48", "lightcuts=bounded"), plain)


@pytest.mark.feature("REF-27")
def test_a_cut_leaves_the_same_pairs_out(room):
    """Lobes of exponent 0 around the normals: what is left is the irradiance."""
    changes = ("lights=64", "reach.cut=relative", "reach.cut.share=0.3", "pairs.clamp=none")
    plain, cut = lobes(room, "sii", *changes[:1], changes[3]), lobes(room, "sii", *changes)
    assert (cut <= plain * (1 + 1e-12)).all()
    assert cut.sum() < 0.99 * plain.sum()
    assert_even_lobes_are_irradiance(room, "sii", from_text(SiiSettings(), changes))


def assert_even_lobes_are_irradiance(room, method, settings, rtol=FLOAT64):
    points, frame = room.glossy_points, Frame(room.scene, **OPTIONS)
    frame.glossy_points = points._replace(mirrored=points.normal, exponent=np.zeros_like(points.exponent),
                                          specular=np.ones_like(points.specular))
    irradiance = METHODS[method].function(frame, settings).reshape(3, -1)[:, points.pixel]
    close(METHODS[method].lobes(frame, settings).reshape(3, -1)[:, points.pixel], irradiance / math.pi, rtol)


@pytest.mark.feature("REF-17", "REF-25")
def test_imperfect_maps_shadow_lobes_as_they_do_irradiance(room):
    """Lobes of exponent 0 around the normals, whose light is the irradiance that tests/wiring/test_vpl has by loops."""
    changes = ("lights=24", "maps=imperfect", "maps.points=300", "maps.resolution=16")
    settings = from_text(METHODS["vpl"].settings(), changes)
    assert_even_lobes_are_irradiance(room, "vpl", settings, RAYS)
    by_rays = lobes(room, "vpl", *changes[:1])
    assert np.abs(METHODS["vpl"].lobes(room, settings) - by_rays).max() > 0.01 * by_rays.max()


@pytest.mark.feature("AMS-13", "REF-02", "REF-27")
@pytest.mark.parametrize(("scene", "visibility"), [("lamps", True), ("smooth", True), ("lamps", False)])
def test_vpl_sums_what_shadow_rays_let_through(scene, visibility):
    """Without visibility nothing arrives from below a face either, which flat faces alone leave to the normal."""
    frame = Frame(SCENES[scene](), **OPTIONS)
    settings = from_text(METHODS["vpl"].settings(), ("lights=40", f"visibility={str(visibility).lower()}"))
    with stages.observe(record=True) as log:
        got = METHODS["vpl"].lobes(frame, settings)
    lights = next(run.arguments["lights"] for run in log.runs if run.name == "pairs.glossy_rays")
    pairs = SiiSettings().pairs
    close(got, receiver_lobes.of_lights(frame, lights, replaced(pairs, {"clamp": "none"}), visibility), RAYS)


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_gather_sums_the_discs(room, offset):
    settings = from_text(METHODS["gather"].settings(), ("disc.samples=40", f"disc.offset={offset}"))
    points, disc = room.glossy_points, settings.disc
    (pattern, weight), total = gather.disc_pattern(disc), np.zeros(points.position.shape)
    w_o, ids = to_eye(room, points), np.zeros((1, len(points.pixel)), int)
    for rsm in room.rsms:
        texel = gather.disc_texels(rsm, disc, pattern, points.position[:, None], ids)[:, 0]
        for i in range(len(points.pixel)):
            x, normal, on = points.position[:, i], points.normal[:, i], texel[:, i] >= 0
            p, n, flux = (part.reshape(3, -1)[:, texel[on, i]] for part in (rsm.position, rsm.normal, rsm.flux))
            p = p - offset * n
            with np.errstate(invalid="ignore", divide="ignore"):
                w_i = ((p - x[:, None]) / np.linalg.norm(p - x[:, None], axis=0)).T
                f = receiver_lobes.brdf(points.exponent[i], normal, w_i, w_o[:, i])
                light = np.where(flux.any(axis=0), pair(x[:, None], normal[:, None], p, n, flux) * f, 0.0)
            scale = disc.radius**2 * rsm.projection.height * rsm.projection.width / disc.samples
            total[:, i] += points.specular[:, i] * scale * (light @ weight[on])
    close(METHODS["gather"].lobes(room, settings), spread(room, points, total))


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("kind", ["geometry", "irradiance", "error"])
def test_multires_of_single_pixels_is_the_whole_sum(room, kind):
    changes = ("lights=32", "pairs.clamp=none", f"subsplats={kind}", "subsplats.coarsest=64")
    settings = from_text(METHODS["multires"].settings(), changes)
    assert top_level(13, 17, 64) == 0
    lights = choose_lights(room, settings.lights)
    close(METHODS["multires"].lobes(room, settings), receiver_lobes.of_lights(room, lights, settings.pairs))


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("criteria", ["none", "geometry"])
def test_lists_of_each_light_are_refined_by_what_the_lobe_reflects(room, criteria):
    """Exponent by exponent, on cells of glossy pixels: the paper's refinement and upsampling by loops."""
    changes = ("lights=12", "pairs.clamp=none", "subsplats=irradiance", "subsplats.coarsest=3",
               "subsplats.threshold=0.4")
    settings = from_text(METHODS["multires"].settings(), changes)
    lights, points = choose_lights(room, settings.lights), room.glossy_points
    top, expected = top_level(13, 17, 3), np.zeros((3, 13, 17))
    assert top == 3
    single = points._replace(specular=np.ones_like(points.specular))
    for exponent in np.unique(points.exponent):
        covered = np.zeros((13, 17), bool)
        covered.reshape(-1)[points.pixel[points.exponent == exponent]] = True
        for k in range(lights.position.shape[1]):
            one = type(lights)(*(part[..., k : k + 1] for part in lights[:6]), 1)
            at = spread(room, points, defined(single, one, to_eye(room, points), settings.pairs))
            leaves = per_light.subsplats(covered, lambda place, at=at: at[:, place[0], place[1]], top, 0,
                                         lambda largest: 0.4 * largest)
            expected += upsampled(covered, top, "tent", leaves)
    specular = spread(room, points, points.specular)
    got = METHODS["multires"].lobes(room, settings)
    if criteria == "none":
        close(got, expected * specular, 1e-9)
    else:  # what geometry asks for is refined beside
        both = METHODS["multires"].lobes(room, from_text(settings, ("subsplats.criteria=geometry",)))
        whole = receiver_lobes.of_lights(room, lights, settings.pairs)
        assert np.abs(both - whole).sum() < np.abs(got - whole).sum()


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("upsampling", ["tent", "demo", "nearest"])
def test_shared_subsplats_stand_for_glossy_pixels_of_one_exponent(room, upsampling):
    """Every glossy pixel lies in one of them, at whose representative the lobe is summed and upsampled by loops."""
    changes = ("lights=16", "pairs.clamp=none", "subsplats.coarsest=3", f"upsampling={upsampling}")
    settings = from_text(METHODS["multires"].settings(), changes)
    lights, points = choose_lights(room, settings.lights), room.glossy_points
    single = points._replace(specular=np.ones_like(points.specular))
    at = spread(room, points, defined(single, lights, to_eye(room, points), settings.pairs))
    expected, listed = np.zeros((3, 13, 17)), 0
    for exponent in np.unique(points.exponent):
        chosen = points.exponent == exponent
        covered = np.zeros((13, 17), bool)
        covered.reshape(-1)[points.pixel[chosen]] = True
        some = type(points)(*(np.ascontiguousarray(part[..., chosen]) for part in points))
        shared = glossy_subsplats(room.gbuffer, some, settings.subsplats)
        cells = [tuple(map(int, cell)) for cell in zip(shared.level, shared.row, shared.column, strict=True)]
        times = np.zeros((13, 17), int)
        for level, i, j in cells:
            times[i << level : (i + 1) << level, j << level : (j + 1) << level] += 1
        assert (times[covered] == 1).all()
        leaves = {cell: at[:, *per_light.representative(covered, *cell)] for cell in cells}
        expected += upsampled(covered, shared.top, upsampling, leaves) * covered
        listed += len(cells)
    assert listed < len(points.pixel)
    close(METHODS["multires"].lobes(room, settings), expected * spread(room, points, points.specular), 1e-9)


@pytest.mark.feature("AMS-13", "REF-27")
@pytest.mark.parametrize("visibility", ["rays", "val"])
def test_multires_sees_what_vpl_and_val_see(room, visibility):
    """With subsplats of one pixel each the shadows are those of the other method, to rounding."""
    changes = ("lights=24", "pattern=halton", "subsplats.coarsest=64", f"visibility={visibility}")
    settings = from_text(METHODS["multires"].settings(), changes)
    if visibility == "rays":
        lights = choose_lights(room, settings.lights)
        expected = receiver_lobes.of_lights(room, lights, replaced(settings.pairs, {"clamp": "none"}), True)
        close(METHODS["multires"].lobes(room, settings), expected, RAYS)
    else:
        close(METHODS["multires"].lobes(room, settings), METHODS["val"].lobes(room, settings.shadows))


@pytest.mark.feature("AMS-13", "REF-27")
def test_a_supersampled_lobe_is_the_mean_of_its_glossy_pixels(room):
    settings = from_text(METHODS["multires"].settings(), ("lights=16", "pairs.clamp=none", "subsplats=error"))
    fine = Frame(room.scene, **{**OPTIONS, "width": 34, "height": 26})
    whole = receiver_lobes.of_lights(fine, choose_lights(room, settings.lights), settings.pairs)
    glossy = np.zeros((26, 34), bool)
    glossy.reshape(-1)[fine.glossy_points.pixel] = True
    got = METHODS["multires"].lobes(room, replaced(settings, {"supersampled": True}))
    for pixel in room.glossy_points.pixel:
        i, j = divmod(int(pixel), 17)
        block = np.s_[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
        if glossy[block].any():
            np.testing.assert_allclose(got[:, i, j], whole[:, *block][:, glossy[block]].mean(axis=1), rtol=1e-9,
                                       atol=1e-12)
    outside = np.ones(13 * 17, bool)
    outside[room.glossy_points.pixel] = False
    assert not got.reshape(3, -1)[:, outside].any()


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("changes", [("visibility=rays_vpls",), ("visibility=rays_rectangle", "interleaving.block=4"),
                                     ("visibility=none",), ("visibility=pcf",), ("visibility=csm",)], ids=str)
def test_val_shadows_each_area_light(room, changes):
    """V of area lights at the points, f_s of each pixel light; interleaving and blur leave lobes as they are."""
    settings = from_text(METHODS["val"].settings(), ("lights=30", "clusters=4", "pairs.clamp=none", *changes))
    lights, points = choose_lights(room, settings.lights), room.glossy_points
    areas, maps = cluster_lights(room, lights, settings)
    seen = reference_visibility(room, lights, areas, maps, settings)
    normal = face_normals(room.scene.geometry, room.gbuffer.triangle_id.reshape(-1)[points.pixel], points.normal.T).T
    if seen is None and settings.visibility is not None:
        from refgi.cluster.visibility.shadow import visibility

        def seen(m, at, facing):
            return visibility(maps, areas, m, at, facing, settings)

    expected = np.zeros(points.position.shape)
    for m in range(4):
        of_m = np.flatnonzero(areas.of == m)
        some = type(lights)(*(part[..., of_m] for part in lights[:6]), len(of_m))
        part = defined(points, some, to_eye(room, points), settings.pairs)
        expected += part * (1.0 if seen is None else seen(m, points.position, np.ascontiguousarray(normal)))
    close(METHODS["val"].lobes(room, settings), spread(room, points, expected))
    assert settings.visibility is None or expected.sum() < 0.999 * lobes(
        room, "val", "lights=30", "clusters=4", "pairs.clamp=none", "visibility=none").sum()


def levels_of(frame, settings):
    made = pyramid(frame, settings)
    return sender_pyramid(frame, made, settings), chosen_radius(made[0].shape, settings.sampling)


def texel(level, i, j):
    return {"position": level.position[:, i : i + 1, j : j + 1], "normal": level.normal[:, i : i + 1, j : j + 1],
            "area": level.area[i : i + 1, j : j + 1]}


@pytest.mark.feature("REF-27", "HSS-04", "HSS-07")
@pytest.mark.parametrize("changes", [(), ("form_factor=point",), ("form_factor=texel",), ("disc_share=1",),
                                     ("only_level=1",), ("visibility=rays",), ("downsample=closest", "start=full")],
                         ids=str)
def test_hssil_sums_every_texel_of_all_levels(room, changes):
    base = ("levels=3", "radius=2", "sampling.pattern=all")
    settings = from_text(HssilSettings(), (*base, *changes))
    points, eye = room.glossy_points, np.asarray(room.scene.camera.eye)
    senders, radius = levels_of(room, settings)
    w_o, total = to_eye(room, points), np.zeros(points.position.shape)
    form, share = settings.senders.form_factor, settings.senders.disc_share
    facing = face_normals(room.scene.geometry, room.gbuffer.triangle_id.reshape(-1)[points.pixel], points.normal.T)
    for index, level in enumerate(senders):
        if settings.senders.only_level not in (None, index):
            continue
        for n, pixel in enumerate(points.pixel):
            row, column = (int(k) >> level.number for k in divmod(int(pixel), room.width))
            for ox, oy in every_texel(radius if index else 0.0, 2 * radius)[0][0, 0]:
                i, j = row + oy, column + ox
                if not (0 <= i < level.shape[0] and 0 <= j < level.shape[1]) or level.pixel[i, j] < 0:
                    continue
                place = (points.position[:, n] - eye)[:, None, None]
                here = {"position": place, "normal": points.normal[:, n, None, None]}
                worth = transfer_of(here, (0, 0), (0, 0), 1.0, form, texel(level, i, j), share)
                d = level.position[:, i, j] + eye - points.position[:, n]
                if worth > 0:
                    f = float(receiver_lobes.brdf(points.exponent[n], points.normal[:, n], d / np.linalg.norm(d),
                                                  w_o[:, n]))
                    if "visibility=rays" in changes and f > 0:
                        worth *= unoccluded(room, points.position[:, n], facing[n], level.pixel[i, j])
                    total[:, n] += worth * f * level.radiance[:, i, j]
    close(METHODS["hssil"].lobes(room, settings), spread(room, points, total * points.specular), 1e-9)


@pytest.mark.feature("REF-20")
@pytest.mark.parametrize(("switch", "factor"), [("hss_disc_pi", 1 / math.pi), ("hss_level_factor", 4.0),
                                                ("hss_tan_f", None)])
def test_printed_forms_of_hssil_have_their_factor_in_lobes(room, switch, factor):
    """Section 0, of the second level alone: 1/pi of discs, 4^k, tan f_h tan f_v over those of half the angles."""
    horizontal, vertical = room.gbuffer.projection.half
    factor = factor or 4 / ((1 - horizontal**2) * (1 - vertical**2))
    form = "point" if switch == "hss_tan_f" else "disc"
    changes = "levels=3", "radius=2", "pattern=all", "only_level=1", f"form_factor={form}"
    close(lobes(room, "hssil", *changes, f"as_published={switch}"), factor * lobes(room, "hssil", *changes), 1e-12)


def unoccluded(frame, x, facing, pixel):
    """Return whether a pixel's surface is seen from x above its face."""
    at = divmod(int(pixel), frame.width)
    y = frame.gbuffer.position[:, *at]
    up = face_normals(frame.scene.geometry, frame.gbuffer.triangle_id[at][None], frame.gbuffer.normal[:, *at][None])[0]
    if (y - x) @ facing <= 0 or (x - y) @ up <= 0:
        return 0.0
    return float(free(corners_of(frame.scene.geometry), (x + LIFT * facing)[None], y + LIFT * up)[0])


@pytest.mark.feature("REF-27")
def test_hssil_marches_slices_past_a_bitmask(room):
    changes = ("levels=2", "radius=2", "samples=9", "visibility=bitmask", "visibility.thickness=0.05", "pattern=pixel")
    settings = from_text(HssilSettings(), changes)
    points, eye = room.glossy_points, np.asarray(room.scene.camera.eye)
    senders, radius = levels_of(room, settings)
    w_o, total = to_eye(room, points), np.zeros(points.position.shape)
    thickness = settings.visibility.thickness * room.visible_extent.diagonal
    for index, level in enumerate(senders):
        for n, pixel in enumerate(points.pixel):
            at = divmod(int(pixel), room.width)
            row, column = (int(k) >> level.number for k in at)
            d = level.position + (eye - points.position[:, n])[:, None, None]
            with np.errstate(invalid="ignore", divide="ignore"):
                w_i = np.moveaxis(d / np.linalg.norm(d, axis=0), 0, -1)
            f = receiver_lobes.brdf(points.exponent[n], points.normal[:, n], w_i, w_o[:, n])
            of_level = {"position": level.position, "normal": level.normal, "area": level.area,
                        "radiance": level.radiance * np.where(level.pixel >= 0, f, 0.0)}
            position, normal = level.position.copy(), level.normal.copy()
            position[:, row, column], normal[:, row, column] = points.position[:, n] - eye, points.normal[:, n]
            here = {"position": position, "normal": normal}
            kind = settings.senders.form_factor, settings.senders.disc_share
            for samples in crown_points.slices(settings.sampling, settings.visibility, radius, index, level.number,
                                               *at):
                total[:, n] += one_slice(here, of_level, (row, column), samples, thickness, *kind)
    close(METHODS["hssil"].lobes(room, settings), spread(room, points, total * points.specular), 1e-9)


@pytest.mark.feature("REF-27")
@pytest.mark.parametrize("spread_of", [1.0, 0.3, 1 / 64])
def test_warped_angles_have_the_density_of_their_weights(spread_of):
    """Points fall into bins of angle as often as weights say they do not: each bin's weights sum to its share."""
    count, bins = 1 << 16, 24
    phi = 0.7
    made = np.array([warped((k + 0.5) / count, math.cos(phi), math.sin(phi), spread_of) for k in range(count)])
    np.testing.assert_allclose(np.hypot(made[:, 0], made[:, 1]), 1.0, rtol=1e-12)
    angle = np.arctan2(made[:, 1], made[:, 0])
    share = np.histogram(angle, bins, (-math.pi, math.pi), weights=made[:, 2] / count)[0]
    np.testing.assert_allclose(share, 1 / bins, atol=2e-3)
    assert made[:, 2].max() <= 1 / spread_of * (1 + 1e-9)
    within = np.abs((angle - phi + math.pi) % (2 * math.pi) - math.pi) <= 2 * math.atan(spread_of)
    assert abs(within.mean() - 0.5) < 1e-3


@pytest.mark.feature("REF-27")
def test_crowns_by_importance_mean_the_sum_over_all_texels(evidence):
    """Over many seeds, with discs of one texel: others would be smaller where a sample stands for less."""
    frame = Frame(glossy_box(60.0, blocks=60.0), width=SIZE, height=SIZE, rsm_resolution=64)
    base = ("levels=3", "downsample=closest", "form_factor=texel")
    whole = lobes(frame, "hssil", *base, "pattern=all")
    seeds = np.array([lobes(frame, "hssil", *base, "samples=400", f"seed={seed}") for seed in range(40)], float)
    mean, error = seeds.mean(axis=(0, 2, 3)), seeds.mean(axis=(2, 3)).std(axis=0, ddof=1) / math.sqrt(40)
    z = (mean - whole.mean(axis=(1, 2), dtype=float)) / error
    bias = np.abs(mean / whole.mean(axis=(1, 2)) - 1).max()
    assert np.abs(z).max() < SIGMAS
    assert error.max() < 0.01 * whole.mean()
    evidence(f"mean of 40 seeds: {bias:.1%} off, {np.abs(z).max():.1f} standard errors")


@pytest.mark.feature("REF-27")
def test_cameras_join_the_largest_lobes(room):
    """What a second camera finds is what glossy pixels that it sees reflect towards the first camera's eye."""
    side = VIEW.__class__((-0.6, 1.2, 0.9), (0.3, 0.4, -0.6), (0.0, 1.0, 0.1), math.radians(80), 17, 13)
    settings = from_text(HssilSettings(), ("levels=2", "radius=4", "pattern=all"))
    alone = METHODS["hssil"].lobes(room, settings)
    joined = METHODS["hssil"].lobes(room, replaced(settings, {"cameras.views": (side,)}))
    other, buffer = frame_through(room, side), room.gbuffer
    found = view_lobes(other, glossy_points(other.gbuffer, other.materials, room.scene.camera.eye), settings)
    seen = SourceView(other.gbuffer.projection, other.gbuffer.depth, other.gbuffer.normal)
    found, _ = reproject(found, seen, buffer.position, buffer.normal, buffer.covered,
                         depth_tolerance=settings.cameras.depth_tolerance, normal_cosine=settings.cameras.normal_cosine)
    close(joined, np.where(spread(room, room.glossy_points, 1.0) > 0, np.maximum(alone, found), 0.0))
    assert (joined >= alone).all()
    assert joined.sum() > 1.01 * alone.sum()
    outside = np.ones(13 * 17, bool)
    outside[room.glossy_points.pixel] = False
    assert not joined.reshape(3, -1)[:, outside].any()
    same = replaced(settings, {"cameras.views": (VIEW,)})  # it sees nothing else
    np.testing.assert_allclose(METHODS["hssil"].lobes(room, same), alone, rtol=0.05, atol=0.02 * alone.max())


@pytest.mark.feature("REF-27")
def test_frames_of_a_sequence_have_lobes_of_their_own(room):
    settings = from_text(HssilSettings(), ("levels=2", "radius=3", "samples=8"))
    scenes = [room.scene, room.scene.with_camera(eye=(1.6, 1.4, 1.5))]
    first, second = Sequence(scenes, settings, **OPTIONS)
    assert np.array_equal(first.lobes, METHODS["hssil"].lobes(first.frame, settings))
    assert np.array_equal(second.lobes, METHODS["hssil"].lobes(second.frame, replaced(settings, {"sampling.seed": 1})))
    for step in (first, second):
        assert np.array_equal(step.radiance, step.frame.radiance(step.irradiance, step.lobes))


@pytest.mark.feature("REF-27")
def test_without_a_visible_glossy_surface_no_code_of_lobes_runs():
    """A glossy material that is out of sight, or glass, is none."""
    def never(*_):
        raise AssertionError

    scene = glossy_box().with_camera(eye=(0.278, 0.4, 0.3), target=(0.278, 0.8, 0.3001))
    frame = Frame(scene, width=16, height=16, rsm_resolution=32)
    assert not frame.glossy_receivers
    method = METHODS["sii"]._replace(lobes=never)
    made = method.light(frame, of(SiiSettings, lights=16))
    assert made.lobes is None
    with without_skip("frame.lobes"):
        again = Frame(scene, width=16, height=16, rsm_resolution=32)
        assert again.glossy_receivers
        assert not METHODS["sii"].light(again, of(SiiSettings, lights=16)).lobes.any()


@pytest.mark.feature("REF-27")
def test_glass_has_no_lobe():
    """Whatever reflectances its material states, alone in the picture or beside lobes."""
    scene = SCENES["lamps"]()
    glass = tuple(dataclasses.replace(m, ior=1.5) if m.specular[0] else m for m in scene.materials)
    frame = Frame(dataclasses.replace(scene, materials=glass), **OPTIONS)
    assert not frame.glossy_receivers
    one = tuple(dataclasses.replace(m, ior=1.5) if m.exponent == 40 else m for m in scene.materials)
    frame = Frame(dataclasses.replace(scene, materials=one), **OPTIONS)
    assert set(frame.glossy_points.exponent.tolist()) == {12.0}


def test_a_method_without_lobes_says_so_once(room):
    method = METHODS["sii"]._replace(name="plain", lobes=None)
    _WARNED.discard("plain")
    with pytest.warns(RefgiWarning, match="plain: glossy surfaces reflect indirect light by their diffuse part alone"):
        assert method.compute_lobes(room, SiiSettings()) == (None, None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert method.compute_lobes(room, SiiSettings()) == (None, None)


def test_irradiance_and_lobes_share_what_both_need(room):
    """Lights are chosen once; the lobes are those of a run by itself."""
    settings = of(SiiSettings, lights=16)
    with stages.observe() as log:
        made = METHODS["sii"].light(room, settings)
    assert [run.status for run in log.runs if run.name == "lights.choose"].count("ran") <= 1
    assert log.memory is None
    assert np.array_equal(made.lobes, METHODS["sii"].lobes(room, settings))
    assert np.array_equal(made.irradiance, METHODS["sii"].function(room, settings))


@pytest.mark.feature("REF-27")
def test_materials_of_one_exponent_keep_their_reflectance():
    """Two lobes of one shape in different colours, of which each pixel has its own."""
    scene = SCENES["lamps"]()
    same = tuple(dataclasses.replace(m, exponent=12.0) if any(m.specular) else m for m in scene.materials)
    frame = Frame(dataclasses.replace(scene, materials=same), **OPTIONS)
    assert len(np.unique(frame.glossy_points.specular, axis=1).T) > 1
    changes = ("lights=32", "pairs.clamp=none", "subsplats.coarsest=64")
    settings = from_text(METHODS["multires"].settings(), changes)
    lights = choose_lights(frame, settings.lights)
    close(METHODS["multires"].lobes(frame, settings), receiver_lobes.of_lights(frame, lights, settings.pairs))


def test_no_ray_is_traced_for_a_light_off_the_lobe(room, monkeypatch):
    """A sharp lobe meets few lights: far fewer rays than the irradiance of the same pixels has."""
    traced = []
    whole = Tracer.fill_occluded

    def counting(self, origins, directions, reach, blocked):
        traced.append(int(np.count_nonzero(reach > 0)))
        return whole(self, origins, directions, reach, blocked)

    monkeypatch.setattr(Tracer, "fill_occluded", counting)
    sharp = Frame(room.scene, **OPTIONS)
    sharp.glossy_points = room.glossy_points._replace(exponent=np.full_like(room.glossy_points.exponent, 1e6))
    settings = from_text(METHODS["vpl"].settings(), ("lights=40",))
    METHODS["vpl"].lobes(room, settings)
    wide = sum(traced)
    traced.clear()
    METHODS["vpl"].lobes(sharp, settings)
    assert sum(traced) < 0.2 * wide
