"""Emissive textures: what the camera sees of them, that they light nothing, and what files say of them."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.provenance.record import materials_digest
from refgi.scene import Image, Material, Scene, Texture, load_scene
from refgi.settings import of
from refgi.truth.vpl import VplSettings, vpl
from tests.naive import textures as naive
from tests.scene.texture.test_files import CODES, PNG, texture_of, textured
from tests.textured import room

PICTURE = np.random.default_rng(3).random((5, 7, 3)).astype(np.float32)
EMISSION = (2.0, 3.0, 0.5)
ROUNDING = 1e-5  # float32


def glowing(texture: Texture | None = None) -> Scene:
    """The room of two colours, its back wall aglow."""
    scene = room("bilinear")
    paint = dataclasses.replace(scene.materials[1], emission=EMISSION, emission_texture=texture)
    return dataclasses.replace(scene, materials=(scene.materials[0], paint))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_camera_sees_the_picture_times_the_emission(dtype: type) -> None:
    texture = Texture(Image(PICTURE), ("clamp", "clamp"), "bilinear")
    frame, dark = Frame(glowing(texture), dtype=dtype), Frame(room("bilinear"), dtype=dtype)
    emitted, position = frame.radiance() - dark.radiance(), frame.gbuffer.position
    wall = frame.gbuffer.material_id == 1
    assert wall.sum() > 200
    assert np.abs(emitted[:, ~wall]).max() == 0
    for row, column in np.argwhere(wall)[::7]:
        x, y, _ = position[:, row, column]
        expected = naive.bilinear(PICTURE, ("clamp", "clamp"), (x + 1) / 2, 1 - y / 2) * EMISSION
        np.testing.assert_allclose(emitted[:, row, column], expected, rtol=100 * ROUNDING, atol=ROUNDING)


def test_a_texture_of_one_colour_is_that_colour() -> None:
    grey = Texture(Image(np.full((3, 5, 3), 0.5, np.float32)))
    plain = glowing()
    half = dataclasses.replace(plain.materials[1], emission=tuple(0.5 * c for c in EMISSION))
    plain = dataclasses.replace(plain, materials=(plain.materials[0], half))
    np.testing.assert_allclose(Frame(glowing(grey)).radiance(), Frame(plain).radiance(), rtol=ROUNDING)


def test_it_lights_nothing() -> None:
    texture = Texture(Image(PICTURE))
    one, other = (vpl(Frame(scene, rsm_resolution=32), of(VplSettings, lights=20))
                  for scene in (glowing(texture), room("bilinear")))
    np.testing.assert_array_equal(one, other)


def test_another_picture_is_another_scene() -> None:
    texture = Texture(Image(PICTURE))
    digests = {materials_digest(scene) for scene in (glowing(), glowing(texture), glowing(Texture(Image(PICTURE[:4]))))}
    assert len(digests) == 3
    with pytest.raises(InputError, match="emission_texture: expected a Texture or None"):
        Material(emission_texture="glow.png")
    with pytest.raises(InputError, match="texture coordinates for the textures of 1 material"):
        dataclasses.replace(glowing(texture), geometry=dataclasses.replace(glowing(texture).geometry, uv=None),
                            materials=(Material(), dataclasses.replace(glowing(texture).materials[1], texture=None)))


def edited(tmp_path: Path, **keys: Any) -> Path:
    def edit(tree: dict[str, Any]) -> None:
        tree["materials"][0] |= {"emissiveFactor": [1.0, 0.5, 0.25], "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}, **keys}
        if keys.get("alone"):
            del tree["materials"][0]["alone"], tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]

    return textured(tmp_path, edit, image=PNG)


@pytest.mark.filterwarnings("ignore:.* 1 emissive surface lights nothing here")
def test_gltf(tmp_path: Path) -> None:
    scene = load_scene(edited(tmp_path, emissiveTexture={"index": 0}))
    found = scene.materials[0]
    assert found.emission == (4.0, 2.0, 1.0)  # times the strength of 4
    assert found.emission_texture == texture_of(scene)
    assert np.array_equal(found.emission_texture.image.pixels, CODES)
    alone = load_scene(edited(tmp_path, emissiveTexture={"index": 0, "texCoord": 1}, alone=True))
    assert alone.materials[0].texture is None
    assert alone.materials[0].emission_texture is not None
    assert alone.geometry.uv.max() == 2.0  # of the second set
    dark = load_scene(edited(tmp_path, emissiveTexture={"index": 0}, emissiveFactor=[0, 0, 0]))
    assert dark.materials[0].emission_texture is None


@pytest.mark.filterwarnings("ignore:.* 1 emissive surface lights nothing here")
def test_gltf_that_lies_other_than_the_base_colour_is_passed_over(tmp_path: Path) -> None:
    for change in ({"texCoord": 1}, {"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}):
        with pytest.warns(RefgiWarning, match="emissive textures, which lie other than the base colour's, passed over"):
            scene = load_scene(edited(tmp_path, emissiveTexture={"index": 0, **change}))
        assert scene.materials[0].emission_texture is None
        assert scene.materials[0].emission == (4.0, 2.0, 1.0)  # times the strength of 4
