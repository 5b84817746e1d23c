"""Rays to the lights of a cluster: what everything else is measured against."""

import numpy as np
import pytest

from refgi.cluster.kmeans import cluster
from refgi.cluster.rectangle import area_lights
from refgi.cluster.reference import vpl_visibility
from refgi.cluster.settings import ValSettings
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.pairs.shadow_rays import receivers, shadowed_sum
from refgi.scene import load_scene
from refgi.settings import of
from tests.naive.crossings import corners_of, free

SETTINGS = of(ValSettings, lights=64)
ROUNDING = 1e-6  # of the maximum: V times float64 terms against sums of float32 ones
PAIRS = 400


@pytest.fixture(scope="module", params=["cornell_box", "cornell_sphere:faces=100"])
def box(request):
    """Return frame, lights, receivers and the sum that `vpl` takes: in a flat scene and on a coarse smooth mesh."""
    frame = Frame(load_scene(request.param), width=20, height=20, rsm_resolution=64)
    lights = choose_lights(frame, SETTINGS.lights)
    lights = lights._replace(flux=np.broadcast_to(lights.flux.mean(axis=0), lights.flux.shape))  # all of one colour
    buffer = frame.gbuffer
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, frame.tracer.grain)
    return frame, lights, to, shadowed_sum(frame.tracer, to, lights)


def areas_of(frame, lights, count):
    clusters = cluster(lights.position, lights.normal, count, diagonal=frame.scene.geometry.diagonal)
    return area_lights(lights, clusters, SETTINGS.area)


def light_of_each(to, lights):
    """Return what each light gives each receiver, unshadowed, (n, N) W/m^2 of one channel."""
    x, n_x = to.position.astype(np.float64), to.normal.astype(np.float64)
    p, n_p = lights.position.astype(np.float64), lights.normal.astype(np.float64)
    toward = p[:, None, :] - x[:, :, None]
    cosines = np.maximum((toward * n_x[:, :, None]).sum(0), 0) * np.maximum(-(toward * n_p[:, None, :]).sum(0), 0)
    return lights.flux[0].astype(np.float64) * cosines / (np.pi * (toward**2).sum(0) ** 2)


def with_visibility(to, lights, areas, given):
    """Return sum over area lights of V times what their lights give, (n,)."""
    light, total = light_of_each(to, lights), np.zeros(to.position.shape[1])
    points, facing = to.position.astype(np.float64), to.facing.astype(np.float64)  # and so V is not rounded to float32
    for m in range(len(areas.members)):
        total += given(m, points, facing, shading=to.normal.astype(np.float64)) * light[:, areas.of == m].sum(axis=1)
    return total


@pytest.mark.feature("VAL-02")
def test_visibility_of_each_light_is_that_of_vpl(box, evidence):
    frame, lights, to, reference = box
    count = lights.flux.shape[1]
    areas = areas_of(frame, lights, count)
    assert (areas.members == 1).all()
    off = np.abs(with_visibility(to, lights, areas, vpl_visibility(frame.tracer, lights, areas)) - reference[0]).max()
    evidence(f"{count} lights, {count} clusters, {len(reference[0])} receivers: sum with V off by "
             f"{off / reference[0].max():.1e} of the maximum of vpl's")
    assert off < ROUNDING * reference[0].max()


@pytest.mark.feature("VAL-02")
def test_visibility_of_pairs_is_that_of_a_ray_against_every_triangle(box, evidence):
    frame, lights, to, _ = box
    areas, corners = areas_of(frame, lights, lights.flux.shape[1]), corners_of(frame.scene.geometry)
    given = vpl_visibility(frame.tracer, lights, areas)
    rng = np.random.default_rng(1)
    wrong, blocked, tried = 0, 0, 0
    for _ in range(PAIRS):
        i, k = rng.integers(0, to.position.shape[1]), rng.integers(0, lights.flux.shape[1])
        x, up = to.position[:, i].astype(np.float64), to.facing[:, i].astype(np.float64)
        toward = lights.position[:, k] - x
        if toward @ up <= 0 or toward @ lights.normal[:, k] >= 0:
            continue
        start, end = x + 1e-6 * up, lights.position[:, k] + 1e-6 * lights.normal[:, k]
        seen = free(corners, start[None], end[None])[0]
        v = given(areas.of[k], to.position[:, i : i + 1], to.facing[:, i : i + 1])[0]
        wrong, blocked, tried = wrong + (v != seen), blocked + (not seen), tried + 1
    evidence(f"{wrong} of {tried} random pairs differ from a ray against every triangle; {blocked} are blocked")
    assert wrong == 0
    assert 20 < blocked < tried - 20


@pytest.mark.feature("VAL-02", "REF-15")
def test_more_clusters_come_nearer_to_the_exact_sum(box, evidence):
    frame, lights, to, reference = box
    errors = []
    for areas in (areas_of(frame, lights, count) for count in (1, 4, 16)):
        light = with_visibility(to, lights, areas, vpl_visibility(frame.tracer, lights, areas))
        errors.append(np.sqrt(np.mean((light - reference[0]) ** 2)) / reference[0].mean())
    evidence("rmse / mean of vpl for 1, 4, 16 clusters: " + ", ".join(f"{error:.1e}" for error in errors))
    assert errors[0] > errors[1] > errors[2] > 0.01


@pytest.mark.feature("VAL-02")
def test_the_lights_of_a_cluster_count_by_their_flux(box):
    """By hand, of what each light alone says: the flux that is seen over all that faces the receiver from above it."""
    frame, lights, to, _ = box
    flux = np.random.default_rng(6).uniform(0.1, 1.0, lights.flux.shape).astype(np.float32)
    lobes = lights._replace(flux=flux, lobe_flux=flux[::-1, ::-1].copy())
    points, facing = to.position.astype(np.float64), to.facing.astype(np.float64)
    each, all_lights = (areas_of(frame, lights, count) for count in (flux.shape[1], 1))
    alone = vpl_visibility(frame.tracer, lights, each)
    seen = np.stack([alone(each.of[k], points, facing) for k in range(flux.shape[1])], axis=1)
    faces_it = light_of_each(to._replace(normal=to.facing), lights) > 0
    weight = (lobes.flux + lobes.lobe_flux).sum(axis=0).astype(np.float64) * faces_it
    expected = np.divide((weight * seen).sum(axis=1), weight.sum(axis=1), out=np.ones(len(seen)), where=faces_it.any(1))
    np.testing.assert_allclose(vpl_visibility(frame.tracer, lobes, all_lights)(0, points, facing), expected, atol=1e-12)


def test_any_dtype_and_any_place(box):
    frame, lights, to, _ = box
    areas = areas_of(frame, lights, 8)
    given = vpl_visibility(frame.tracer, lights, areas)
    for dtype in (np.float32, np.float64):
        points = np.ascontiguousarray(np.concatenate([lights.position, to.position[:, :5]], axis=1), dtype)
        facing = np.ascontiguousarray(np.concatenate([lights.normal, to.facing[:, :5]], axis=1), dtype)
        for m in range(8):
            v = given(m, points, facing)
            assert v.dtype == dtype
            assert ((v >= 0) & (v <= 1)).all()  # lights themselves among the receivers: no distance at all
    assert given(0, points[:, :0], facing[:, :0]).shape == (0,)
