"""Path tracing of glossy receivers: closed forms, every texel of the map, estimators side by side, their error."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_of

from refgi.frame import Frame
from refgi.methods import find_method, render
from refgi.rays import Tracer
from refgi.scene import Camera, DirectionalLight, Geometry, Material, PointLight, Scene, SpotLight, load_scene
from refgi.settings import of
from refgi.truth import TruthSettings, VplSettings, trace_truth
from refgi.truth.truth import _with_lobes, accumulate, accumulate_lobes, trace_lobes
from tests.glossy import glossy_box
from tests.naive import receiver_lobes as naive
from tests.truth.scenes import FEW_RAYS, cells_kept, rectangle, scene

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")  # of what sharp lobes leave out
SIGMAS = 4
MIDDLE = (0.0, -0.003, 0.0)  # nearly; the light in the middle sees a plate there edge-on
CERTAIN = 1e-4  # tail of a chi-square value
RUNS = 12  # of other seeds each
FOOTPRINT = 0.02  # of 24 x 24 pixels: photons make means over them, the closed form holds at their middle


@pytest.fixture(scope="module", autouse=True)
def _one_cut_of_each_scene():
    with cells_kept():
        yield


def in_sphere(exponent, settings, *, angles=(0.0, 40.0, 70.0), count=120):
    """Return what white lobes at the middle of a large lit sphere reflect, for some angles of view: a furnace.

    Receivers lie on tiny plates inside; the sphere is lit by a light in the middle, from within, and sends the same
    radiance rho I / (pi R^2) from everywhere.
    """
    light = PointLight((0.0, 0.0, 0.0), (0.8, 1.6, 0.4))
    materials, geometry, tracer = sphere_and_plate()
    white = Material("white lobe", (0.0,) * 3, (1.0,) * 3, exponent)
    means = []
    for degrees in angles:
        eye = 0.5 * np.array([math.sin(math.radians(degrees)), 0, -math.cos(math.radians(degrees))]) + MIDDLE
        room = Scene("furnace", geometry, (*materials, white), Camera(tuple(eye), MIDDLE), (light,))
        place = np.tile(np.reshape(MIDDLE, (3, 1, 1)), (1, 1, count))
        normal = np.tile(np.array([0.0, 0.0, -1.0]).reshape(3, 1, 1), (1, 1, count))
        ids = np.full((1, count), len(geometry.faces) - 1, np.int32)
        means.append(accumulate_lobes(room, tracer, place, normal, ids, settings))
    return means, 0.5 * np.array(light.intensity) / math.pi


@functools.cache
def sphere_and_plate():
    """Return the sphere's materials, and geometry and tracer of the sphere and a plate at its middle."""
    found = load_scene("integrating_sphere:faces=20000,albedo=0.5")
    sphere = found.geometry
    corners = np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)]) * 1e-4 + MIDDLE
    geometry = Geometry(np.concatenate([sphere.vertices, corners]),
                        np.concatenate([sphere.faces, len(sphere.vertices) + np.array([[0, 1, 2]])]),
                        np.append(sphere.material_of_face, len(found.materials)).astype(np.int32))
    return found.materials, geometry, Tracer(geometry)


FACETS = 4e-3  # a light in the middle of 20000 faces: the polyhedron lies within the sphere


@pytest.mark.slow("1.0", "1000.0", "1000000.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("exponent", [0.0, 1.0, 30.0, 1e3, 1e6, 1e20])
def test_furnace_of_a_closed_lit_sphere(exponent, evidence):
    results, radiance = in_sphere(exponent, TruthSettings(samples=24 * 64, **FEW_RAYS))
    found, error = [], 0.0
    for result, degrees in zip(results, (0.0, 40.0, 70.0), strict=True):
        expected = naive.tilted_albedo(min(exponent, 1e8), math.radians(degrees)) * radiance
        ratio, sigma = result.picture_mean / expected, np.sqrt(result.picture_variance) / expected
        found.append(ratio.mean())
        error = max(error, (np.abs(ratio - 1) - SIGMAS * sigma).max())
    evidence(f"P = {exponent:g}: {', '.join(f'{r:.4f}' for r in found)} of the quadrature at 0, 40, 70 degrees")
    assert error < FACETS


@pytest.mark.feature("REF-26")
@pytest.mark.parametrize(("exponent", "estimator"), [
    *((p, kind) for p in (0.0, 30.0, 1e4) for kind in ("combined", "hemisphere")), (0.0, "light")])
def test_a_path_tracer_in_numpy_agrees(exponent, estimator, evidence):
    """Diffuse walls, one spot, a blocker; receivers seen from near and far: 4000 paths each, ray against triangle."""
    room, points, normal, expected, variance = by_numpy(exponent)
    how = {"samples": 16 * 60} if estimator == "light" else {"samples": 24 * 40, **FEW_RAYS}
    settings = TruthSettings(estimator=estimator, **how)
    result = at_corner(room, points, normal, settings)
    got = result.mean[:, :, 0].T
    z = (got - expected) / np.sqrt(variance + result.variance_of_mean[:, :, 0].T + (1e-3 * expected.max()) ** 2)
    relative = np.abs(got.mean(0) / expected.mean(0) - 1).max()
    evidence(f"P = {exponent:g}, {estimator}: differ by at most {np.abs(z).max():.1f} standard errors, means by "
             f"{relative:.1e}")
    assert np.abs(z).max() < SIGMAS + 1  # of 12 points and three channels


@functools.cache
def by_numpy(exponent):
    """Return the room, points and normals of its floor, and by NumPy what they reflect with its variance."""
    lobe = Material("lobe", (0.2,) * 3, (0.6, 0.5, 0.4), exponent)
    light = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))
    room, points, normal, w_o = corner(lobe, light)
    random = np.random.default_rng(3)
    return room, points, normal, *naive.from_mirror_side(room, points, normal, w_o, lobe, light, 4000, random)


def corner(lobe, *lights):
    """A glossy floor between two walls and a plate; points of the floor, half of them near a wall."""
    red, green = Material("red", (0.7, 0.1, 0.1)), Material("green", (0.1, 0.6, 0.2))
    room = scene([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), lobe), rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), red),
                  rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), green),
                  rectangle((-0.4, 0.5, -0.1), (0.6, 0, 0), (0, 0, -0.5))], *lights)
    room = dataclasses.replace(room, camera=Camera((1.3, 1.1, 1.6), (-0.5, 0.0, -0.5)))
    random = np.random.default_rng(12)
    u, v = random.uniform(0.05, 1.4, 12), random.uniform(0.05, 1.4, 12)
    u[::2] *= 0.05
    points = np.stack([u - 1, np.zeros(12), v - 1], axis=1)
    normal = np.tile([0.0, 1.0, 0.0], (12, 1))
    return room, points, normal, naive.unit(np.asarray(room.camera.eye) - points)


def at_corner(room, points, normal, settings):
    """Return the truth at points of the floor, (3, n, 1)."""
    ids = np.zeros((len(points), 1), np.int32)
    return accumulate_lobes(room, Tracer(room.geometry), points.T[..., None], normal.T[..., None], ids, settings)


def panel_before_light(exponent, senders=None):
    """A panel of a lobe over a floor and beside a wall, both lit by spots with soft edges, none of them near it."""
    panel = Material("panel", (0.1,) * 3, (0.8, 0.7, 0.6), exponent)
    ground = Material("ground", (0.5, 0.4, 0.3), (0.0,) * 3 if senders is None else (0.4,) * 3, senders or 0.0)
    side = Material("side", (0.2, 0.5, 0.7))
    spots = (SpotLight((0.2, 2.0, 0.9), (0.0, -1.0, 0.1), 0.1, 0.45, (3.0, 2.5, 2.0)),
             SpotLight((1.0, 1.2, 1.2), (-1.0, -0.2, 0.0), 0.1, 0.35, (1.0, 2.0, 3.0)))
    room = scene([rectangle((-0.6, 0.4, 0.0), (1.2, 0, 0), (0, 0.9, 0), panel),
                  rectangle((-1.5, 0, 2.5), (3, 0, 0), (0, 0, -2.5), ground),
                  rectangle((-1.4, 0.2, 2.4), (0, 0, -2.3), (0, 1.8, 0), side),
                  rectangle((-0.3, 0.2, 0.7), (0.3, 0, 0), (0, 0.25, 0), side)], *spots)
    return dataclasses.replace(room, camera=Camera((0.3, 1.0, 2.2), (0.0, 0.8, 0.0), vfov=math.radians(28)))


@pytest.mark.slow("1.0-None", "1000.0-None", "30.0-20.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize(("exponent", "senders"), [
    (1.0, None), (1.0, 20.0), (30.0, 20.0), (1e3, None), pytest.param(1e5, None, marks=pytest.mark.slow)])
def test_every_texel_of_the_map_gives_the_same(exponent, senders, evidence):
    """`vpl` with all texels, no clamp, a fine map, against the truth: means, and chi-square of means over blocks.

    A sharp lobe sees single texels: by how much a map is off is taken from one of half as many texels along a side,
    and counts beside the truth's standard error. Chi-square of a block is the mean over runs of several seeds; channels
    go together.
    """
    found, size = panel_before_light(exponent, senders), 16
    frames = [Frame(found, width=size, height=size, rsm_resolution=n)
              for n in ((160, 320) if exponent > 100 else (64, 128))]
    coarse, fine = (find_method("vpl").compute_lobes(frame, of(VplSettings, pattern="all"))[0] for frame in frames)
    runs = [trace_lobes(frames[1], TruthSettings(samples=24 * 20, seed=seed, **FEW_RAYS)) for seed in range(RUNS)]
    seen, used = runs[0].samples > 0, runs[0].block_pixels > 0
    mean = sum(run.picture_mean for run in runs) / RUNS
    own = (fine - coarse)[:, seen].mean(axis=1) / mean
    ratio = fine[:, seen].mean(axis=1) / mean
    sigma = np.sqrt(sum(run.picture_variance for run in runs)) / RUNS / mean
    of_map = block_means(fine - coarse, seen)[:, used] ** 2
    chi2 = np.mean([chi_square((block_means(fine, seen) - run.block_mean)[:, used], of_map
                               + run.block_variance[:, used]) for run in runs])
    evidence(f"P = {exponent:g}, senders {senders}: mean {ratio.mean():.4f} of the truth's (standard error "
             f"{sigma.max():.1e}; maps of half the size: {np.abs(own).max():.1e}); chi-square of a block "
             f"{chi2:.2f}")
    assert sigma.max() < 0.01
    assert (np.abs(ratio - 1) < 3 * np.hypot(sigma, own) + 2e-3).all()
    blocks = RUNS * np.count_nonzero(used)
    assert chi2 < chi2_of.isf(CERTAIN, blocks) / blocks


FEW = 1 << 13  # photons of a light in a pass


def without_metal(found):
    return dataclasses.replace(found, materials=tuple(
        dataclasses.replace(m, diffuse=(0.6,) * 3, specular=(0.0,) * 3) if m.name == "metal" else m
        for m in found.materials))


def chi_square(off, variance):
    """Return the mean of off^2 / variance, without values that no light can reach: 0 on both sides, with certainty."""
    some = (variance > 0) | (off != 0)
    with np.errstate(divide="ignore"):
        return (off[some] ** 2 / variance[some]).mean()


def block_means(picture, seen):
    """Return means over blocks of 8 x 8 pixels of the pixels that count."""
    h, w = seen.shape
    sums = (picture * seen).reshape(3, h // 8, 8, w // 8, 8).sum(axis=(2, 4))
    return sums / np.maximum(seen.reshape(h // 8, 8, w // 8, 8).sum(axis=(1, 3)), 1)


@pytest.mark.slow("2.0-20.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize(("exponent", "blocks"), [(2.0, 20.0), (30.0, 20.0)])
def test_estimators_agree(exponent, blocks, evidence):
    """Means, and chi-square of the means over blocks, of directions alone against both."""
    frame = Frame(panel_before_light(exponent, blocks), width=24, height=24)
    both = trace_lobes(frame, TruthSettings(samples=24 * 20, photons=FEW, **FEW_RAYS))
    alone = trace_lobes(frame, TruthSettings(samples=16 * 80, estimator="hemisphere", seed=1, photons=FEW))
    z = (both.picture_mean - alone.picture_mean) / np.sqrt(both.picture_variance + alone.picture_variance)
    used = (both.block_pixels > 0) & (both.block_mean[1] > 0.01 * both.picture_mean[1])  # directions miss the rest
    of_blocks = (both.block_mean - alone.block_mean)[:, used] ** 2 / (both.block_variance + alone.block_variance)[
        :, used]
    evidence(f"P = {exponent:g}, senders {blocks:g}: means differ by {np.abs(z).max():.1f} standard errors, chi-square "
             f"of a block {of_blocks.mean():.2f}; error of a pixel {both.pixel_error:.3f} and {alone.pixel_error:.3f}")
    assert np.abs(z).max() < SIGMAS
    assert of_blocks.mean() < 2  # six blocks or so, whose errors go together


SUN = DirectionalLight((0.3, -0.8, -0.5), (0.5, 0.4, 0.3))
ON_THE_GROUND = PointLight((0.2, 0.0, 0.9), (0.2, 0.3, 0.4))
AS_DIFFUSE = {  # exponent of the senders, further lights, settings
    "one lobe and another": (20.0, (), {}), "sunlight": (20.0, (SUN,), {}),
    "a lamp in a surface": (None, (ON_THE_GROUND,), {}), "normals off their faces": (20.0, (), {}),
    "three bounces": (20.0, (), {"bounces": 3}), "no visibility": (20.0, (), {"visibility": False}),
    "visible emitters": (None, (), {"emitters": "visible"}), "photons": (5e4, (), {"photons": 1 << 12}),
    "caustics": (300.0, (), {"photons": 1 << 12, "caustics": True})}


@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("case", AS_DIFFUSE)
def test_a_lobe_of_exponent_0_reflects_as_a_diffuse_surface(case, evidence):
    """L is s / pi times the irradiance, which other estimators find: f_s = s / pi up to a right angle off m.

    The eye is far away in front: m is the normal, nearly.
    """
    senders, lights, how = AS_DIFFUSE[case]
    room = panel_before_light(0.0, senders)
    eye = Camera((0.0, 0.85, 40.0), (0.0, 0.8, 0.0), vfov=math.radians(3.5))
    room = dataclasses.replace(room, lights=(*room.lights, *lights), camera=eye)
    if case == "normals off their faces":
        corners = room.geometry.vertices[room.geometry.faces]
        flat = naive.unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        normals = np.empty(room.geometry.vertices.shape)
        flat[2:] = naive.unit(flat[2:] + np.array((0.25, 0.15, -0.1)))  # of the senders
        normals[room.geometry.faces] = flat[:, None]
        room = dataclasses.replace(room, geometry=dataclasses.replace(room.geometry, vertex_normals=normals))
    frame = Frame(room, width=24, height=24)
    buffer = frame.gbuffer
    panel = np.where(buffer.triangle_id < 2, buffer.triangle_id, -1).astype(np.int32)
    inputs = room, frame.tracer, buffer.position, buffer.normal, panel
    settings = TruthSettings(samples=24 * 12, **how, **FEW_RAYS)
    lobes, diffuse = accumulate_lobes(*inputs, settings), accumulate(*inputs, settings)
    assert (lobes.samples > 0).sum() > 80
    factor = np.array(room.materials[room.geometry.material_of_face[0]].specular) / math.pi
    off = lobes.picture_mean - factor * diffuse.picture_mean
    z = off / np.sqrt(lobes.picture_variance + factor**2 * diffuse.picture_variance)
    used, factor = lobes.block_pixels > 0, factor[:, None]
    chi2 = chi_square(lobes.block_mean[:, used] - factor * diffuse.block_mean[:, used],
                      lobes.block_variance[:, used] + factor**2 * diffuse.block_variance[:, used])
    sigma = (np.sqrt(lobes.picture_variance) / lobes.picture_mean).max()
    evidence(f"{case}: means differ by {np.abs(z).max():.1f} standard errors of {sigma:.1e}, chi-square of a block "
             f"{chi2:.2f}")
    assert sigma < 0.02
    assert np.abs(z).max() < SIGMAS
    assert chi2 < 4  # four blocks, whose channels go together


@pytest.mark.feature("REF-26", "REF-32")
@pytest.mark.parametrize("estimator", ["combined", "hemisphere", "light"])
def test_nothing_comes_from_below_a_face_or_its_normal_nor_goes_to_an_eye_behind(estimator):
    """A lobe that takes from everywhere before a lit wall: below the face, below the normal, above both."""
    light = SpotLight((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.3, 0.3, (1.0, 2.0, 3.0))
    lobe, white = Material("lobe", (0.0,) * 3, (0.5,) * 3, 0.0), Material("white", (0.8,) * 3)
    slope = np.array((0.95, 0.3, 0.0)) / math.hypot(0.95, 0.3)
    away = slope * (-1, 1, 1)
    for height, normal, up, found in ((1.6, slope, 1, False), (-1.6, away, 1, False), (-1.6, slope, 1, True),
                                      (-1.6, slope, -1, False)):
        room = scene([rectangle((-0.5, height, 0.5), (1, 0, 0), (0, 0, -1), lobe),
                      rectangle((2, -1, -1), (0, 0, 2), (0, 2, 0), white)], light)
        room = dataclasses.replace(room, camera=Camera((0.0, height + up, 0.0), (0.0, height, 0.01)))
        points, normals = np.tile((0.0, height, 0.0), (64, 1)), np.tile(normal, (64, 1))
        settings = TruthSettings(samples=24 * 20, visibility=False, estimator=estimator, **FEW_RAYS)
        result = at_corner(room, points, normals, settings)
        assert result.mean.any() == found
        assert result.mean.min() >= 0
        assert (result.samples.max() > 0) == (up > 0)


@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("exponent", [1.0, 1e4])
def test_the_combination_is_as_good_as_the_better_one(exponent, evidence):
    """Variance of a pixel at equal samples: at most twice that of the better estimator alone."""
    frame, variance = Frame(without_metal(glossy_box(exponent)), width=16, height=16), {}
    for estimator, per_pass in (("combined", 24), ("hemisphere", 16), ("light", 16)):
        result = trace_lobes(frame, TruthSettings(samples=24 * 32, estimator=estimator))
        assert result.samples.max() == per_pass * -(-24 * 32 // per_pass)
        variance[estimator] = result.variance_of_mean.mean()
    ratio = variance["combined"] / min(variance["hemisphere"], variance["light"])
    evidence(f"P = {exponent:g}: {ratio:.2f} of the better one's variance, "
             f"{variance['combined'] / max(variance['hemisphere'], variance['light']):.1e} of the worse one's")
    assert ratio < 2


@pytest.mark.slow("1.0", "1000.0", "100000.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("exponent", [1.0, 30.0, 1e3, 1e5])
def test_the_error_falls_with_the_root_of_the_samples_or_faster(exponent, evidence):
    """Series of two passes against eight: independent ones give 2, a series stratified at best in one dimension 4."""
    frame = Frame(glossy_box(exponent), width=20, height=20)
    settings = [TruthSettings(samples=24 * n, seed=n, photons=FEW, **FEW_RAYS) for n in (16, 64)]
    errors = [np.sqrt(trace_lobes(frame, how).variance_of_mean.mean()) for how in settings]
    evidence(f"P = {exponent:g}: four times the samples, {errors[0] / errors[1]:.2f} times the accuracy")
    assert 1.6 < errors[0] / errors[1] < 4


@pytest.mark.feature("REF-26")
def test_stated_errors_are_the_spread_over_seeds(evidence):
    from scipy.stats import f as fisher

    frame, seeds, passes = Frame(glossy_box(30.0), width=24, height=24), 48, 4
    settings = TruthSettings(samples=24 * passes, **FEW_RAYS)
    runs = [trace_lobes(frame, dataclasses.replace(settings, seed=100 + seed)) for seed in range(seeds)]
    means = np.stack([run.picture_mean for run in runs])
    chi2 = ((means - means.mean(axis=0)) ** 2).sum(axis=0) / np.stack([run.picture_variance for run in runs]).mean(0)
    blocks = np.stack([run.block_mean for run in runs])
    used = runs[0].block_pixels > 0
    ratio = (blocks.var(axis=0, ddof=1)[:, used] / np.stack([run.block_variance for run in runs]).mean(0)[:, used])
    evidence(f"{seeds} runs of {passes} passes: variance over seeds is {chi2.mean() / (seeds - 1):.2f} (picture) and "
             f"{ratio.mean():.2f} (blocks) of what is stated")
    low, high = (seeds - 1) * fisher.ppf([CERTAIN, 1 - CERTAIN], seeds - 1, seeds * (passes - 1))
    assert ((low < chi2) & (chi2 < high)).all()
    assert 0.7 < ratio.mean() < 1.3  # 0.1 is one standard deviation of the mean of these 18


def mirror_room(sender, receiver):
    """A floor of one lobe beside a wall of another, which throws a spot's light on it."""
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), math.radians(25), math.radians(25), (3.0, 2.0, 1.0))
    wall = Material("mirror", (0.0,) * 3, (0.8, 0.7, 0.6), sender)
    floor = Material("floor", (0.0,) * 3, (0.5, 0.5, 0.5), receiver)
    room = scene([rectangle((-2, 0, 2), (3, 0, 0), (0, 0, -4), floor),
                  rectangle((1, 0, 2), (0, 0, -4), (0, 2, 0), wall)], light)
    return dataclasses.replace(room, camera=Camera((-1.2, 1.4, 0.2), (0.0, 0.0, 0.0), vfov=math.radians(40))), light


def of_image(room, light, receiver, frame):
    """Return which pixels of the floor the light's image behind the mirror lights, and L of the image there."""
    x, image = frame.gbuffer.position, np.array([2.0, 1.0, 0.0])
    axis = np.array([-1.0, -0.35, 0.0]) / math.hypot(1, 0.35)
    away = x - image[:, None, None]
    cosine = np.tensordot(axis, away / np.linalg.norm(away, axis=0), 1)
    inside = frame.gbuffer.covered & (cosine > math.cos(math.radians(24))) & (x[1] < 1e-3) & (x[0] < 0.95)
    expected = np.zeros(x.shape)
    intensity = np.multiply((0.8, 0.7, 0.6), light.intensity)
    for row, column in np.argwhere(inside):
        point = x[:, row, column].astype(float)
        expected[:, row, column] = naive.of_point_light(intensity, image, receiver, (0.5,) * 3, point,
                                                        np.array([0.0, 1.0, 0.0]), room.camera.eye)
    return inside, expected


@pytest.mark.slow("40.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("receiver", [2.0, 40.0, 1e3])
def test_a_mirror_is_an_image_of_the_light_for_a_lobe_too(receiver, evidence):
    """Photons on a Phong floor: f_s I <n.w> / D^2 of the light's image, at every pixel."""
    room, light = mirror_room(1e8, receiver)
    frame = Frame(room, width=24, height=24)
    result = trace_lobes(frame, TruthSettings(samples=24 * 10, photons=1 << 16))
    inside, expected = of_image(room, light, receiver, frame)
    got, want = result.mean[:, inside].sum(), expected[:, inside].sum()
    sigma = math.sqrt(result.variance_of_mean[:, inside].sum()) / want
    evidence(f"P = {receiver:g} before a mirror: {got / want:.4f} of the closed form (standard error {sigma:.4f})")
    assert abs(got / want - 1) < FOOTPRINT + SIGMAS * sigma
    assert sigma < 0.02


@pytest.mark.slow
@pytest.mark.feature("REF-26")
def test_what_the_footprint_of_pixels_adds_falls_with_their_area(evidence):
    """A highlight of P = 1000 before a mirror, by photons, in pixels of a third of the side."""
    off = {}
    for size, passes in ((24, 40), (72, 24)):
        room, light = mirror_room(1e8, 1e3)
        frame = Frame(room, width=size, height=size)
        result = trace_lobes(frame, TruthSettings(samples=24 * passes, photons=1 << 16))
        inside, expected = of_image(room, light, 1e3, frame)
        sigma = math.sqrt(result.picture_variance[1]) / result.picture_mean[1]  # next to nothing lies outside
        off[size] = result.mean[1, inside].sum() / expected[1, inside].sum() - 1, sigma
    evidence(", ".join(f"{size} pixels: {off[size][0]:+.4f} (standard error {off[size][1]:.4f})" for size in off))
    for size, (value, sigma) in off.items():
        assert sigma < FOOTPRINT / 8
        assert abs(value) < FOOTPRINT * (24 / size) ** 2 + SIGMAS * sigma


@pytest.mark.slow("2.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("receiver", [2.0, 1e3])
def test_few_photons_are_as_true_as_many_and_say_how_far_off_they_are(receiver, evidence):
    """Runs of 8 passes of 1024 photons: their mean is the closed form, their spread what they state."""
    from scipy.stats import f as fisher

    room, light = mirror_room(1e8, receiver)
    frame, seeds, passes = Frame(room, width=24, height=24), 20, 8
    settings = TruthSettings(samples=24 * passes, photons=1 << 10, **FEW_RAYS)
    runs = [trace_lobes(frame, dataclasses.replace(settings, seed=seed)) for seed in range(seeds)]
    inside, expected = of_image(room, light, receiver, frame)
    ratio = np.array([run.mean[:, inside].sum() for run in runs]) / expected[:, inside].sum()
    sigma = ratio.std(ddof=1) / math.sqrt(seeds)
    # one channel: a photon's path does not depend on its colour
    spread = np.var([run.picture_mean[0] for run in runs], ddof=1) / np.mean([run.picture_variance[0] for run in runs])
    evidence(f"P = {receiver:g}, 1024 photons: {ratio.mean():.4f} of the closed form (standard error {sigma:.4f}); "
             f"variance over seeds is {spread:.2f} of what is stated")
    assert abs(ratio.mean() - 1) < FOOTPRINT + SIGMAS * sigma
    low, high = fisher.ppf([CERTAIN, 1 - CERTAIN], seeds - 1, seeds * (passes - 1))
    assert low < spread < high


@pytest.mark.feature("REF-26")
@pytest.mark.slow("40.0", "30000.0")
@pytest.mark.parametrize("receiver", [40.0, 7490.0, 7510.0, 3e4, 1e6])
def test_photons_and_directions_share_out_sharp_senders(receiver, evidence):
    """Around the exponent where directions take over from photons (a quarter of the sender's) no light is lost."""
    settings = TruthSettings(samples=24 * 12, photons=1 << 16, **FEW_RAYS)
    # the camera looks at the highlight alone, which is some pixels wide; lobes just below 3e4 are not left to photons
    camera = Camera((-1.2, 1.4, 0.2), (2 / 3, 0.0, 1 / 12), vfov=min(0.7, 6 / math.sqrt(receiver)))
    sharp, other = (trace_lobes(Frame(dataclasses.replace(mirror_room(sender, receiver)[0], camera=camera), width=24,
                                      height=24), settings) for sender in (3e4, 29990.0))
    difference = (sharp.picture_mean - other.picture_mean) / other.picture_mean
    sigma = np.sqrt(sharp.picture_variance + other.picture_variance) / other.picture_mean
    evidence(f"P = {receiver:g}: {np.abs(difference).max():.4f} apart, standard error {sigma.max():.4f}")
    assert (np.abs(difference) < SIGMAS * sigma + 0.02).all()  # footprints of pixels
    assert sigma.max() < 0.1


def test_photons_that_can_count_for_nobody_are_left_out():
    from refgi.skips import without_skip

    room, _ = mirror_room(1e5, 1e5)
    settings = TruthSettings(samples=24 * 3, photons=1 << 10)
    frame = Frame(room, width=12, height=12)
    task = task_of_lobes(frame, settings)
    assert task.caustics is None
    assert task_of_lobes(Frame(mirror_room(1e5, 1e4)[0], width=12, height=12), settings).caustics is not None
    with without_skip("truth.photons"):
        assert task_of_lobes(frame, settings).caustics is not None
        again = trace_lobes(frame, settings)
    assert np.array_equal(again.mean, trace_lobes(frame, settings).mean)


def task_of_lobes(frame, settings):
    from refgi.truth.lobe_cells import glossy_triangles

    buffer = frame.gbuffer
    glossy = glossy_triangles(frame.scene, buffer.position, buffer.normal, buffer.triangle_id)
    return _with_lobes(frame.scene, frame.tracer, buffer.position, buffer.normal, glossy, settings)


@pytest.mark.slow("900.0")
@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("exponent", [0.0, 900.0])
def test_without_visibility_the_sum_over_every_texel(exponent, evidence):
    from refgi.lights import choose_pixel_lights
    from refgi.pairs.settings import PairSettings
    from refgi.settings import replaced

    frame = Frame(glossy_box(exponent), width=16, height=16, rsm_resolution=128)
    lights = choose_pixel_lights(frame.rsms, count=None, pattern="all")
    expected = naive.of_lights(frame, lights, replaced(PairSettings(), {"clamp": "none"}))
    result = trace_lobes(frame, TruthSettings(samples=24 * 40, visibility=False, **FEW_RAYS))
    ratio = expected.sum(axis=(1, 2)) / result.mean.sum(axis=(1, 2))
    sigma = np.sqrt(result.picture_variance) / result.picture_mean
    evidence(f"P = {exponent:g}: the sum is {ratio.mean():.4f} of the truth's (standard error {sigma.max():.4f})")
    assert (np.abs(ratio - 1) < 3 * sigma + 0.03).all()  # edges of light in a map of 128 texels


def test_of_what_the_camera_sees_alone_a_mirror_of_the_unseen_is_black():
    """A mirroring floor that shows the wall behind the eye: black where only visible surfaces emit."""
    lobe, wall = Material("lobe", (0.0,) * 3, (0.9,) * 3, 1e5), Material("wall", (0.6,) * 3)
    light = PointLight((0.0, 1.5, 0.0), (1.0,) * 3)
    room = scene([rectangle((-1, 0, 3), (2, 0, 0), (0, 0, -6), lobe), rectangle((-1, 0, 3), (2, 0, 0), (0, 2, 0), wall),
                  rectangle((-1, 0, -3), (2, 0, 0), (0, 2, 0), wall)], light)
    down = Camera((0.0, 1.0, 0.5), (0.0, 0.0, 0.6), vfov=math.radians(20))  # sees the floor alone, from above
    ahead = Camera((0.0, 0.5, 2.0), (0.0, 0.4, -3.0), vfov=math.radians(50))  # sees floor and far wall
    for camera, black in ((down, True), (ahead, False)):
        frame = Frame(dataclasses.replace(room, camera=camera), width=16, height=16)
        every, visible = (trace_lobes(frame, TruthSettings(samples=96, emitters=kind)) for kind in ("all", "visible"))
        assert (visible.mean <= every.mean + 4 * (every.standard_error + visible.standard_error) + 1e-12).all()
        assert every.picture_mean.min() >= 0
        if black:
            assert visible.picture_mean.max() == 0
        else:
            assert visible.picture_mean.max() > 0.3 * every.picture_mean.max()


@pytest.mark.feature("REF-26")
@pytest.mark.parametrize("exponent", [2.0, 1e4])
def test_bounces_are_a_geometric_series(exponent, evidence):
    from tests.naive.truth import truncated_series

    results, radiance = in_sphere(exponent, TruthSettings(samples=24 * 16, bounces=3, **FEW_RAYS), angles=(30.0,))
    expected = naive.tilted_albedo(exponent, math.radians(30)) * radiance * truncated_series(0.5, 3) / 0.5
    ratio = results[0].picture_mean / expected
    sigma = np.sqrt(results[0].picture_variance) / expected
    evidence(f"P = {exponent:g}, three bounces: {ratio.mean():.4f} of the series (standard error {sigma.max():.4f})")
    assert (np.abs(ratio - 1) < 2 * FACETS + SIGMAS * sigma).all()


def test_bits_depend_on_the_seed_alone():
    from refgi import jit

    frame = Frame(glossy_box(60.0), width=16, height=16)
    settings = TruthSettings(samples=48)
    whole = trace_lobes(frame, settings)
    assert np.array_equal(whole.mean, trace_lobes(frame, dataclasses.replace(settings, batch=500)).mean)
    assert not np.array_equal(whole.mean, trace_lobes(frame, dataclasses.replace(settings, seed=1)).mean)
    with jit.threads(1):
        assert np.array_equal(whole.mean, trace_lobes(frame, settings).mean)
    assert (whole.mean[:, whole.samples == 0] == 0).all()
    assert ((whole.samples > 0) == naive_mask(frame)).all()


def naive_mask(frame):
    mask = np.zeros((frame.height, frame.width), bool)
    mask[naive.glossy_pixels(frame)[0]] = True
    return mask


def test_a_checkpoint_of_its_own(tmp_path):
    frame = Frame(glossy_box(60.0), width=12, height=12)
    whole = trace_lobes(frame, TruthSettings(samples=24 * 4))
    for place in (tmp_path / "one.truth", tmp_path):
        settings = TruthSettings(samples=24 * 2, checkpoint=place)
        trace_truth(frame, settings)
        trace_lobes(frame, settings)
        names = {path.name for path in tmp_path.iterdir()}
        assert len(names) == (2 if place.suffix else 4)
        again = trace_lobes(frame, dataclasses.replace(settings, samples=24 * 4))
        assert np.array_equal(again.mean, whole.mean)
    assert {"one.truth", "one.truth.lobes"} < names


def test_the_picture_has_lobes_with_their_error():
    picture = render(glossy_box(30.0), "truth", TruthSettings(samples=48), width=16, height=16)
    assert picture.lobes is not None
    assert picture.lobes.shape == (3, 16, 16)
    assert np.array_equal(picture.lobes, picture.lobe_estimate.mean.astype(np.float32))
    assert picture.lobe_estimate.pixel_error > 0
    frame = picture.frame
    np.testing.assert_allclose(picture.radiance, frame.radiance(picture.irradiance) + picture.lobes, rtol=1e-5)


@pytest.mark.slow("True-0.0", "True-1000000.0", "False-1e+20")
@pytest.mark.parametrize("exponent", [0.0, 1e6, 1e20])
@pytest.mark.parametrize("caustics", [False, True])
def test_no_value_is_lost(exponent, caustics):
    found = load_scene("cornell_sphere:faces=320")
    found = dataclasses.replace(found, materials=tuple(
        dataclasses.replace(m, diffuse=tuple(np.minimum(m.diffuse, 0.5)), specular=(0.5,) * 3, exponent=exponent)
        for m in found.materials))
    for estimator in ("combined", "light"):
        result = trace_lobes(Frame(found, width=24, height=24), TruthSettings(
            samples=48, caustics=caustics, photons=1 << 12, estimator=estimator))
        assert result.lost == 0
        assert np.isfinite(result.mean).all()
        assert result.picture_mean.min() >= 0


def test_a_scene_without_lobes_has_none():
    frame = Frame(load_scene("cornell_box"), width=8, height=8)
    result = trace_lobes(frame, TruthSettings(samples=48))
    assert result.samples.max() == 0
    assert result.mean.max() == 0
