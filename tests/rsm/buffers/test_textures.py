"""Textures on maps: coordinates in perspective, the mean over pixels of a checkered floor, flux of a light's texels."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.rsm.buffers import textures
from refgi.rsm.buffers.gbuffer import values_at
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection, camera_projection
from refgi.scene import DirectionalLight, Image, Material, PointLight, Scene, SpotLight, material_table
from refgi.scene.texture.footprint import MOST, PLACE, TOGETHER, looks
from tests.naive import textures as naive
from tests.textured import CHECKS, EYE, HALF, PITCH, VFOV, checker, floor, room

PERSPECTIVE = 1e-6  # of coordinates up to 10, against Cramer's rule in float64
TWIN = 1e-6  # of albedo up to 1: float32 texels and mip levels
CHECKER = 0.02  # root of the mean square over all pixels of the floor, of a contrast of 1
WITHIN = 0.02  # a pixel is wrong by no more
RARE = 0.06  # ... but for this share of them, through which an edge runs
STEP = 1e-4  # of a texel, for differences of the twin


def rays(projection: Projection, row: float, column: float) -> tuple[np.ndarray, np.ndarray]:
    """Origin and direction through a place on one map, by the definitions on the page of conventions."""
    x = (2 * (column + 0.5) / projection.width - 1) * projection.half[0]
    y = (2 * (row + 0.5) / projection.height - 1) * projection.half[1]
    right, down, forward = projection.frame[0]
    origin = projection.origin[0]
    if projection.kind == ORTHOGRAPHIC:
        return origin + x * right + y * down, forward
    if projection.kind == PARABOLOID:  # the bisector of the axis and the direction runs through (x, y, 1)
        half = np.array([x, y, 1]) / math.sqrt(x * x + y * y + 1)
        local = 2 * half[2] * half - np.array([0, 0, 1.0])
        return origin, local[0] * right + local[1] * down + local[2] * forward
    return origin, x * right + y * down + forward


def literal(scene: Scene, projection: Projection, face: int, row: float, column: float) -> np.ndarray:
    """u and v of a texel by barycentric coordinates."""
    corners = scene.geometry.vertices[scene.geometry.faces[face]]
    return naive.barycentric(corners, *rays(projection, row, column)) @ scene.geometry.uv[face]


def place(scene: Scene, projection: Projection, face: int, row: int, column: int) -> np.ndarray:
    """u, v and their changes, by differences of the twin."""
    def along(rows: float, columns: float) -> np.ndarray:
        ahead = literal(scene, projection, face, row + rows, column + columns)
        return (ahead - literal(scene, projection, face, row - rows, column - columns)) / (2 * STEP)

    return np.concatenate([literal(scene, projection, face, row, column), along(0, STEP), along(STEP, 0)])


def projections(scene: Scene) -> dict[str, Projection]:
    wide = SpotLight((0.4, 2.0, 3.0), (0.1, -1, 0.2), math.radians(70), math.radians(80), (1, 1, 1))
    narrow = SpotLight((0.4, 2.0, 3.0), (0.1, -1, 0.5), 0.3, 0.6, (1, 1, 1))
    sun = DirectionalLight((0.3, -1, 0.2), (1, 1, 1))
    return {"camera": camera_projection(scene.camera), **{
        name: light_projection(light, scene.geometry, 24, "auto")
        for name, light in (("wide", wide), ("narrow", narrow), ("sun", sun))}}


@pytest.mark.feature("REF-23")
@pytest.mark.parametrize("view", ["camera", "wide", "narrow", "sun"])
def test_coordinates_are_those_of_the_ray_s_barycentrics(view: str, evidence: Callable[[str], None]) -> None:
    scene = floor(size=(48, 36), up=(0.3, 1.0, 0.1))
    projection = projections(scene)[view]
    surface = textures.painted(scene.geometry, material_table(scene.materials))
    assert surface is not None
    pixels = looks().pixel
    found = pixels[PLACE * TOGETHER :].reshape(6, TOGETHER)
    worst = slope = 0.0
    for row in range(projection.height * 2 // 3, projection.height, 3):
        for face in (0, 1):
            textures.fill_places(surface, projection, face, (row, 0, projection.width), 0, pixels)
            for column in range(0, projection.width, 5):
                expected = place(scene, projection, face, row, column)
                worst = max(worst, np.abs(found[:2, column] - expected[:2]).max())
                slope = max(slope, np.abs(found[2:, column] - expected[2:]).max() / np.abs(expected[2:]).max())
    evidence(f"{view}: {worst:.1e} of coordinates, {slope:.1e} of their changes")
    assert worst <= PERSPECTIVE
    # central differences over a texel of a paraboloid's rays, which bend
    assert slope <= (5e-3 if view == "wide" else 1e-5)


@pytest.mark.feature("REF-23")
@pytest.mark.parametrize("chosen", ["nearest", "bilinear", "trilinear"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_albedo_equals_the_twin(chosen: str, dtype: type, evidence: Callable[[str], None]) -> None:
    picture = np.random.default_rng(8).random((24, 40, 3)).astype(np.float32)
    scene = floor(chosen, (48, 36), Image(picture), up=(0.2, 1.0, 0.0))
    factor = Material("floor", (0.5, 0.25, 1.0), texture=scene.materials[0].texture)
    scene = dataclasses.replace(scene, materials=(factor,))
    frame = Frame(scene, dtype=dtype)
    albedo, ids = frame.gbuffer.albedo, frame.gbuffer.triangle_id
    projection, worst = camera_projection(scene.camera), 0.0
    assert albedo.dtype == dtype
    assert not albedo[:, ids < 0].any()
    for row, column in np.argwhere(ids >= 0)[::11]:
        at = place(scene, projection, ids[row, column], row, column)
        look = {"nearest": naive.nearest, "bilinear": naive.bilinear}.get(chosen)
        wrap = ("repeat", "repeat")
        expected = look(picture, wrap, *at[:2]) if look else naive.footprint(picture, wrap, at, MOST)
        worst = max(worst, np.abs(albedo[:, row, column] - expected * [0.5, 0.25, 1.0]).max())
    evidence(f"{chosen}, {np.dtype(dtype).name}: {worst:.1e}")
    assert worst <= (TWIN if chosen != "trilinear" else 1e-5)  # levels by differences of the twin


def triangle_wave(x: np.ndarray) -> np.ndarray:
    """Integral of the wave that is 1 from 0 to 1, -1 from 1 to 2, and so on."""
    x = np.mod(x, 2.0)
    return np.where(x < 1, x, 2 - x)


def floor_means(width: int, height: int, lines: int = 2048) -> np.ndarray:
    """Mean albedo of each pixel: exact along lines of equal depth, of which each row of pixels has many."""
    tangent, means = math.tan(VFOV / 2), np.full((height, width), np.nan)
    edges = (np.arange(width + 1) / width * 2 - 1) * tangent * width / height
    for row in range(height):
        up = (1 - 2 * (row + (np.arange(lines) + 0.5) / lines) / height) * tangent
        falling, ahead = up * math.cos(PITCH) - math.sin(PITCH), math.cos(PITCH) + up * math.sin(PITCH)
        if (falling >= -1e-9).any():
            continue
        depth = -EYE[1] / falling
        across = (EYE[0] + depth[:, None] * edges + HALF) * CHECKS
        sign = np.where(np.mod((HALF - EYE[2] + depth * ahead) * CHECKS, 2) < 1, 1.0, -1.0)
        wave = np.diff(triangle_wave(across), axis=1) / np.diff(across, axis=1)
        means[row] = 0.5 + 0.5 * (sign[:, None] * wave).mean(axis=0)
    return means


@pytest.mark.feature("REF-23")
def test_a_checkered_floor_is_the_mean_over_each_pixel(evidence: Callable[[str], None]) -> None:
    exact = floor_means(160, 120)
    error = {}
    for chosen in ("nearest", "bilinear", "trilinear"):
        buffer = Frame(floor(chosen), dtype=np.float64).gbuffer
        seen = (buffer.triangle_id >= 0) & ~np.isnan(exact)
        seen[:-1] &= seen[1:]  # the far edge of the floor
        error[chosen] = (buffer.albedo[0] - exact)[seen]
    size = {chosen: float(np.sqrt((one**2).mean())) for chosen, one in error.items()}
    off = np.abs(error["trilinear"])
    evidence(f"root mean square {size['trilinear']:.2%} (bilinear {size['bilinear']:.0%}, nearest "
             f"{size['nearest']:.0%}), mean {off.mean():.2%}, over 2 % in {(off > WITHIN).mean():.1%} of pixels, "
             f"worst {off.max():.1%}")
    assert size["trilinear"] <= CHECKER
    assert (off > WITHIN).mean() <= RARE
    assert abs(error["trilinear"].mean()) <= 1e-3
    assert size["bilinear"] > 5 * CHECKER


@pytest.mark.feature("REF-23")
def test_the_farthest_rows_see_no_moire() -> None:
    """Pixels there cover up to 16 squares in depth and less than one across."""
    exact, buffer = floor_means(160, 120), Frame(floor(), dtype=np.float64).gbuffer
    first = int(np.argmax((buffer.triangle_id >= 0).all(axis=1))) + 1
    error = (buffer.albedo[0] - exact)[first : first + 10, 40:120]
    assert np.sqrt((error**2).mean()) <= CHECKER
    assert np.abs(error).max() <= 0.05


@pytest.mark.parametrize("light", [
    SpotLight((0.2, 3.0, 15.0), (0.1, -1, 0.1), 0.4, 0.6, (1, 1, 1)),
    SpotLight((0.2, 3.0, 15.0), (0.1, -1, 0.1), 1.3, 1.45, (1, 1, 1)), PointLight((0.2, 3.0, 15.0), (1, 1, 1)),
    DirectionalLight((0.1, -1, 0.2), (1, 1, 1)),
])
def test_some_texels_have_the_bits_of_the_whole_map(light: object) -> None:
    scene = floor().with_lights(light)  # type: ignore[arg-type]
    whole, parts = (Frame(scene, rsm_resolution=64).rsms[0] for _ in range(2))
    texel = np.random.default_rng(3).permutation(whole.texels)[: whole.texels // 16]
    expected = values_at(whole.flux, texel), values_at(whole.albedo, texel)
    found = *parts.at(texel, "flux"), *parts._view.at(texel, "albedo")
    assert all(map(np.array_equal, found, expected))


@pytest.mark.feature("REF-23")
def test_flux_of_a_light_s_texel_is_its_mean_and_a_point_of_it_is_noise(evidence: Callable[[str], None]) -> None:
    """A checker with squares of 1/8 of a texel of the map: its mean is 1/2, whatever the texel."""
    noise = {}
    for chosen in ("nearest", "bilinear", "trilinear"):
        scene = floor(chosen, image=checker(80, 4))
        squares = 2 * HALF * CHECKS * 10
        frame = Frame(scene, rsm_resolution=round(squares / 8) - 3, dtype=np.float64)
        rsm = frame.rsms[0]
        inside = rsm.covered.copy()
        inside[[0, -1]] = inside[:, [0, -1]] = False
        shares = rsm.flux[0][inside] / (0.5 * rsm.solid_angle[inside] * 3.0)  # of that of the mean albedo
        noise[chosen] = float(shares.std())
        assert abs(shares.mean() - 1) < 0.1
    evidence(f"deviation of a texel's flux from its mean {noise['trilinear']:.2%}; of point samples "
             f"{noise['bilinear']:.0%} (bilinear), {noise['nearest']:.0%} (nearest)")
    assert noise["trilinear"] <= WITHIN
    assert noise["nearest"] >= 0.9


def test_albedo_without_texture_is_left_alone_and_no_kernel_of_textures_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = room()
    painted = Frame(scene).gbuffer
    painted.resolve("albedo", "depth", "normal", "position", "material_id")
    plain = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, texture=None) for one in scene.materials))
    monkeypatch.setattr(textures, "_paint_rows", lambda *_: pytest.fail("textures of a scene without any"))
    monkeypatch.setattr(textures, "_paint_texels", lambda *_: pytest.fail("textures of a scene without any"))
    frame = Frame(plain)
    white = frame.gbuffer.material_id != 1
    assert not white.all()
    assert np.array_equal(painted.albedo[:, white], frame.gbuffer.albedo[:, white])
    frame.rsms[0].at(np.arange(5), "flux")
    for name in ("depth", "normal", "position", "material_id"):
        assert np.array_equal(getattr(painted, name), getattr(frame.gbuffer, name))


def test_the_picture_stands_upright() -> None:
    quarters = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    albedo = Frame(room("nearest", Image(quarters))).gbuffer.albedo
    assert albedo[:, 17, 17].tolist() == [1, 0, 0]
    assert albedo[:, 17, 23].tolist() == [0, 1, 0]
    assert albedo[:, 23, 17].tolist() == [0, 0, 1]
