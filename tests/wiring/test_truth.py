"""Every setting of `truth`: the mean is that of an independent estimator, heeding the setting shows in rays or bits.

A setting of the estimate changes noise and no mean. So each case asks for the mean, over the picture and over blocks of
8 x 8 pixels, that NumPy finds by itself (`tests/naive/light_tracing`); for other bits than without it; and for as many
rays as the setting says.
"""

import dataclasses
import functools
import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import SpotLight
from refgi.settings import of
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.lobe_cells import lobe_cells
from refgi.truth.surfaces import lights_of, surfaces
from tests.naive import light_tracing
from tests.naive.crossings import face_normals
from tests.truth.scenes import cells_kept
from tests.truth.test_caustics import mirror_over_floor
from tests.wiring.cases import Case, uncovered

SIGMAS = 4.5  # standard errors: one of some 20 means of a few dozen passes lies beyond once in 3,000 runs
RUNS = 8  # truths with seeds of their own
WEIGHING, ROUNDS, SIDE = 4, 12, 14  # estimates by NumPy: for weights and for values; and strata of rays, each way
PILOT_CELLS, PILOT_RECEIVERS, PILOT_PICKS = 64, 2048, 1 << 15  # docs/truth: cells each way, most receivers; their picks
BASE = {"samples": 24 * 3, "light_grid": 12, "interleave": 3}

CASES = {
    "flat": Case({"samples": 24 * 5}),
    "tilted normals": Case({"samples": 24 * 5}, scene="tilted"),
    "two bounces": Case({"bounces": 2}),
    "not blocked": Case({"visibility": False}, scene="tilted"),
    "not blocked, on a smooth ball": Case({"visibility": False}, {"estimator": "light"}, scene="smooth"),
    "not blocked, by directions": Case({"visibility": False}, {"estimator": "hemisphere"}, scene="tilted"),
    "visible emitters": Case({"emitters": "visible"}, scene="close"),
    "visible emitters, by light": Case({"emitters": "visible"}, {"estimator": "light"}, scene="close"),
    "visible emitters, by directions": Case({"emitters": "visible"}, {"estimator": "hemisphere"}, scene="close"),
    "visible emitters, not blocked": Case({"emitters": "visible"}, {"visibility": False}, scene="close"),
    "a seed": Case({"seed": 5}),
    "hemisphere": Case({"estimator": "hemisphere"}, scene="tilted"),
    "light": Case({"estimator": "light"}, scene="tilted"),
    "a coarse grid of light": Case({"light_grid": 9}),
    "more sets": Case({"interleave": 5}),
    "mostly by the pilot": Case({"uniform_share": 0.1}),
    "no pilot": Case({"uniform_share": 1.0}),
    "fewer picks": Case({"picks": 5}),
    "fewer directions": Case({"directions": 3}),
    "directions alone": Case({"directions": 3}, {"estimator": "hemisphere"}),
    "a small bound": Case({"bound": 0.01}, scene="tilted"),
    "a large bound": Case({"bound": 3.0}, scene="tilted"),
    "few rays at a time": Case({"batch": 700}, same="memory alone"),
}
# Those that say when to stop, and what else no estimator by samples has: each has a test of its own below.
ALONE = {"TruthSettings.seconds", "TruthSettings.target_error", "TruthSettings.checkpoint", "TruthSettings.caustics",
         "TruthSettings.photons"}


def test_every_field_has_a_case():
    assert uncovered(TruthSettings, CASES, BASE) == ALONE


@functools.cache
def frame_of(scene):
    return Case({}, scene=scene).seen()


@functools.cache
def estimates(scene, rules):
    """Return pictures (rounds, 3, h, w) by NumPy alone; NaN where there is no surface."""
    frame = frame_of(scene)
    buffer, random = frame.gbuffer, np.random.default_rng(17)
    at = tuple(np.argwhere(buffer.covered).T)
    normal = buffer.normal[:, *at].T
    receivers = (buffer.position[:, *at].T, normal,
                 face_normals(frame.scene.geometry, buffer.triangle_id[at], normal))
    pictures = np.full((WEIGHING + ROUNDS, 3, frame.height, frame.width), np.nan)
    for picture in pictures:
        picture[:, *at] = light_tracing.irradiance(frame.scene, receivers, rules, SIDE, random, buffer.projection).T
    return pictures


def weights_of(pictures):
    """Return how much pixels count: those of much noise less, so that no corner hides the others."""
    variance = pictures.var(axis=0, ddof=1).sum(axis=0)
    return np.nan_to_num(1 / (variance + np.nanmedian(variance)))


def means(pictures, weights):
    """Return weighted means over the picture and over blocks of 8 x 8 pixels of which half see anything."""
    rows, columns = (range(0, size, 8) for size in weights.shape)
    parts = [np.s_[:, :], *(np.s_[i : i + 8, j : j + 8] for i in rows for j in columns)]
    values = np.nan_to_num(pictures) * weights
    return np.stack([values[..., *part].sum(axis=(2, 3)) / weights[part].sum()
                     for part in parts if (weights[part] > 0).sum() >= 32], axis=2)


def rules_of(settings):
    """Return what is asked of the truth, apart from how."""
    return light_tracing.Rules(settings.visibility, settings.emitters == "visible", settings.bounces)


@functools.cache
def mean_of(scene, settings):
    return trace_truth(frame_of(scene), settings).mean


def compared(name):
    """Return how far means of a case lie off those by NumPy, and its standard errors, (3, values)."""
    case = CASES[name]
    settings = case.settings(TruthSettings, BASE)
    with cells_kept():
        runs = np.array([mean_of(case.scene, dataclasses.replace(settings, seed=settings.seed + 100 * k))
                         for k in range(RUNS)])
    pictures = estimates(case.scene, rules_of(settings))
    weights = weights_of(pictures[:WEIGHING])
    got, expected = means(runs, weights), means(pictures[WEIGHING:], weights)
    error = np.sqrt(got.var(axis=0, ddof=1) / RUNS + expected.var(axis=0, ddof=1) / ROUNDS)
    return got.mean(axis=0) - expected.mean(axis=0), error, expected.mean(axis=0)


@pytest.mark.feature("REF-03")
@pytest.mark.slow("visible emitters, not blocked")
@pytest.mark.parametrize("name", CASES)
def test_the_mean(name, evidence):
    off, error, expected = compared(name)
    z = np.abs(off / error)
    evidence(f"{name}: {z.max():.1f} standard errors of {(error / expected)[:, 0].max():.1e} of the mean")
    assert z.max() < SIGMAS


@pytest.mark.parametrize("name", CASES)
def test_each_key_counts(name):
    """The bits of one run."""
    case = CASES[name]
    with cells_kept():
        mean = mean_of(case.scene, case.settings(TruthSettings, BASE))
        for _, settings in case.without(TruthSettings, BASE):
            assert np.array_equal(mean, mean_of(case.scene, settings)) == bool(case.same)


# rays of a pass


@dataclasses.dataclass
class Counting:
    """A tracer that keeps the rays of each call."""

    tracer: object
    closest: list = dataclasses.field(default_factory=list)
    occluded: list = dataclasses.field(default_factory=list)

    def __getattr__(self, name):
        return getattr(self.tracer, name)

    def fill_closest(self, origins, directions, reach, *found):
        self.closest.append((origins.copy(), directions.copy(), reach.copy()))
        self.tracer.fill_closest(origins, directions, reach, *found)

    def fill_occluded(self, origins, directions, reach, blocked):
        self.occluded.append((origins.copy(), directions.copy(), reach.copy()))
        self.tracer.fill_occluded(origins, directions, reach, blocked)

    @property
    def counts(self):
        """Rays to nearest hits, and shadow rays."""
        return tuple(sum(len(reach) for *_, reach in rays) for rays in (self.closest, self.occluded))


def without_lobes(frame):
    """Return a frame of the scene with diffuse materials: what the bound speaks of."""
    materials = tuple(dataclasses.replace(material, specular=(0.0, 0.0, 0.0)) for material in frame.scene.materials)
    return Frame(dataclasses.replace(frame.scene, materials=materials), width=frame.width, height=frame.height,
                 dtype=frame.dtype)


def counted(case, change=lambda frame: frame, **changes):
    """Return the rays of two passes, the settings, and the result."""
    frame = change(case.seen())
    vars(frame)["tracer"] = tracer = Counting(frame.tracer)
    settings = dataclasses.replace(case.settings(TruthSettings, BASE), samples=1, **changes)
    return tracer, settings, trace_truth(frame, settings)


@functools.cache
def cell_rays(scene):
    """Return how many rays it takes to cut the lights of a scene into cells; its materials have lobes."""
    frame = frame_of(scene)
    tracer = Counting(frame.tracer)
    lobe_cells(frame.scene, tracer, surfaces(frame.scene), lights_of(frame.scene))
    return tracer.counts[0]


def rays_of(settings, receivers, lamps, passes=2, scene="lamps"):
    """Return how many rays to nearest hits and how many shadow rays passes and pilot take: docs/truth.

    Each of the picks has another one for lobes of senders; half of them where directions bring the lobes as well, all
    of an exponent of 8 or less.
    """
    picks = 0 if settings.estimator == "hemisphere" else settings.picks
    directions = {"light": 0, "hemisphere": settings.directions or 16}.get(settings.estimator, settings.directions or 8)
    sharpest = max(m.exponent for m in frame_of(scene).scene.materials if any(m.specular))
    of_lobes = picks - picks // 2 if directions and sharpest <= 8 else picks
    closest = receivers * (directions * settings.bounces + of_lobes)
    shadow = receivers * (picks + of_lobes + lamps * directions * settings.bounces)
    closest += lamps * settings.light_grid**2 * settings.interleave**2 if picks else 0
    cells = cell_rays(scene) if picks else 0
    if not picks or settings.uniform_share == 1:
        return passes * closest + cells, passes * shadow
    sampled = min(receivers, PILOT_RECEIVERS)
    pilot = sampled * max(picks, -(-PILOT_PICKS // sampled))
    return passes * closest + cells + lamps * PILOT_CELLS**2, passes * shadow + pilot


IN_ONE_GO = [name for name, case in CASES.items() if not {"visibility", "emitters"} & {*case.values, *case.over}]


@pytest.mark.parametrize("name", IN_ONE_GO)
def test_as_many_rays_as_the_settings_say(name):
    case = CASES[name]
    tracer, settings, result = counted(case)
    assert result.passes == 2
    assert tracer.counts == rays_of(settings, int((result.samples > 0).sum()), 3, scene=case.scene)


def test_no_more_rays_at_a_time_than_a_batch():
    tracer, settings, _ = counted(CASES["few rays at a time"])
    sizes = [len(reach) for *_, reach in tracer.occluded[1:]]  # the pilot's come first, all at once
    assert settings.batch / 2 < max(sizes) <= settings.batch


def test_without_visibility_no_shadow_ray_leaves_a_receiver():
    """The light side traces none; hemisphere rays pass through what they meet."""
    tracer, settings, result = counted(CASES["not blocked"], estimator="light")
    assert tracer.counts[1] == 0
    through, settings, _ = counted(CASES["not blocked"], estimator="hemisphere")
    assert through.counts[0] > rays_of(settings, int((result.samples > 0).sum()), 3, scene="tilted")[0]


@pytest.mark.parametrize("share", [0.2, 0.6])
def test_rays_that_light_nothing_are_uniform_alone(share):
    """Upwards a point light meets nothing: there the density is the uniform share, to the jitter of cells."""
    case = dataclasses.replace(CASES["light"], scene="lamps")
    tracer, settings, _ = counted(case, uniform_share=share, light_grid=40)
    _, directions, _ = next(rays for rays in tracer.closest[3:] if np.allclose(rays[0], LAMP, atol=1e-3)
                            and len(rays[0]) == settings.light_grid**2 * settings.interleave**2)
    upward, expected_share = (directions[:, 1] > UPWARD).mean(), share * (1 - UPWARD) / 2
    assert abs(upward / expected_share - 1) < 0.05


LAMP, UPWARD = (0.2, 0.9, 0.3), 0.85  # the point light; beyond 32 degrees off the vertical no wall is in its way


def test_the_bound_says_how_far_hemisphere_rays_look():
    """b r^2 over what a sender gives at most is constant: four times the bound, half of the reach."""
    few = {"picks": 1, "light_grid": 8, "interleave": 1}
    reach = [max(reach.max() for *_, reach in counted(CASES["a small bound"], without_lobes, bound=bound,
                                                      **few)[0].closest if np.isfinite(reach).all())
             for bound in (0.5, 2.0)]
    assert reach[0] / reach[1] == pytest.approx(2, rel=1e-6)


# exact identities


def test_an_infinite_bound_leaves_all_to_the_light_side():
    frame = without_lobes(frame_of("tilted"))
    both = trace_truth(frame, TruthSettings(samples=24 * 2, bound=1e30))
    light = trace_truth(frame, TruthSettings(samples=16 * 2, estimator="light"))
    np.testing.assert_array_equal(both.mean, light.mean)


def test_a_vanishing_bound_leaves_all_to_the_hemisphere():
    frame = without_lobes(frame_of("tilted"))
    both = trace_truth(frame, TruthSettings(samples=24 * 2, bound=1e-12))
    hemisphere = trace_truth(frame, TruthSettings(samples=8 * 2, directions=8, estimator="hemisphere"))
    assert np.abs(both.mean - hemisphere.mean).max() < 1e-6 * both.mean.max()


@pytest.mark.parametrize(("samples", "passes"), [(1, 2), (24 * 3, 3), (24 * 3 + 1, 4)])
def test_samples_make_up_passes(samples, passes):
    result = trace_truth(frame_of("lamps"), TruthSettings(samples=samples))
    assert result.passes == passes
    assert set(np.unique(result.samples)) <= {0, 24 * passes}


def test_seconds_end_it():
    assert trace_truth(frame_of("lamps"), TruthSettings(samples=24 * 1000, seconds=1e-6)).passes == 2


def test_a_target_of_error_ends_it_as_soon_as_it_is_met():
    frame = frame_of("lamps")
    results = [trace_truth(frame, of(TruthSettings, **BASE | {"samples": 24 * passes})) for passes in range(2, 8)]
    least = min(results, key=lambda result: result.pixel_error)
    assert least.passes > 2
    target = {"samples": 24000, "target_error": 1.0001 * least.pixel_error}
    ended = trace_truth(frame, of(TruthSettings, **BASE | target))
    np.testing.assert_array_equal(ended.mean, least.mean)


def test_a_checkpoint_goes_on_to_the_same_bits(tmp_path):
    frame, file = frame_of("lamps"), tmp_path / "passes"
    part = trace_truth(frame, TruthSettings(samples=24 * 2, checkpoint=file))
    tracer = Counting(frame.tracer)
    going_on = Case({}).seen()
    vars(going_on)["tracer"] = tracer
    whole = trace_truth(going_on, TruthSettings(samples=24 * 5, checkpoint=file))
    at_once = trace_truth(frame, TruthSettings(samples=24 * 5))
    assert (part.passes, whole.passes) == (2, 5)
    np.testing.assert_array_equal(whole.mean, at_once.mean)
    assert tracer.counts == rays_of(TruthSettings(), int((whole.samples > 0).sum()), 3, passes=3)


# caustics

FOOTPRINT = 2e-3  # photons give the mean over a pixel's footprint, which differs by that from E in its centre
BEAM = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), math.radians(25), math.radians(35), (3.0, 2.0, 1.0))


@functools.cache
def before_a_mirror():
    """Return a floor before a mirror-like wall whose lobes are wide enough to be met by chance."""
    scene = mirror_over_floor(BEAM)
    materials = tuple(dataclasses.replace(m, exponent=300.0) if any(m.specular) else m for m in scene.materials)
    return dataclasses.replace(scene, materials=materials)


def seen_from_above():
    return Frame(before_a_mirror(), width=12, height=12, dtype=np.float64)


@pytest.mark.parametrize("photons", [1 << 12, 1 << 14])
def test_photons_carry_the_light_of_mirrors(photons, evidence):
    """The mean is that of the light side, which sends lobes to every receiver, and of NumPy elsewhere."""
    frame = seen_from_above()
    expected = trace_truth(frame, TruthSettings(samples=24 * 20, estimator="light"))
    result = trace_truth(frame, TruthSettings(samples=24 * 20, caustics=True, photons=photons))
    error = np.sqrt(result.picture_variance + expected.picture_variance)
    off = np.abs(result.picture_mean - expected.picture_mean) - FOOTPRINT * expected.picture_mean
    evidence(f"{photons} photons: {(off / error).max():.1f} standard errors of "
             f"{(error / result.picture_mean).max():.1e} of the mean")
    assert (error < 0.01 * expected.picture_mean).all()
    assert (off < SIGMAS * error).all()


@pytest.mark.parametrize("photons", [1000, 1 << 12])
def test_as_many_photons_as_asked_for(photons):
    """The largest square number up to it, from each lamp in each pass; none without caustics."""
    sent, sizes = math.isqrt(photons) ** 2, []
    for caustics in (True, False):
        frame = seen_from_above()
        vars(frame)["tracer"] = tracer = Counting(frame.tracer)
        trace_truth(frame, TruthSettings(samples=1, caustics=caustics, photons=photons, estimator="hemisphere"))
        sizes.append([len(reach) for *_, reach in tracer.closest])
    assert sizes[0].count(sent) >= 2 * 2  # two passes of two bounces or more
    assert set(sizes[0]) - set(sizes[1]) == {sent}
