"""The rectangle of each cluster (Dong et al. 2009, Sec. 6): its size, place and axes, and what a sample makes of it."""

import math

import numpy as np
import pytest

from refgi.cluster.kmeans import Clustering, cluster
from refgi.cluster.rectangle import area_lights, map_frames
from refgi.cluster.settings import ValSettings
from refgi.lights import PixelLights
from refgi.literal.val_areas import areas as literal_areas
from refgi.rsm.raster.projection import paraboloid_projection
from refgi.settings import replaced

PUBLISHED = ValSettings()
ROUNDING = 1e-14  # relative to the room's size of about 1 m
SIGMAS = 4.0  # of the mean over all clusters: 1 in 16,000 by chance


def lights_at(position, normal):
    return PixelLights(position, normal, np.ones(position.shape), None, None, None, position.shape[1])


def grouped(position, normal, of, count):
    """Clusters given by hand: means of their lights."""
    members = np.bincount(of, minlength=count)
    center = np.stack([np.bincount(of, weights=p, minlength=count) for p in position]) / np.maximum(members, 1)
    axis = np.stack([np.bincount(of, weights=n, minlength=count) for n in normal])
    length = np.linalg.norm(axis, axis=0)
    axis = np.where(length > 0, axis / np.where(length > 0, length, 1), [[0.0], [1.0], [0.0]])
    return Clustering(center, axis, members, of.astype(np.int32), 0, np.zeros(1))


def one_cluster(position, normal):
    return grouped(position, np.broadcast_to(np.reshape(normal, (3, 1)), position.shape), np.zeros(position.shape[1],
                                                                                                   np.int64), 1)


def on_plane(frame, s, t):
    return frame[0][:, None] * s + frame[1][:, None] * t


def areas_of_samples(n, clusters, **options):
    """Areas found for many clusters of n random lights each in a rectangle of 2 m x 0.5 m on a slanted plane."""
    rng = np.random.default_rng(n)
    normal = np.array([[0.48], [0.6], [0.64]])
    frame = map_frames(normal)[0]
    position = on_plane(frame, 2 * rng.random(n * clusters), 0.5 * rng.random(n * clusters))
    normals = np.repeat(normal, n * clusters, axis=1)
    given = grouped(position, normals, np.arange(n * clusters) // n, clusters)
    found = area_lights(lights_at(position, normals), given, replaced(PUBLISHED, options).area)
    return found.side[0] * found.side[1]


@pytest.mark.feature("VAL-09")
@pytest.mark.parametrize("n", [2, 8, 34])
def test_a_sample_of_n_lights_shows_its_share_of_the_area(n, evidence):
    runs = 20_000 // n
    published, unbiased = areas_of_samples(n, runs), areas_of_samples(n, runs, unbiased_area=True)
    share = ((n - 1) / (n + 1)) ** 2
    evidence(f"n={n}: {published.mean():.4f} of the area in the mean of {runs} clusters, expected {share:.4f}; "
             f"unbiased {unbiased.mean():.4f}")
    for area, expected in ((published, share), (unbiased, 1.0)):
        assert abs(area.mean() - expected) < SIGMAS * area.std() / math.sqrt(runs)


@pytest.mark.feature("VAL-09")
@pytest.mark.parametrize("axes", ["fixed", "pca", "min_area"])
def test_a_rectangle_of_known_size_is_found(axes, evidence):
    worst = 0.0
    for normal in ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.48, 0.6, 0.64)):
        frame = map_frames(np.reshape(normal, (3, 1)))[0]
        s, t = (grid.ravel() for grid in np.meshgrid(np.linspace(1.0, 3.0, 6), np.linspace(-0.25, 0.5, 4)))
        position = on_plane(frame, s, t)
        found = area_lights(lights_at(position, position), one_cluster(position, normal),
                            replaced(PUBLISHED, {"axes": axes}).area)
        sides = sorted(found.side[:, 0])
        worst = max(worst, abs(sides[0] - 0.75), abs(sides[1] - 2.0))
        assert found.delta[0] == pytest.approx(math.sqrt(1.5), abs=ROUNDING)
        middle = found.center[:, 0] + found.offset[:, 0] @ found.axes[0]
        np.testing.assert_allclose(middle, 2 * frame[0] + 0.125 * frame[1], atol=ROUNDING)
        np.testing.assert_allclose(found.axes[0] @ normal, 0, atol=ROUNDING)
        assert found.radius[0] == pytest.approx(math.hypot(1.0, 0.375), abs=ROUNDING)
    assert worst < ROUNDING
    evidence(f"{axes}: sides of 2 m and 0.75 m on five planes, off by {worst:.1e} m")


@pytest.mark.feature("VAL-09")
def test_a_turned_square_doubles_its_area_of_fixed_axes(evidence):
    frame = map_frames(np.array([[0.0], [1.0], [0.0]]))[0]
    position = on_plane(frame, np.array([1.0, 0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0, -1.0]))
    areas = {}
    for axes in ("fixed", "min_area"):
        found = area_lights(lights_at(position, position), one_cluster(position, (0, 1, 0)),
                            replaced(PUBLISHED, {"axes": axes}).area)
        areas[axes] = float(found.side.prod())
    assert areas["fixed"] == pytest.approx(4.0, abs=ROUNDING)
    assert areas["min_area"] == pytest.approx(2.0, abs=ROUNDING)
    evidence(f"a square of 2 m^2 turned by 45 degrees: {areas['fixed']:.3f} m^2 of fixed axes, "
             f"{areas['min_area']:.3f} m^2 of least area")


@pytest.mark.feature("VAL-09")
@pytest.mark.parametrize("axes", ["fixed", "pca", "min_area"])
@pytest.mark.parametrize("extent", ["root", "longer", "shorter"])
@pytest.mark.parametrize("count", [1, 12])
def test_rectangles_are_those_of_the_literal_text(axes, extent, count):
    rng = np.random.default_rng(3)
    position, normal = rng.random((3, 200)), rng.normal(size=(3, 200))
    clusters = cluster(position, normal, count, diagonal=1.7)
    options = {"axes": axes, "area_extent": extent, "unbiased_area": extent == "longer"}
    found = area_lights(lights_at(position, normal), clusters, replaced(PUBLISHED, options).area)
    frame, along, side, offset, delta, radius, members = literal_areas(
        position, clusters.center, clusters.normal, clusters.of, axes, extent, extent == "longer")
    for ours, theirs in ((found.frame, frame), (found.axes, along), (found.side, side), (found.offset, offset),
                         (found.delta, delta), (found.radius, radius), (found.members, members)):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=ROUNDING)


@pytest.mark.feature("VAL-09")
def test_frames_are_those_of_the_maps():
    rng = np.random.default_rng(1)
    steep = np.array([[0.02, 0.04], [1.0, 1.0], [0.03, 0.03]])  # up is -z for the first and y for the second
    normal = np.hstack([rng.normal(size=(3, 50)), np.eye(3), -np.eye(3), steep])
    normal /= np.linalg.norm(normal, axis=0)
    expected = paraboloid_projection(np.zeros((normal.shape[1], 3)), normal.T, 1).frame
    np.testing.assert_allclose(map_frames(normal), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("axes", ["fixed", "pca", "min_area"])
@pytest.mark.parametrize("unbiased", [False, True])
def test_degenerate_clusters_are_finite(axes, unbiased):
    settings = replaced(PUBLISHED, {"axes": axes, "unbiased_area": unbiased})
    position = np.zeros((3, 9))
    position[0, 4:] = [1.0, 1.25, 1.5, 1.75, 2.0]  # four in one place, five on a line, one of none
    normals = np.repeat([[0.0], [1.0], [0.0]], 9, axis=1)
    given = grouped(position, normals, np.array([0] * 4 + [2] * 5), 3)
    found = area_lights(lights_at(position, normals), given, settings.area)
    assert all(np.isfinite(part).all() for part in found)
    assert found.delta.tolist() == [0.0, 0.0, 0.0]
    assert found.radius.tolist() == [0.0, 0.0, 0.5]
    assert found.side[:, 2].max() == pytest.approx(1.5 if unbiased else 1.0, abs=ROUNDING)
    none = area_lights(lights_at(position[:, :0], normals[:, :0]),
                       cluster(position[:, :0], normals[:, :0], 5, diagonal=1.0), settings.area)
    assert none.delta.shape == (0,)
    assert none.frame.shape == (0, 3, 3)


@pytest.mark.parametrize("axes", ["pca", "min_area"])
def test_lights_in_a_row_have_no_width_whatever_their_rounding(axes):
    """Else rounding would decide whether the area light casts a hard shadow."""
    rng = np.random.default_rng(4)
    along, start = rng.normal(size=(3, 40, 1)), rng.normal(size=(3, 40, 1))
    across = rng.normal(size=(3, 40))
    normals = np.cross(along[..., 0], across, axis=0)
    normals = np.repeat(normals / np.linalg.norm(normals, axis=0), 3, axis=1)
    position = (start + along * np.array([0.0, 0.3, 1.0])).reshape(3, -1).astype(np.float32).astype(np.float64)
    given = grouped(position, normals, np.arange(120) // 3, 40)
    found = area_lights(lights_at(position, normals), given, replaced(PUBLISHED, {"axes": axes}).area)
    assert not found.delta.any()
    assert (found.side.max(axis=0) > 0.1).all()
