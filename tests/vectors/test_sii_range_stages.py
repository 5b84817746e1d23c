"""Stages of the range of pixel lights in the kit: the production method, the literal twin as a port, bugs.

The twin has no ellipsoids apart from meshes: these are compared with the printed formula and their defining tangent.
"""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.pairs.settings import PairSettings
from refgi.splat import sii
from refgi.vectors.cases.sii_range import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.stages.lights import pixel_lights_of
from refgi.vectors.stages.sii_range_sum import BOTH
from tests.naive import sii as twin
from tests.naive.pair_term import parts, received
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 5e-6  # of the largest value: places in float32, whose rounding near lights magnify
ON_EDGE = 1  # pixels at which rounding decides: the pair that defines the reference length lies on the threshold
BARE = PairSettings(clamp=None)

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected, got = sii(frame, settings_of(plan)), made(id)[1]["range.irradiance"]
    out = np.abs(got - expected).max(axis=0) > STORED * expected.max()
    assert out.sum() <= ON_EDGE
    assert (got.max() > 0) != (id == "sii-range-no-flux")


class Given:
    """The stored arrays of a case, its parts of lights and covered pixels."""

    def __init__(self, id):
        self.known, self.plan = made(id)[1], PLANS[id]()
        self.covered = self.known["gbuffer.triangle_id"] >= 0
        self.x, self.n = (self.known[f"gbuffer.{key}"][:, self.covered].astype(float) for key in ("position", "normal"))
        drawn = self.plan.lights * len(self.plan.scene.lights)
        self.lights = pixel_lights_of(self.known, np.float64)._replace(drawn=drawn)
        self.parts = parts(self.lights, BARE)

    def arrays(self, key, values, kind=float):
        """Return {name: (N, ...)} of values, one for each part; 0 for lights without that part."""
        shapes = np.shape(values[0]) if values else ()
        made_here = {}
        for name in BOTH if self.lights.lobe_flux is not None else BOTH[:1]:
            whole = np.zeros((self.lights.flux.shape[1], *(self.covered.shape if shapes or (not values and key in (
                "strength", "kept")) else ())), kind)
            for part, value in zip(self.parts, values, strict=True):
                if (part.exponent is not None) == (name == "glossy"):
                    whole[part.light] = self.picture(value, kind) if shapes else value
            made_here[f"range.{name}_{key}"] = whole
        return made_here

    def picture(self, values, kind=float):
        whole = np.zeros((*np.shape(values)[:-1], *self.covered.shape), kind)
        whole[..., self.covered] = values
        return whole

    def stored(self, key):
        """Return what the kit holds of each part."""
        return [self.known[f"range.{'diffuse' if part.exponent is None else 'glossy'}_{key}"][part.light].astype(float)
                for part in self.parts]


def peaks(given):
    return given.arrays("peak", [twin.peak(part, BARE) for part in given.parts])


def all_strengths(given):
    return given.arrays("strength", [twin.strength(part, given.x, BARE) for part in given.parts])


def length(given):
    found = [twin.strength(part, given.x, BARE) for part in given.parts]
    brightest = max((twin.peak(part, BARE) for part in given.parts), default=0.0)
    return {"range.length": np.array([twin.reference_length(given.x, given.lights, brightest, found)
                                      if found else 1.0])}


def low(given):
    share, brightest = settings_of(given.plan).reach.cut.share, max(given.stored("peak"), default=0.0)
    return {"range.low": share * brightest / given.known["range.length"].astype(float) ** 2}


def squares(given):
    threshold = given.known["range.low"].astype(float)[0]
    return given.arrays("square", [peak / threshold for peak in given.stored("peak")])


def kept(given):
    threshold = given.known["range.low"][0]
    return given.arrays("kept", [one[given.covered] >= threshold for one in given.stored("strength")], bool)


def total(given):
    pairs, light = settings_of(given.plan).pairs, np.zeros((3, given.x.shape[1]))
    for part, counts in zip(parts(given.lights, pairs, given.known.get("lights.area")), given.stored("kept"),
                            strict=True):
        light += np.outer(part.flux, counts[given.covered] * received(part, given.x, given.n, pairs))
    return {"range.irradiance": given.picture(light)}


def ellipsoids(given):
    """The tangent ellipse of n >= 2 at x_0 = 0.71 has the region's radius and slope there and meets the light."""
    n = given.known["range.exponent"].astype(float)
    center = (n / (n + 2)) ** ((n + 2) / 4)
    height = (n / (n + 2)) ** (n / 4) * np.sqrt(2 / (n + 2))
    result = {"range.appendix_center": center, "range.appendix_half_width": np.maximum(center, 1 - center),
              "range.appendix_height": height}
    b, at = 2 * n / (n + 2), 0.71
    square, slope = at**b - at**2, b * at ** (b - 1) - 2 * at  # F^2 = x^b - x^2 and its derivative
    # y^2 = h^2 (1 - ((x - c)/c)^2) = k x (2c - x): k and c from value and slope at x_0
    k = (square / at - slope) / at
    middle = (square / (k * at) + at) / 2
    touching = np.where(n < 2, center, middle), np.where(n < 2, np.maximum(center, 1 - center), middle), np.where(
        n < 2, height, middle * np.sqrt(k))
    return result | dict(zip(("range.tangent_center", "range.tangent_half_width", "range.tangent_height"), touching,
                             strict=True))


PORT = {"peaks": peaks, "strengths": all_strengths, "length": length, "low": low, "squares": squares, "kept": kept,
        "sum": total, "ellipsoids": ellipsoids}


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_twin_as_a_port_is_within_bounds(id):
    given = Given(id)
    for name in stages_of(id, "range"):
        expect_within(id, name, PORT[name.split(".")[1]](given))


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "range").values()) < LARGEST_MASK


def test_some_pairs_are_cut_and_some_are_not():
    for id in set(PLANS) - {"sii-range-no-flux"}:
        given = Given(id)
        share = np.mean([counts[given.covered].mean() for counts in given.stored("kept")])
        assert 0.02 < share < 0.9, id
