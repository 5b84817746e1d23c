"""What closest and mean texels do to coverage and to the flux that leaves a picture."""

import numpy as np
import pytest

from tests.sssil.pyramid.pictures import FLOAT64, camera, made, random_picture

SIZE = 512
STANDARD_ERRORS = 4.0  # a chance of 6e-5 to fail for a seed


def flux(level):
    return (level.radiance.astype(float) * level.area).sum(axis=(1, 2))


@pytest.mark.feature("HSS-09")
def test_foreground_grows_by_the_law_of_coverage(evidence):
    """Random foreground of share q covers 1 - (1 - q)^(4^k) of level k."""
    q, rng, figures = 0.1, np.random.default_rng(5), []
    before = rng.random((SIZE, SIZE)) < q
    _, _, albedo, direct = random_picture(SIZE, SIZE)
    normal = np.zeros((3, SIZE, SIZE))
    normal[2] = 1
    picture = (np.where(before, 1.0, 2.0), normal, albedo, direct)
    for level in made(picture, camera(SIZE, SIZE), 0, 4, dtype=np.float32):
        expected = 1 - (1 - q) ** (4.0**level.number)
        deviation = np.sqrt(expected * (1 - expected) / level.area.size)
        share = (level.depth == 1.0).mean()
        assert abs(share - expected) <= STANDARD_ERRORS * deviation
        figures.append(f"{share:.3f} ({expected:.3f})")
    evidence(f"q = 0.1 at levels 0 to 3 (law): {', '.join(figures)}")


@pytest.mark.feature("HSS-09")
def test_means_keep_the_flux(evidence):
    """The sum of radiance times area is that of the pixels at every level; that of the closest is not."""
    picture, view = random_picture(83, 45), camera(83, 45)
    expected = flux(made(picture, view, 0, 1)[0])
    for first in range(3):
        for level in made(picture, view, first, 5, "average"):
            np.testing.assert_allclose(flux(level), expected, rtol=FLOAT64)
    closest = [float((flux(level) / expected).mean()) for level in made(picture, view, 0, 4)]
    assert abs(closest[0] - 1) < FLOAT64
    assert abs(closest[3] - 1) > 0.1
    evidence(f"average: flux equal to {FLOAT64:g}; closest: {', '.join(f'{share:.2f}' for share in closest)} of it")


def test_mean_radiance_is_that_of_the_pixels_with_a_surface():
    depth, normal, albedo, direct = random_picture(16, 16)
    level = made((depth, normal, albedo, direct), camera(16, 16), 0, 5, "closest_average")[4]
    seen = depth < np.inf
    assert level.shape == (1, 1)
    np.testing.assert_allclose(level.radiance[:, 0, 0], (albedo * direct / np.pi)[:, seen].mean(axis=1), rtol=FLOAT64)
    assert level.depth[0, 0] == depth.min()


def test_a_texel_without_area_shows_its_closest_pixel():
    """Normals that look away send nothing, but receive."""
    depth, normal, albedo, direct = random_picture(4, 4, behind=0.0)
    closest = made((depth, -normal, albedo, direct), camera(4, 4), 0, 3)
    for level, expected in zip(made((depth, -normal, albedo, direct), camera(4, 4), 0, 3, "average"), closest,
                               strict=True):
        assert (level.area == 0).all()
        assert np.array_equal(level.position, expected.position)
        assert np.array_equal(level.normal, expected.normal)
