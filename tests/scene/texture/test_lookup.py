"""Look-ups against literal twins: wraps, filters, levels, footprints, and coordinates of points."""

import itertools
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.scene import Image, Texture
from refgi.scene.texture.footprint import MOST, PLACE, TOGETHER, Looks, footprint_means, looks
from refgi.scene.texture.lookup import bilinear, coordinates_at, nearest, point_sample
from refgi.scene.texture.table import Textures, textures_of
from tests.naive import textures as naive

RNG = np.random.default_rng(9)
ROUNDING = 1e-12  # of weights of float64 times texels below 1; the texels themselves are float32 in both
BLENDS = 1e-6  # mip levels are stored, blends are added up in float32: 2^-24 for each of some 10 looks
WRAPS = ("repeat", "clamp", "mirror")
PLACES = [*RNG.uniform(-3.2, 3.2, (60, 2)).tolist(), (0.0, 0.0), (1.0, 1.0), (-1.0, 2.0), (0.5, -0.5), (0.25, 0.75),
          (1 - 1e-17, -1e-17), (-1e-17, 1e-17)]


def image(height: int, width: int) -> Image:
    return Image(RNG.random((height, width, 3)).astype(np.float32))


@pytest.mark.feature("REF-22", "REF-24")
@pytest.mark.parametrize("size", [(4, 8), (5, 7), (1, 1), (1, 6), (3, 2)])
@pytest.mark.parametrize("wrap", [*itertools.product(WRAPS, WRAPS)])
def test_points_equal_the_twin(size: tuple[int, int], wrap: tuple[str, str]) -> None:
    picture = image(*size)
    for name, look, literal in (("nearest", nearest, naive.nearest), ("bilinear", bilinear, naive.bilinear)):
        table = Textures([None, Texture(picture, wrap, name)]).table  # type: ignore[arg-type]
        assert table.of_material.tolist() == [-1, 0]
        for u, v in PLACES:
            expected = literal(picture.pixels, wrap, u, v)
            found = look(table, 0, u, v) if name == "nearest" else look(table, 0, 0, u, v)
            assert np.abs(np.subtract(found, expected)).max() <= ROUNDING
            assert found == point_sample(table, 0, u, v)


@pytest.mark.feature("REF-23")
def test_centres_of_texels_lie_half_a_texel_in_and_row_0_at_v_0() -> None:
    picture = image(3, 5)
    table = Textures([Texture(picture)]).table
    for j, i in itertools.product(range(3), range(5)):
        assert np.allclose(bilinear(table, 0, 0, (i + 0.5) / 5, (j + 0.5) / 3), picture.pixels[j, i], atol=1e-7)


def footprints(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    place = rng.uniform(-2, 2, (6, count))
    place[2:] *= 2.0 ** rng.uniform(-9, 1, (4, count))
    place[2:, ::5] = np.abs(place[2:, ::5]).max(axis=0) * [[1], [0], [0], [1e-3]]  # long and thin
    place[2:, 1::7] = 0
    return place


def at(place: np.ndarray) -> Looks:
    """Scratch with pixels at these coordinates, (6, n)."""
    scratch: Looks = looks()
    scratch.pixel[PLACE * TOGETHER :].reshape(6, TOGETHER)[:, : place.shape[1]] = place
    return scratch


@pytest.mark.feature("REF-23")
@pytest.mark.parametrize("size", [(16, 16), (9, 14), (1, 1)])
@pytest.mark.parametrize("wrap", [("repeat", "repeat"), ("mirror", "clamp")])
def test_means_over_footprints_equal_the_twin(size: tuple[int, int], wrap: tuple[str, str]) -> None:
    picture, place = image(*size), footprints(60, 3)
    table = Textures([Texture(picture, wrap)]).table  # type: ignore[arg-type]
    colour = np.full((60, 3), np.nan, np.float32)
    texture = np.zeros(60, np.int32)
    texture[10] = -1
    footprint_means(table, texture, 59, at(place), colour)
    assert not colour[10].any()
    assert np.isnan(colour[59]).all()
    for k in set(range(59)) - {10}:
        assert np.abs(colour[k] - naive.footprint(picture.pixels, wrap, place[:, k], MOST)).max() <= BLENDS


@pytest.mark.feature("REF-23")
@pytest.mark.parametrize("chosen", ["nearest", "bilinear"])
def test_other_filters_look_at_the_middle_of_a_footprint(chosen: str) -> None:
    picture, place = image(6, 7), footprints(40, 4)
    table = Textures([Texture(picture, filter=chosen)]).table  # type: ignore[arg-type]
    colour = np.empty((40, 3), np.float32)
    footprint_means(table, np.zeros(40, np.int32), 40, at(place), colour)
    literal = {"nearest": naive.nearest, "bilinear": naive.bilinear}[chosen]
    expected = [literal(picture.pixels, ("repeat", "repeat"), u, v) for u, v in place[:2].T]
    assert np.abs(colour - expected).max() <= BLENDS


def test_what_is_seen_edge_on_or_from_far_is_the_mean_and_no_number_breaks_a_look_up() -> None:
    picture = image(5, 6)
    table = Textures([Texture(picture)]).table
    place = np.zeros((6, 5))
    place[2:, 0], place[2:, 1], place[2:, 2] = np.inf, 1e300, [1e9, 0, 0, 1e9]
    place[2:, 3] = np.nan
    place[:2, 4] = 1e200
    colour = np.full((5, 3), np.nan, np.float32)
    footprint_means(table, np.zeros(5, np.int32), 5, at(place), colour)
    assert np.allclose(colour[:4], picture.pixels.mean(axis=(0, 1)), atol=1e-6)
    assert ((colour[4] >= 0) & (colour[4] <= 1)).all()


def test_images_are_stored_once_and_equal_materials_share_a_table() -> None:
    first, second = image(4, 4), image(2, 3)
    textures = [Texture(first), None, Texture(first, ("clamp", "clamp")), Texture(second), Texture(first)]
    made = textures_of(textures)
    assert made is not None
    assert made.table.of_material.tolist() == [0, -1, 1, 2, 0]
    assert len(made.table.texels) == (16 + 4 + 1) + (6 + 1)
    assert made.table.level.tolist() == [[0, 4, 4], [16, 2, 2], [20, 1, 1], [21, 3, 2], [27, 1, 1]]
    assert textures_of([Texture(Image(first.pixels)), *textures[1:]]) is made
    assert textures_of([None, None]) is None


@pytest.mark.feature("REF-23")
def test_coordinates_of_points_are_those_of_barycentrics() -> None:
    for _ in range(20):
        vertices, uv = RNG.normal(size=(3, 3)), RNG.normal(size=(1, 3, 2))
        weight = RNG.dirichlet((1, 1, 1))
        found = coordinates_at(vertices, np.array([[0, 1, 2]], np.int32), uv, 0, *(weight @ vertices))
        assert np.allclose(found, weight @ uv[0], rtol=0, atol=1e-11)  # of needles
    flat = np.zeros((3, 3))
    assert coordinates_at(flat, np.array([[0, 1, 2]], np.int32), uv, 0, 0.0, 0.0, 0.0) == tuple(uv[0, 0])
    assert math.isfinite(uv.sum())


@pytest.mark.parametrize(("change", "said"), [
    ({"wrap": ("repeat", "border")}, "texture: wrap"), ({"wrap": "repeat"}, "texture: wrap"),
    ({"filter": "cubic"}, "texture: filter"), ({"image": 3}, "texture: image"),
])
def test_what_is_no_texture_is_refused(change: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Texture(**{"image": image(1, 1), **change})  # type: ignore[arg-type]
