"""What lies below a face, by interpolated normals: hidden where visibility is computed, bounded by cosines elsewhere.

A plate in the plane y = 0 is lit from above and sends with a normal m that leans towards +x; a receiver on a speck of
a face sees it with a normal n. Without visibility E = rho F / pi int <n.w> <m.-w> / r^2 dA, whatever side of either
face the other lies on; the integral is summed over a grid.
"""

import math

import numpy as np
import pytest

from refgi.rays import Tracer
from refgi.scene import Camera, DirectionalLight, Material, Mesh, Scene, merge
from refgi.truth import TruthSettings
from refgi.truth.truth import accumulate, accumulate_lobes
from tests.truth.scenes import FEW_RAYS, rectangle

ESTIMATORS = ["combined", "hemisphere", "light"]
LEVEL, BIAS = 1 - 5e-4, 2e-4  # one mean in 2,000 lies outside, as beyond 4 standard errors of 25 values; float32 rays
SUN = DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0))
ALBEDO = 0.6
SHAPE = (8, 8)
UP, DOWN = (Camera((0.0, height, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.5) for height in (9.0, -9.0))
LEANING = np.array([0.8, 0.6, 0.0])
PLACES = {  # receiver's point, normal and the normal of its face
    "both above": ((1.0, 0.6, 0.1), (-0.6, -0.8, 0.0), (-0.8, -0.6, 0.0)),
    "below the sender's face": ((1.2, -0.5, 0.1), (-0.9, 0.3, 0.1), (-1.0, 0.0, 0.0)),
    "below the receiver's face": ((0.9, 0.5, 0.0), (-0.6, -0.8, 0.0), (-0.3, 0.9, 0.0)),
    "on the edge of its face": ((0.9, 0.5, 0.0), (-0.6, -0.8, 0.0), (0.4, -0.9, 0.0)),
    "below both": ((1.2, -0.5, 0.1), (-0.8, 0.1, 0.0), (-0.2, -0.9, 0.0)),
}


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def place_at(name, camera=UP, lobe=None):
    """Return the scene, and position, normal and triangle of equal receivers."""
    point, normal, face = PLACES[name]
    plate = rectangle((-0.5, 0.0, 0.5), (1.0, 0, 0), (0, 0, -1.0), Material("plate", (ALBEDO,) * 3))
    along = unit(np.cross(face, (0.1, 0.2, 1.0)))
    corners = np.asarray(point) + 1e-4 * np.array([along, -along, np.cross(face, along)])
    # what its own back is lit by must not count
    material = Material("speck", (0.5,) * 3) if lobe is None else Material("speck", (0.0,) * 3, (1.0,) * 3, lobe)
    speck = Mesh(corners, np.array([[0, 1, 2]]), np.tile(unit(normal), (3, 1)), material, "speck")
    smooth = Mesh(plate.vertices, plate.faces, np.tile(LEANING, (4, 1)), plate.material, "plate")
    geometry, materials = merge([speck, smooth], smooth=True)
    at, up = (np.broadcast_to(np.reshape(v, (3, 1, 1)), (3, *SHAPE)) for v in (point, unit(normal)))
    return Scene("by hand", geometry, materials, camera, (SUN,)), at, up, np.zeros(SHAPE, np.int32)


def expected(name, hide, weight=None):
    """Return the sum over a fine grid of the plate, with `hide` only what both faces look at."""
    point, normal, face = (np.asarray(v, float) for v in PLACES[name])
    if face @ normal < 0:
        face = -face
    side = (np.arange(500) + 0.5) / 500 - 0.5
    x, z = np.meshgrid(side, side)
    d = np.stack([x, 0 * x, z], axis=-1) - point
    r2 = (d**2).sum(axis=-1)
    w = d / np.sqrt(r2)[..., None]
    term = np.maximum(w @ unit(normal), 0) * np.maximum(-(w @ LEANING), 0) / r2 * (1 if weight is None else weight(w))
    if hide:
        term *= (w @ face > 0) & (point[1] > 0)
    return ALBEDO * np.array(SUN.irradiance) / math.pi * term.mean()


def compare(result, truth):
    error = np.abs(result.picture_mean - truth)
    assert (error <= result.confidence_factor(LEVEL) * np.sqrt(result.picture_variance) + BIAS * truth).all()
    return f"{result.picture_mean[0]:.5f} for {truth[0]:.5f}, off by {(error / np.maximum(truth, 1e-30)).max():.1e}"


@pytest.mark.feature("REF-32")
@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize(("name", "emitters"), [(name, "all") for name in PLACES] + [
    (name, "visible") for name in PLACES if "sender" in name or "both" in name])
def test_irradiance_is_bounded_by_cosines_where_nothing_hides(name, estimator, emitters, evidence):
    room, at, up, ids = place_at(name)
    for visibility in (False, True):
        truth = expected(name, visibility)
        settings = TruthSettings(visibility=visibility, estimator=estimator, emitters=emitters, samples=400, **FEW_RAYS)
        line = compare(accumulate(room, Tracer(room.geometry), at, up, ids, settings), truth)
        evidence(f"{name}, {estimator}, {emitters}, visibility={visibility}: {line}")
    assert expected(name, False)[0] > 0.005


@pytest.mark.feature("REF-32")
@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("name", PLACES)
def test_a_lobe_is_bounded_by_cosines_where_nothing_hides(name, estimator, evidence):
    exponent = 4.0
    point, normal, _ = (np.asarray(v, float) for v in PLACES[name])
    aim = unit(-point + (0.0, 0.0, 0.1))  # where the mirror direction looks: past the plate's middle
    toward = 2 * (aim @ unit(normal)) * unit(normal) - aim
    room, at, up, ids = place_at(name, Camera(tuple(point + 3 * toward), tuple(point)), exponent)
    for visibility in (False, True):
        truth = expected(name, visibility,
                         lambda w: (exponent + 2) / (2 * math.pi) * np.maximum(w @ aim, 0) ** exponent)
        settings = TruthSettings(visibility=visibility, estimator=estimator, samples=600, light_grid=4)
        line = compare(accumulate_lobes(room, Tracer(room.geometry), at, up, ids, settings), truth)
        evidence(f"{name}, {estimator}, visibility={visibility}: {line}")


@pytest.mark.feature("REF-32")
@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("visibility", [False, True])
def test_an_emitter_is_seen_by_a_camera_on_the_side_of_its_light_alone(estimator, visibility):
    room, at, up, ids = place_at("below the sender's face", DOWN)
    settings = TruthSettings(visibility=visibility, estimator=estimator, emitters="visible", samples=64)
    assert not accumulate(room, Tracer(room.geometry), at, up, ids, settings).mean.any()
