"""Ambient occlusion in place of indirect visibility: a corner in closed form, and its error beside that of rays."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import Camera, PointLight, Scene, load_scene, merge
from refgi.settings import of
from refgi.splat import MultiresSettings, SiiSettings, multires, sii
from refgi.truth import TruthSettings, VplSettings, trace_truth, vpl
from tests.truth.scenes import rectangle

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # reported: tests/pairs/test_loss

STANDARD_ERRORS = 1.0  # of a share of independent rays; those of a low-discrepancy set are all nearer
RADIUS, RAYS = 0.8, 1024
HEIGHT = 5.0  # m: planes reach farther than rays
OCCLUDED = {"ambient_occlusion": "openness", "ambient_occlusion.radius": RADIUS, "ambient_occlusion.rays": RAYS}
METHODS = {"sii": (sii, SiiSettings, {"lights": 64}), "multires": (multires, MultiresSettings, {"lights": 64})}


def planes(count):
    """The first planes of a right-angled corner at the origin, seen from within it, with a lamp that lights them."""
    along = 2 * HEIGHT * np.eye(3)
    meshes = [rectangle(-(along[one] + along[other]) / 2, along[one], along[other])
              for one, other in ((2, 0), (1, 2), (0, 1))][:count]
    camera = Camera((1.9, 2.3, 2.1), (0.3, 0.2, 0.35), vfov=math.radians(50), width=32, height=24)
    return Scene("corner", *merge(meshes), camera, (PointLight((1.0, 1.2, 0.9), (3.0, 2.0, 1.0)),))


def segment(t):
    """Area of x > t in the unit disc: what a plane at t radii hides of the disc of cosine-weighted directions."""
    return np.arccos(t) - t * np.sqrt(1 - t * t)


def both(t, s):
    """Area of x > t and y > s in the unit disc, hidden by both of two planes: the integral of sqrt(1 - x^2) - s."""
    end = np.sqrt(1 - s * s)
    primitive = [(x * np.sqrt(1 - x * x) + np.arcsin(x)) / 2 for x in (t, end)]
    return np.where(t * t + s * s < 1, primitive[1] - primitive[0] - s * (end - t), 0)


def open_share(position, normal, count):
    """O at points (3, n) of the first planes: what the others hide, by their distances, but what both do once."""
    owner = np.argmax(np.abs(normal), axis=0)
    t = [np.where((owner == axis) | (number >= count), 1.0, np.minimum(position[axis] / RADIUS, 1.0))
         for number, axis in enumerate((1, 0, 2))]
    hidden = sum(map(segment, t)) - both(t[0], t[1]) - both(t[1], t[2]) - both(t[0], t[2])
    return 1 - hidden / np.pi


@pytest.mark.feature("SII-32")
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("method", METHODS)
def test_a_corner_follows_the_closed_form(method, count, evidence):
    """1 on one plane to the bit, 1/2 at the edge of two, 1/4 where three meet."""
    function, kind, few = METHODS[method]
    frame = Frame(planes(count), rsm_resolution=32, dtype=np.float64)
    plain, occluded = (function(frame, of(kind, **few, **more)) for more in ({}, OCCLUDED))
    lit = (plain.min(axis=0) > 0) & (np.abs(frame.gbuffer.position).max(axis=0) < HEIGHT - RADIUS)
    if count == 1:
        np.testing.assert_array_equal(occluded, plain)
        return
    expected = open_share(frame.gbuffer.position[:, lit], frame.gbuffer.normal[:, lit], count)
    found = occluded[:, lit] / plain[:, lit]
    limit = STANDARD_ERRORS * np.sqrt(expected * (1 - expected) / RAYS) + 1 / RAYS
    assert (np.abs(found - expected) <= limit).all()
    assert expected.min() < {2: 0.55, 3: 0.35}[count]
    assert expected.max() == 1
    evidence(f"{method}, {count} planes: E'/E of {lit.sum()} pixels, {expected.min():.2f} to 1, within "
             f"{np.abs(found - expected).max():.1e} of the closed form")


def test_the_closed_form_of_a_corner():
    zero = np.zeros(1)
    for axis in range(3):  # the apex, on each plane
        assert open_share(np.zeros((3, 1)), np.eye(3)[:, [axis]], 3) == pytest.approx(0.25)
    assert open_share(np.array([zero, zero, zero + 9]), np.eye(3)[:, [1]], 3) == pytest.approx(0.5)
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 1_000_000))
    seen = (x * x + y * y < 1) & (x > 0.3) & (y > 0.4)
    assert both(0.3, 0.4) == pytest.approx(4 * seen.mean(), abs=4 * 4 * math.sqrt(seen.mean() / 1e6))


@pytest.mark.filterwarnings("ignore:.* zero area")
@pytest.mark.feature("SII-32")
@pytest.mark.parametrize("name", ["cornell_box", "atrium:faces=20000", *(
    pytest.param(name, marks=pytest.mark.slow) for name in ("cornell_horse", "sponza", "kitchen", "dragon_bunny"))])
def test_the_error_beside_that_of_rays(request, name, evidence):
    """It takes light away everywhere, rather more than shadows do, and not where they do: rays are nearer."""
    real = name.partition(":")[0] not in ("cornell_box", "atrium")
    frame = Frame(load_scene(request.getfixturevalue("data_dir") / f"{name}.json" if real else name), width=32,
                  height=32, shadows="exact")
    truth = trace_truth(frame, TruthSettings(samples=1200)).mean
    blocked = {"shadow rays": vpl(frame, of(VplSettings, lights=512)), "none": sii(frame, of(SiiSettings, lights=512)),
               "ambient occlusion": sii(frame, of(SiiSettings, lights=512, ambient_occlusion="openness"))}
    assert (blocked["ambient occlusion"] <= blocked["none"]).all()
    bias = {how: light.mean() / truth.mean() - 1 for how, light in blocked.items()}
    off = {how: float(np.abs(light - truth).mean() / truth.mean()) for how, light in blocked.items()}
    assert bias["ambient occlusion"] < bias["none"]
    assert off["shadow rays"] < off["ambient occlusion"]
    evidence(f"{name}: mean absolute error (bias) by " + ", ".join(
        f"{how} {off[how]:.0%} ({bias[how]:+.0%})" for how in blocked))


def test_it_goes_with_no_other_visibility():
    with pytest.raises(InputError, match="ambient_occlusion: expected none with visibility"):
        of(MultiresSettings, visibility="rays", ambient_occlusion="openness")
