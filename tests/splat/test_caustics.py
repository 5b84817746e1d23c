"""Caustics of pixel lights: a round mirror's nephroid and a glass ball's focus, against closed forms and tracing."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.rsm import choose_pixel_lights, reflective_shadow_map
from refgi.rsm.importance import importance
from refgi.rsm.refraction import refracted
from refgi.rsm.warp import Warp
from refgi.scene import Camera, DirectionalLight, Material, Scene, load_scene, material_table, merge
from refgi.scene.builtin.surfaces import patch, rectangle, sphere
from refgi.splat.irradiance import Receivers, irradiance
from refgi.splat.pixel_area import pixel_areas
from refgi.splat.settings import PairSettings
from refgi.truth import TruthSettings, trace_truth
from tests.naive import nephroid
from tests.naive.refraction import through_ball

R, HEIGHT = 0.1, 0.14  # m; the wall is high enough for the ray that crosses the axis at the mirror's foot
EXPONENT = 2000.0  # polished metal, as in the built-in ring
FALL = DirectionalLight((1.0, -1.0, 0.0), (math.sqrt(2),) * 3)  # 1 W/m^2 on the floor
CUSP = 0.006  # R: where a line through 1 / E meets zero; blurred by 0.016 R, E bends away from it by that much
SPREAD = 1 / math.sqrt(EXPONENT)  # standard deviation of a narrow Phong lobe, rad
SEEDS = 0.02  # R: four seeds of 4096 lights; one alone finds the cusp to 0.014 R
PUBLISHED = Warp("B", 3)  # SII Table 1: 4096 lights, 3 levels, method B


@cache
def half_ring(exponent=EXPONENT, columns=256):
    turn = np.linspace(-math.pi / 2, math.pi / 2, columns + 1)
    hollow = np.stack([-np.cos(turn), 0 * turn, -np.sin(turn)], axis=-1)
    low = R * -hollow
    metal = Material("metal", (0, 0, 0), (1, 1, 1), exponent)
    wall = patch(np.stack([low, low + np.array([0, HEIGHT, 0])]), metal, "wall")
    wall = dataclasses.replace(wall, normals=np.concatenate([hollow, hollow]))
    floor = rectangle((-0.15, 0, 0.2), (0.35, 0, 0), (0, 0, -0.4), Material("floor", (0, 0, 0)), "floor")
    geometry, materials = merge([floor, wall], smooth=True)
    return Scene("half ring", geometry, materials, Camera((0, 1, 0.1), (0, 0, 0)), (FALL,))


def ring_lights(count=4096, exponent=EXPONENT, resolution=512, seed=0):
    scene = half_ring(exponent)
    rsm = reflective_shadow_map(scene.geometry, material_table(scene.materials), FALL, resolution)
    if count is None:
        return choose_pixel_lights([rsm], count=None, pattern="all")
    return choose_pixel_lights([rsm], count=count, pattern="halton", seed=seed, warp=PUBLISHED,
                               importance=[importance(rsm, "peak")])


def on_floor(lights, x, z, height=0.0, **settings):
    """Return the irradiance (first channel) at points (x, height, z) that look up."""
    x, z = np.broadcast_arrays(x, z)
    position = np.stack([x, np.full(x.shape, height), z]).astype(np.float32)
    normal = np.zeros_like(position)
    normal[1] = 1
    shape = (3, -1, x.shape[-1])
    covered = np.ones(x.shape, np.bool_).reshape(shape[1:])
    return irradiance(Receivers(position.reshape(shape), normal.reshape(shape), covered), lights,
                      PairSettings(**settings))[0].reshape(x.shape)


@pytest.mark.feature("SII-08")
def test_the_cusp_lies_where_the_nephroid_has_it(evidence):
    x = np.linspace(0.15, 0.4, 26) * R  # before the cusp a single ray arrives and 1 / E = 1 - 2 x / R
    found = []
    for lights in (ring_lights(None), *(ring_lights(seed=seed) for seed in range(4))):
        slope, start = np.polyfit(x, 1 / on_floor(lights, x, np.zeros(1)), 1)
        found.append(-start / slope / R)
    evidence(f"cusp at {found[0]:.4f} R from all texels, {np.mean(found[1:]):.4f} R (spread {np.std(found[1:]):.4f}) "
             "from 4096 lights, 3 levels of method B; nephroid: 0.5 R")
    assert found[0] == pytest.approx(0.5, abs=CUSP)
    assert np.mean(found[1:]) == pytest.approx(0.5, abs=SEEDS)


@pytest.mark.feature("SII-08")
def test_irradiance_behind_the_cusp_is_that_of_a_perfect_mirror(evidence):
    x = np.concatenate([np.linspace(0.2, 0.4, 9), np.linspace(0.65, 0.85, 9)]) * R
    expected = nephroid.irradiance_on_axis(x, R, 1.0)
    error = np.abs(on_floor(ring_lights(None, resolution=1024), x, np.zeros(1)) / expected - 1)
    evidence(f"on the axis, a tenth of R and more from the cusp: within {error.max():.1%} of the closed form")
    assert error.max() < 0.04  # what the lobe's blur adds: E'' s^2 / 2, s = 0.016 R


@pytest.mark.feature("SII-08")
def test_the_branches_of_the_cusp_are_as_far_apart_as_the_nephroids(evidence):
    azimuth = np.linspace(0, math.pi / 4, 4001)
    z = np.linspace(0, 0.3, 301) * R
    gaps = []
    for at in (0.6, 0.65):
        closed = np.interp(at * R, *nephroid.caustic(azimuth, R)) / R
        for exponent in (EXPONENT, 10 * EXPONENT):
            ridge = z[on_floor(ring_lights(None, exponent, 1024), at * R * np.ones(1), z).argmax()] / R
            # a fold blurred by s is brightest about s inside; here s is the lobe's width over a way of R / sqrt(2)
            assert closed - 1.5 / math.sqrt(2 * exponent) * math.sqrt(2) < ridge < closed
            gaps.append(f"{ridge:.3f}")
        gaps.append(f"closed form {closed:.3f}")
    evidence(f"half width at 0.6 R and 0.65 R, R: exponents 2000 and 20,000: {', '.join(gaps)}")


@pytest.mark.feature("SII-08")
def test_the_published_lights_draw_the_traced_caustic(evidence):
    landed, flux = nephroid.trace(4_000_000, R, HEIGHT, EXPONENT, 1.0, seed=3)
    cell, figures = 0.02 * R, []
    for name, along, across, span in (("axis", 0, 1, (0.3, 0.7)), ("across", 1, 0, (-0.25, 0.25))):
        middle = 0.0 if name == "axis" else 0.6 * R
        edges = np.arange(span[0] * R, span[1] * R, cell)
        near = np.abs(landed[:, across] - middle) < cell / 2
        traced = np.histogram(landed[near, along], edges)[0] * flux / cell**2
        places = [(edges[:-1] + share * cell)[:, None] for share in (1 / 6, 1 / 2, 5 / 6)]
        sides = middle + np.array([-1, 0, 1]) * cell / 3
        means = [on_floor(ring_lights(), *((p, sides) if along == 0 else (sides, p))).mean(axis=1) for p in places]
        lit = np.mean(means, axis=0)
        error = math.sqrt(np.mean((lit - traced) ** 2) / np.mean(traced**2))
        widths = [np.count_nonzero(profile > profile.max() / 2) * cell / R for profile in (lit, traced)]
        places = [edges[profile.argmax()] / R + 0.01 for profile in (lit, traced)]
        figures.append(f"{name}: RMSE {error:.1%}, peak at {places[0]:.2f} (traced {places[1]:.2f}) R, "
                       f"width {widths[0]:.2f} ({widths[1]:.2f}) R, flux {lit.sum() / traced.sum():.3f}")
        assert error < 0.06
        assert abs(places[0] - places[1]) < 0.021 or name == "across"  # one cell; across there are two branches
        assert abs(widths[0] - widths[1]) < 0.041
        assert lit.sum() == pytest.approx(traced.sum(), rel=0.02)
    evidence("; ".join(figures))


@pytest.mark.feature("SII-08")
def test_widening_calms_lights_near_the_floor_and_leaves_the_cusp(evidence):
    lights = ring_lights()
    spot = lights.position - lights.position[1] / lights.lobe_axis[1] * lights.lobe_axis  # where each axis ends
    low = lights.position[1] < 0.05 * R
    x = np.linspace(0.3, 0.7, 81) * R
    spots, cusp = ([on_floor(lights, *where, widening=a) for a in (0.0, 0.03)]
                   for where in ((spot[0, low], spot[2, low]), (x, np.zeros(1))))
    evidence(f"{low.sum()} of 4096 lights lie under R / 20; widened over 3 cm, the mean of their spots falls from "
             f"{spots[0].mean():.0f} to {spots[1].mean():.1f} times the light's irradiance, the largest from "
             f"{spots[0].max():.1e} to {spots[1].max():.0f}; at the cusp {cusp[1].max() / cusp[0].max():.4f} of before")
    assert low.sum() > 50
    assert spots[1].max() < spots[0].max() / 10
    assert spots[1].mean() < spots[0].mean() / 5
    assert np.abs(cusp[1] - cusp[0]).max() < 0.02 * cusp[0].max()


INDEX, BALL = 1.5, 0.1
GLASS = Material("glass", (0, 0, 0), ior=INDEX)
DOWN = DirectionalLight((0.0, -1.0, 0.0), (1.0, 1.0, 1.0))
FOCUS = {"back_face": BALL / (INDEX - 1), "two_interface": BALL * (2 - INDEX) / (2 * (INDEX - 1))}  # behind the back
FACETS = 2e-3  # of R / (n - 1): a ball of 80,000 faces has normals to 4e-5, over bends of 0.05
PATTERN = 4e-3  # of the focus, from 65 x 65 receivers at seven depths


@cache
def ball_map(mode, exponent=1e5, index=INDEX):
    glass = dataclasses.replace(GLASS, ior=index)
    geometry, materials = merge([sphere((0, 0, 0), BALL, 80_000, glass, "ball")], smooth=True)
    table = material_table(materials)
    rsm = reflective_shadow_map(geometry, table, DOWN, 512, np.float64)
    return refracted(rsm, geometry, table, mode, exponent, tracer=Tracer(geometry) if mode != "back_face" else None)


def within(rsm, aperture):
    """Return the texels that send on rays of heights up to `aperture` (m) over the axis, as a mask."""
    height, width = rsm.depth.shape
    (row, column), half = np.indices((height, width)), rsm.projection.half
    u = ((column + 0.5) * 2 / width - 1) * half[0]
    v = ((row + 0.5) * 2 / height - 1) * half[1]
    return (np.hypot(u, v) < aperture) & rsm.lobe_flux.any(axis=0)


def closest_approach(rsm, aperture):
    """Return the depth below the ball's back of the point nearest to all axes (least squares)."""
    kept = within(rsm, aperture)
    place, axis = rsm.position[:, kept], rsm.lobe_axis[:, kept]
    across = np.eye(3)[:, :, None] - axis[:, None] * axis[None]
    point = np.linalg.solve(across.sum(axis=2), np.einsum("abn,bn->a", across, place))
    assert np.hypot(point[0], point[2]) < 1e-3 * BALL
    return -BALL - point[1]


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("index", [1.3, 1.5, 1.8])
@pytest.mark.parametrize("mode", FOCUS)
def test_axes_meet_at_the_paraxial_focus(mode, index, evidence):
    focus = BALL / (index - 1) if mode == "back_face" else BALL * (2 - index) / (2 * (index - 1))
    rsm = ball_map(mode, index=index)
    wide, narrow = closest_approach(rsm, 0.2 * BALL), closest_approach(rsm, 0.1 * BALL)
    found = (4 * narrow - wide) / 3  # the spherical aberration grows as h^2
    evidence(f"{mode}, n = {index}: axes meet {found / BALL:.4f} R behind the ball (closed form {focus / BALL:.4f})")
    assert found == pytest.approx(focus, abs=FACETS * BALL / (index - 1))
    assert wide < narrow < focus * (1 + FACETS) + FACETS * BALL  # rays farther out meet nearer to the ball


def on_plane(rsm, aperture, depth, half, cells=65):
    """Return the irradiance on a plane `depth` below the ball's back, and the squared distances from the axis."""
    kept = within(rsm, aperture)
    lights = choose_pixel_lights([rsm._replace(lobe_flux=rsm.lobe_flux * kept)], count=None, pattern="all")
    side = (np.arange(cells) - cells // 2) * half / (cells // 2)
    return on_floor(lights, *np.meshgrid(side, side), height=-BALL - depth), np.add.outer(side**2, side**2)


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", FOCUS)
def test_the_pattern_on_a_plane_is_smallest_at_the_focus(mode, evidence):
    aperture, exponent, focus = 0.15 * BALL, 1e5, FOCUS[mode]
    depths, squares = np.linspace(0.7, 1.3, 7) * focus, []
    for depth in depths:
        lit, square = on_plane(ball_map(mode, exponent), aperture, depth, 1.2 * aperture)
        squares.append((lit * square).sum() / lit.sum())
    curve = np.polyfit(depths, squares, 2)
    found = -curve[1] / (2 * curve[0])
    twins = [ray_square(mode, aperture, depth) + 2 * depth**2 / exponent for depth in depths]
    traced = np.polyfit(depths, twins, 2)
    expected = -traced[1] / (2 * traced[0])
    evidence(f"{mode}: smallest pattern {found / BALL:.4f} R behind the ball (rays: {expected / BALL:.4f}; paraxial "
             f"{focus / BALL:.4f})")
    assert found == pytest.approx(expected, rel=PATTERN)
    assert found == pytest.approx(focus, rel=0.04)  # aberration and the lobes' width pull it towards the ball


def ray_square(mode, aperture, depth, count=200):
    """Return the mean squared distance from the axis of the twin's rays on a plane."""
    total = weight = 0.0
    for height in np.sqrt((np.arange(count) + 0.5) / count) * aperture:
        leave, _, out, share = through_ball(np.array([height, 1.0, 0.0]), np.array([0.0, -1.0, 0.0]), np.zeros(3),
                                            BALL, INDEX, front=mode == "two_interface")
        way = (leave[1] + BALL + depth) / -out[1]
        total, weight = total + share * (leave[0] + way * out[0]) ** 2, weight + share
    return total / weight


class Picture:
    """A small picture whose pixels hold means over their footprints, as the truth's do."""

    def __init__(self, source, width=96, height=72, inside=4):
        self.frame = Frame(load_scene(source), width=width, height=height)
        fine = Frame(self.frame.scene, width=inside * width, height=inside * height)
        self._receivers = Receivers(fine.gbuffer.position, fine.gbuffer.normal, fine.gbuffer.covered)
        self._areas = pixel_areas(fine.gbuffer, fine.scene.geometry)
        self._blocks = (height, inside, width, inside)
        self.area, self.position = self._sum(self._areas), self.frame.gbuffer.position

    def _sum(self, values):
        return values.reshape(self._blocks).sum(axis=(1, 3))

    def lit_by(self, lights):
        lit = irradiance(self._receivers, lights, PairSettings())[0]
        return self._sum(lit * self._areas) / np.maximum(self.area, 1e-30)

    def truth(self):
        settings = TruthSettings(samples=2 * 8, picks=1, directions=1, caustics=True, photons=1 << 18)
        result = trace_truth(self.frame, settings)
        return result.mean[0], np.sqrt(result.variance_of_mean[0])

    def place(self, lit, mask):
        """Return the centre of the flux on a part of the floor: x and z, m."""
        weight = (lit * self.area)[mask]
        return np.array([(weight * self.position[k][mask]).sum() for k in (0, 2)]) / weight.sum()

    def compare(self, lit, traced, mask):
        """Return relative RMSE, ratio of flux, and distance between the centres, m."""
        error = math.sqrt(((lit - traced)[mask] ** 2).mean() / (traced[mask] ** 2).mean())
        flux = (lit * self.area)[mask].sum() / (traced * self.area)[mask].sum()
        return error, flux, np.linalg.norm(self.place(lit, mask) - self.place(traced, mask))


def published_lights(rsms, count=4096, **importances):
    worth = [importance(rsm, "peak", **importances) for rsm in rsms]
    return choose_pixel_lights(rsms, count=count, pattern="halton", warp=PUBLISHED, importance=worth)


@pytest.mark.feature("SII-08")
def test_the_rings_caustic_lies_where_one_mirror_bounce_has_it(monkeypatch, evidence):
    monkeypatch.setattr("refgi.truth.caustics.LONGEST_CHAIN", 2)  # to the ring, and on to the plate
    picture = Picture("ring")
    place = picture.position
    mask = (place[1] < 1e-4) & (np.hypot(place[0], place[2]) < 0.085)
    traced, noise = picture.truth()
    noise = math.sqrt((noise[mask] ** 2).mean() / (traced[mask] ** 2).mean())
    error, flux, away = picture.compare(picture.lit_by(published_lights(picture.frame.rsms)), traced, mask)
    many = picture.compare(picture.lit_by(published_lights(picture.frame.rsms, 32768)), traced, mask)
    evidence(f"inside the ring, 4096 lights: RMSE {error:.1%}, flux {flux:.3f}, centre {1000 * away:.1f} mm off; "
             f"32,768: {many[0]:.1%}, {many[1]:.3f}, {1000 * many[2]:.1f} mm (noise of the truth {noise:.1%})")
    assert error < 0.4  # too few lights where it is not bright: 1600 of them lie on the ring
    assert many[0] < 0.1
    assert flux == pytest.approx(1, abs=0.05)
    assert many[1] == pytest.approx(1, abs=0.02)
    assert away < 2e-3
    assert many[2] < 1e-3


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("source", ["glass_ball", "glass_sphere.json"])
def test_the_balls_caustic_lies_where_the_truth_has_it(source, data_dir, evidence):
    picture = Picture(source if source == "glass_ball" else data_dir / source)
    frame, place = picture.frame, picture.position
    towards = np.asarray(frame.scene.lights[0].position)[:, None, None] - place
    across = np.cross(towards, np.reshape([0.02, 0.2, 0.05], (3, 1, 1)) - place, axis=0)
    mask = (place[1] < 1e-4) & (np.linalg.norm(across, axis=0) < 0.115 * np.linalg.norm(towards, axis=0))  # its shadow
    traced, _ = picture.truth()
    found = {}
    for mode in ("back_face", "two_interface"):
        glass = [refracted(rsm, frame.scene.geometry, frame.materials, mode, 3000.0, tracer=frame.tracer)
                 for rsm in frame.rsms]
        found[mode] = picture.compare(picture.lit_by(published_lights(glass, defensive=0.1)), traced, mask)
    figures = "; ".join(f"{mode} RMSE {e:.1%}, flux {f:.3f}, centre {1000 * d:.1f} mm off"
                        for mode, (e, f, d) in found.items())
    evidence(f"{source}, 4096 lights, in the ball's shadow: {figures}")
    centre = picture.place(traced, mask)
    assert centre == pytest.approx([-0.0687, -0.0291], abs=2e-3)
    error, flux, away = found["two_interface"]
    assert error < 0.15
    assert flux == pytest.approx(1, abs=0.04)
    assert away < 2e-3
    error, flux, away = found["back_face"]  # the simplification: too long a focus, and half of the light is lost
    assert flux == pytest.approx(0.5, abs=0.05)
    assert away < 5e-3
