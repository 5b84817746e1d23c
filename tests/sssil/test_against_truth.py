"""The method against path tracing with only what the camera sees as emitters, and against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from refgi.frame import Frame
from refgi.scene import PointLight, load_scene
from refgi.settings import of, replaced
from refgi.sssil.crown import gather
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import PRESETS, HssilSettings
from refgi.sssil.view import Level
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.truth import accumulate
from tests.form_factors import polygon_form_factor
from tests.truth.scenes import corner_room

SIGMAS = 5.0  # Student's t of 8 passes
FEW_PASSES = {"emitters": "visible", "picks": 64, "directions": 32, "light_grid": 64, "samples": 8 * 96}
LAMP = PointLight((0.2, 1.1, 0.3), (0.6, 0.5, 0.4))
VIEW = {"eye": (1.7, 1.4, 1.5), "target": (-0.4, 0.35, -0.5), "vfov": math.radians(60)}


def everything(**others):
    """Return settings with which every pixel lights every pixel."""
    return of(HssilSettings, radius=None, levels=1, start="full", pattern="all", **others)


def room(size, blocker):
    return Frame(corner_room(LAMP, blocker=blocker).with_camera(**VIEW), width=size, height=size, shadows="exact")


# Eq. 3 is the midpoint rule of the integral over what is seen: it errs by pixels next to each other in the corners and,
# with the plate, by those that edges of shadows cross. Both shrink as one over the pixels along a side;
# the first is 1.2 over them here.
FIRST_ORDER = 1.5
SIZES = {"none": (16, 32, 64), "rays": (16, 32)}  # a ray for each pair: the fourth power of the size


@pytest.mark.slow("True-none")
@pytest.mark.feature("HSS-03")
@pytest.mark.parametrize("visibility", ["none", "rays"])
@pytest.mark.parametrize("blocker", [False, True])
def test_every_pixel_lights_every_pixel(visibility, blocker, evidence):
    """Equal to the truth of seen emitters, without visibility or, a ray for each pair, with it."""
    figures = []
    for size in SIZES[visibility]:
        frame = room(size, blocker)
        light = hssil(frame, everything(form_factor="point", visibility=visibility))
        traced = trace_truth(frame, TruthSettings(visibility=visibility == "rays", **FEW_PASSES))
        covered = frame.gbuffer.covered
        off = np.abs(light[:, covered].mean(axis=1, dtype=float) / traced.picture_mean - 1).max()
        sigma = (np.sqrt(traced.picture_variance) / traced.picture_mean).max()
        typical = np.median(np.abs(light - traced.mean)[:, covered] / traced.picture_mean[:, None])
        figures.append(f"{off:.2%} at {size}^2 (truth's error {sigma:.2%}, median pixel {typical:.2%})")
        assert off < FIRST_ORDER / size + SIGMAS * sigma
        assert typical < FIRST_ORDER / size
    evidence(f"{'with' if blocker else 'without'} a plate, visibility {visibility}: mean off by {', '.join(figures)}")


SPHERE, FACES = 3e-3, 200_000  # midpoint rule at 32 x 32 pixels, own pixel left out (1e-3), facets


@pytest.mark.feature("HSS-03")
@pytest.mark.filterwarnings("ignore:radius")
def test_the_part_of_a_sphere_that_is_seen(evidence):
    """E = L A / (4 R^2) everywhere: cos cos / r^2 is 1 / (4 R^2) for all pairs, A is seen, L = rho I / (pi R^2)."""
    found, size, tangent = load_scene(f"integrating_sphere:faces={FACES},albedo=0.5"), 32, math.tan(math.radians(40))
    eye, light = (0.1, -0.3, 0.2), PointLight((0.0, 0.0, 0.0), (0.8, 1.6, 0.4))
    lit = found.with_lights(light).with_camera(eye=eye, target=(0.1, -0.3, -1.0), vfov=2 * math.atan(tangent))
    frame = Frame(lit, width=size, height=size, shadows="exact")

    def area(v, u):  # of the sphere behind a point of the image plane at distance 1
        ray = np.array([u, v, -1.0]) / math.sqrt(1 + u * u + v * v)
        far = -(ray @ eye) + math.sqrt((ray @ eye) ** 2 + 1 - np.dot(eye, eye))
        return far**2 / (ray @ (np.array(eye) + far * ray)) * (1 + u * u + v * v) ** -1.5

    seen, _ = dblquad(area, -tangent, tangent, -tangent, tangent, epsabs=1e-6)
    expected = 0.5 * np.array(light.intensity) / math.pi * seen / 4
    ratio = hssil(frame, everything(form_factor="point")) / expected[:, None, None]
    disc = hssil(frame, everything()) / expected[:, None, None]
    evidence(f"mean of E / (L A / 4 R^2) {ratio.mean():.5f}, pixels {ratio.min():.4f} to {ratio.max():.4f}; "
             f"Eq. 4 {disc.mean():.4f}")
    assert np.abs(ratio - 1).max() < SPHERE
    assert 0.97 < disc.mean() < 1


# Points at height 1 over a plane of constant radiance that is seen in squares of side s: E over its true value with
# Eq. 3 and Eq. 4, mean and spread over where the points are. By a sum over an endless plane, apart from this code.
DARKENING = {2.0: (0.983, 0.230, 0.699, 0.074), 1.0: (0.998, 0.013, 0.893, 0.006), 0.5: (1.0, 0.0, 0.970, 0.0),
             0.25: (1.0, 0.0, 0.992, 0.0), 0.1: (1.0, 0.0, 0.999, 0.0)}
ROUNDED = 0.002  # the figures have three digits; the plane ends
SCATTER = 0.1  # of the spread, as a spread of 200 points is found again


@pytest.mark.feature("HSS-04")
@pytest.mark.parametrize("side", DARKENING)
def test_a_disc_is_darker_than_a_point(side, evidence):
    count, rows = (56, 2) if side == 0.1 else (40, 5 if side < 1 else 10)
    level, expected = over_a_plane(side, count, rows)
    found = {}
    for form in ("point", "disc"):
        ratio = gather(level, 0, everything(form_factor=form))[0, count:] / expected
        found[form] = (ratio.mean(), ratio.std())
    evidence(f"squares of {side:g} heights: Eq. 3 {found['point'][0]:.3f} +- {found['point'][1]:.3f}, "
             f"Eq. 4 {found['disc'][0]:.3f} +- {found['disc'][1]:.3f}")
    point, point_spread, disc, disc_spread = DARKENING[side]
    for (mean, spread), (true_mean, true_spread) in zip(found.values(), ((point, point_spread), (disc, disc_spread)),
                                                        strict=True):
        assert abs(mean - true_mean) < ROUNDED + SCATTER * true_spread
        assert abs(spread - true_spread) < ROUNDED + 3 * SCATTER * true_spread


def over_a_plane(side, count, rows):
    """Return a level of a plane's squares with rows of points above it, and what those receive."""
    random, end = np.random.default_rng(3), count * side / 2
    shape = (count + rows, count)
    position, normal, area = np.zeros((3, *shape)), np.zeros((3, *shape)), np.zeros(shape)
    position[0, :count], position[2, :count] = np.meshgrid(*[(np.arange(count) + 0.5) * side - end] * 2)
    position[::2, count:] = random.uniform(-side / 2, side / 2, (2, rows, count))
    position[1, count:], normal[1, count:], normal[1, :count], area[:count] = 1, -1, 1, side * side
    corners = [(-end, 0, end), (end, 0, end), (end, 0, -end), (-end, 0, -end)]
    factors = [polygon_form_factor(point, (0, -1, 0), corners) for point in position[:, count:].reshape(3, -1).T]
    level = Level(0, position, np.ones(shape), normal, np.ones((3, *shape)), area, np.arange(area.size).reshape(shape))
    return level, math.pi * np.reshape(factors, (rows, count))


@pytest.mark.feature("HSS-04")
@pytest.mark.filterwarnings("ignore:radius")
def test_a_disc_has_no_spikes(evidence):
    """64 samples of a crown and its disc, each for many texels: what they scatter about the sum of all texels."""
    frame, variance, spike, mean = room(64, False), {}, {}, {}
    covered = frame.gbuffer.covered
    for form in ("point", "disc"):
        settings = replaced(PRESETS["paper"], {"levels": 1, "start": "full", "form_factor": form})
        whole = hssil(frame, replaced(settings, {"pattern": "all"}))[1, covered].mean()
        runs = np.stack([hssil(frame, replaced(settings, {"pattern": "pixel", "seed": seed}))[1, covered]
                         for seed in range(4)])
        variance[form] = float(runs.var(axis=0, ddof=1).mean() / whole**2)
        spike[form], mean[form] = float(runs.max() / whole), float(runs.mean() / whole - 1)
    evidence(f"Eq. 3: variance {variance['point']:.2f} of the mean squared, largest pixel {spike['point']:.0f} means, "
             f"bias {mean['point']:+.1%}; Eq. 4: {variance['disc']:.3f}, {spike['disc']:.1f}, {mean['disc']:+.1%}; "
             f"ratio {variance['point'] / variance['disc']:.0f}")
    assert variance["point"] > 5 * variance["disc"]
    assert spike["point"] > 3 * spike["disc"]
    assert abs(mean["point"]) < 5 * math.sqrt(variance["point"] / covered.sum() / 4)  # Eq. 3 is right on average
    assert -0.2 < mean["disc"] < -0.02  # Eq. 4 is not


# Fig. 5 at half its size: 360^2 for 720^2, a radius of 20 for 40.
FIGURE_5, SEEDS = 360, 24
# Of the line's mean, with every texel of every crown and averages: first order in 360 pixels (0.004) and as much where
# edges of direct shadow cross texels of eight pixels, which see one of their pixels' normals.
LEVELS = 0.013
# The closest of four grows what is in front: by what it brightens every texel's line, it may brighten the samples'.
# A mean of 24 seeds is known to a 24^1/2-th of a seed's own spread; three of those.
SPREADS = 3.0
DARKER = (0.93, 0.99)  # Eq. 4 with 64 samples over Eq. 3: each stands for 59 texels of its disc or crown (HSS-04)


@pytest.mark.feature("HSS-18")
@pytest.mark.filterwarnings("ignore:radius")
def test_the_line_of_figure_5(evidence):
    """The line is the truth of seen emitters but for samples' noise and the closest of four, both of them measured."""
    frame = Frame(load_scene("cornell_box"), width=FIGURE_5, height=FIGURE_5, shadows="exact")
    row = int(0.72 * FIGURE_5)
    truth, error = traced_row(frame, row, visibility=False)
    asked = np.isfinite(truth[0])
    mean = truth[:, asked].mean()
    right, error, shadowed = (one[:, asked] / mean for one in (truth, error, next(traced_row(frame, row))))

    def line(**settings):
        published = PRESETS["paper"]
        light = hssil(frame, replaced(published, {"start": "full", "radius": FIGURE_5 / 18} | settings))
        return light[:, row, asked].astype(float) / mean

    closest, average = (line(pattern="all", downsample=mode) for mode in ("closest", "average"))
    lines = {form: np.stack([line(form_factor=form, seed=seed) for seed in range(SEEDS)]) for form in ("point", "disc")}
    drawn = lines["point"].mean(axis=0)
    spread = lines["point"].mean(axis=(1, 2)).std(ddof=1) / math.sqrt(SEEDS)
    noise = math.sqrt(lines["point"].var(axis=0, ddof=1).mean())
    grown, darker = closest.mean() - average.mean(), lines["disc"].mean() / drawn.mean()

    def off(one):
        return math.sqrt(np.mean((one - right) ** 2))

    evidence(f"mean of the line over that of seen emitters without visibility: every texel of four levels "
             f"{average.mean():.4f} by averages, {closest.mean():.4f} by the closest of four; 64 samples, {SEEDS} "
             f"seeds, {drawn.mean():.4f} +- {spread:.4f} with Eq. 3, {darker:.3f} of that with Eq. 4. Rms "
             f"{off(average):.3f}, {off(closest):.3f}, {off(drawn):.3f}; a seed's noise {noise:.3f}, the truth's "
             f"{error.mean():.3f}; the truth with visibility {off(shadowed):.3f}")
    assert average.mean() == pytest.approx(1, abs=LEVELS)
    assert 0 < grown < 0.04
    assert drawn.mean() == pytest.approx(1 + grown, abs=LEVELS + SPREADS * spread)
    assert DARKER[0] < darker < DARKER[1]
    assert off(drawn) < math.hypot(off(closest), SPREADS * noise / math.sqrt(SEEDS))
    # converges to the one, not to the other
    assert max(off(one) for form in lines.values() for one in form) < off(shadowed) / 1.5


def traced_row(frame, row, **settings):
    """Return the truth of seen emitters and its standard error in every third pixel of a row, else NaN: (3, w)."""
    buffer = frame.gbuffer
    asked = np.full(buffer.triangle_id.shape, -1, np.int32)
    asked[row, ::3] = buffer.triangle_id[row, ::3]
    result = accumulate(frame.scene, frame.tracer, buffer.position, buffer.normal, asked,
                        TruthSettings(**FEW_PASSES, **settings))
    return (np.where(asked[row] < 0, np.nan, line[:, row]) for line in (result.mean, result.standard_error))
