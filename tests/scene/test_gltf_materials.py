"""glTF: what materials and extensions say is honoured, or one warning names it with its count."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.methods import render
from refgi.provenance.record import materials_digest
from refgi.scene import Material, load_scene
from tests.scene.samples import glb_bytes, gltf_tree

DIFFUSE = {"metallicFactor": 0}
GLOSS = "KHR_materials_pbrSpecularGlossiness"
TRANSMISSION, VOLUME = "KHR_materials_transmission", "KHR_materials_volume"


def loaded(folder: Path, *materials: dict[str, Any], **changes: Any) -> tuple[tuple[Material, ...], list[str]]:
    """Return the materials of a square for each, and the warnings without the file's name."""
    tree = gltf_tree() | {"materials": list(materials)} | changes
    first, = tree["meshes"][0]["primitives"]
    tree["meshes"][0]["primitives"] = [first | {"material": k} for k in range(len(materials))]
    path = folder / "square.glb"
    path.write_bytes(glb_bytes(tree))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = load_scene(path)
    assert all(one.category is RefgiWarning for one in said)
    return scene.materials, sorted(str(one.message).removeprefix(f"{path}: ") for one in said)


def extended(**extensions: dict[str, Any]) -> dict[str, Any]:
    return {"pbrMetallicRoughness": dict(DIFFUSE), "extensions": extensions}


def test_a_primitive_without_material_is_white(tmp_path: Path) -> None:
    tree = gltf_tree()
    del tree["meshes"][0]["primitives"][0]["material"]
    path = tmp_path / "square.glb"
    path.write_bytes(glb_bytes(tree))
    assert load_scene(path).materials[0].diffuse == (1, 1, 1)


def test_metal_and_gloss_are_said(tmp_path: Path) -> None:
    materials, said = loaded(
        tmp_path, {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1]}}, {},
        {"pbrMetallicRoughness": {"metallicFactor": 0.5, "roughnessFactor": 0.5}}, {"pbrMetallicRoughness": DIFFUSE})
    assert materials[0].diffuse == (0.2, 0.4, 0.6)
    assert said == ["1 material(s) with roughnessFactor below 1 taken as diffuse: no gloss",
                    "3 material(s) of metal (metallicFactor, 1 where absent) taken as diffuse in their base colour"]


def test_specular_and_glossiness_are_diffuse_and_a_lobe(tmp_path: Path) -> None:
    """c_diff = diffuse (1 - max(specular)); the lobe of alpha = (1 - 0.5)^2 has P = 2 / alpha^2 - 2 = 30."""
    lobed = {"diffuseFactor": [0.8, 0.4, 0.2, 1], "specularFactor": [0.1, 0.25, 0.05], "glossinessFactor": 0.5}
    materials, said = loaded(tmp_path, {"extensions": {GLOSS: lobed}}, {"extensions": {GLOSS: {
        "diffuseFactor": [0.3, 0.2, 0.1, 1], "specularFactor": [0, 0, 0]}}}, extensionsRequired=[GLOSS])
    assert materials[0].diffuse == pytest.approx((0.6, 0.3, 0.15))
    assert (materials[0].specular, materials[0].exponent) == ((0.1, 0.25, 0.05), 30)
    assert (materials[1].diffuse, materials[1].is_glossy) == ((0.3, 0.2, 0.1), False)
    assert said == []


def test_specular_that_is_not_told_or_an_image_leaves_the_diffuse_part(tmp_path: Path) -> None:
    factor = {"diffuseFactor": [0.8, 0.05, 0.05, 1]}
    materials, said = loaded(tmp_path, {"extensions": {GLOSS: factor}}, {"extensions": {GLOSS: factor | {
        "specularFactor": [1, 1, 1], "specularGlossinessTexture": {"index": 0}}}})
    assert [(one.diffuse, one.is_glossy) for one in materials] == [((0.8, 0.05, 0.05), False)] * 2
    assert said == ["1 material(s) without specularFactor (a mirror by the extension) taken as diffuse",
                    "1 material(s)' specularGlossinessTexture passed over"]


def test_a_solid_that_transmits_is_glass(tmp_path: Path) -> None:
    solid = {TRANSMISSION: {"transmissionFactor": 1}, VOLUME: {"thicknessFactor": 0.2}}
    smooth = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0}}
    (clear, dense, tinted), said = loaded(
        tmp_path, smooth | {"name": "clear", "extensions": solid},
        smooth | {"name": "dense", "extensions": solid | {"KHR_materials_ior": {"ior": 2.4}}},
        {"name": "tinted", "pbrMetallicRoughness": smooth["pbrMetallicRoughness"] | {
            "baseColorFactor": [0.9, 0.2, 0.2, 1]}, "extensions": solid})
    assert [one.ior for one in (clear, dense, tinted)] == [1.5, 2.4, 1.5]
    assert said == [f"1 material(s) of {TRANSMISSION} taken as clear, smooth glass"]


@pytest.mark.parametrize("extensions", [
    {TRANSMISSION: {"transmissionFactor": 1}},
    {TRANSMISSION: {"transmissionFactor": 0.3}, VOLUME: {"thicknessFactor": 1}}])
def test_what_transmits_and_is_no_solid_is_opaque_and_said(tmp_path: Path, extensions: dict[str, Any]) -> None:
    (material,), said = loaded(tmp_path, extended(**extensions))
    assert not material.is_dielectric
    assert said == [f"1 material(s) of {TRANSMISSION} opaque: metal, without a volume, or less than half transparent"]


def test_unlit_is_said(tmp_path: Path) -> None:
    _, said = loaded(tmp_path, {"extensions": {"KHR_materials_unlit": {}}}, {})
    assert said == ["1 material(s) of KHR_materials_unlit lit as others: diffuse in their base colour",
                    "1 material(s) of metal (metallicFactor, 1 where absent) taken as diffuse in their base colour"]


def test_each_extension_that_is_passed_over_is_named_once_with_its_count(tmp_path: Path) -> None:
    coat, sheen = {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}, {"KHR_materials_sheen": {}}
    used = ["KHR_materials_clearcoat", "KHR_materials_sheen", "KHR_materials_anisotropy", "KHR_materials_variants",
            "KHR_lights_punctual"]
    _, said = loaded(tmp_path, extended(**coat, **sheen), extended(**coat) | {"doubleSided": True},
                     extensionsUsed=used)
    assert said == ["1 use(s) of the extension KHR_materials_sheen passed over",
                    "2 use(s) of the extension KHR_materials_clearcoat passed over"]


def test_core_features_that_are_passed_over_are_said(tmp_path: Path) -> None:
    tree = gltf_tree()
    tree["extensions"]["KHR_lights_punctual"]["lights"][0]["range"] = 3
    scenes = [*tree["scenes"], {"nodes": []}, {"nodes": []}]
    _, said = loaded(tmp_path, {"pbrMetallicRoughness": DIFFUSE, "occlusionTexture": {"index": 0}},
                     animations=[{}, {}], extensions=tree["extensions"], scenes=scenes)
    assert said == ["1 light(s)' range (light falls with the square of the distance) passed over",
                    "1 material(s)' occlusionTexture passed over", "2 animation(s) passed over",
                    "2 scene(s) beside the first or default one passed over"]


@pytest.mark.parametrize("name", ["KHR_materials_variants", "KHR_xmp_json_ld", "EXT_mesh_features", TRANSMISSION])
def test_required_extensions_that_are_read_or_change_no_light_are_accepted(tmp_path: Path, name: str) -> None:
    _, said = loaded(tmp_path, extended(), extensionsRequired=[name], extensionsUsed=[name])
    assert said == []


def test_compressed_meshes_are_named_with_what_unpacks_them(tmp_path: Path) -> None:
    tree = gltf_tree() | {"extensionsRequired": ["KHR_draco_mesh_compression"]}
    tree["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    path = tmp_path / "packed.gltf"
    (tmp_path / "packed.glb").write_bytes(glb_bytes(tree))
    assert load_scene(tmp_path / "packed.glb").face_count == 2  # what is there uncompressed as well is read
    del tree["accessors"][0]["bufferView"]
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"primitives\[0\]: Draco-compressed meshes .*`gltf-transform copy IN OUT`"):
        load_scene(path)
    tree = gltf_tree() | {"extensionsRequired": ["EXT_meshopt_compression"]}
    tree["buffers"] = [{"byteLength": 60, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}]
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"buffers\[0\]: meshopt-compressed .*`gltf-transform copy IN OUT` unpacks"):
        load_scene(path)


@pytest.mark.parametrize(("name", "what"), [
    ("KHR_texture_basisu", "KTX2 .*ktxdecompress"), ("EXT_texture_webp", "WebP .*gltf-transform png"),
    ("EXT_texture_avif", "AVIF .*gltf-transform png"), ("MSFT_texture_dds", "DDS .*magick")])
def test_images_of_other_formats_are_named_with_what_unpacks_them(tmp_path: Path, name: str, what: str) -> None:
    tree = gltf_tree() | {"extensionsRequired": [name], "textures": [{"extensions": {name: {"source": 0}}}],
                          "images": [{"uri": "a.bin"}]}
    tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    path = tmp_path / "square.glb"
    path.write_bytes(glb_bytes(tree))
    with pytest.raises(InputError, match=rf"textures\[0\]\.source: {what}"):
        load_scene(path)


def test_the_strength_of_emission_multiplies(tmp_path: Path) -> None:
    (material,), said = loaded(tmp_path, extended(KHR_materials_emissive_strength={"emissiveStrength": 5}) | {
        "emissiveFactor": [1, 0.5, 0]})
    assert material.emission == (5, 2.5, 0)
    assert [text.partition(",")[0] for text in said] == ["1 emissive surface lights nothing here"]


@pytest.mark.parametrize(("turned", "changes", "share"), [
    (False, {}, None), (True, {}, "100"), (True, {"doubleSided": False}, "100"), (True, {"doubleSided": True}, None),
    (True, None, "100")])
def test_backs_that_the_file_leaves_out_are_said_where_they_are_seen(
    tmp_path: Path, turned: bool, changes: dict[str, Any] | None, share: str | None
) -> None:
    """`changes`: of the material; None: there is none, and the format's default has no back."""
    tree = gltf_tree()
    tree["nodes"][0] = {"mesh": 0, "translation": [0.5 if turned else -0.5, -0.5, 3],
                        "rotation": [0, 1, 0, 0] if turned else [0, 0, 0, 1]}
    tree["materials"][0] |= changes or {}
    if changes is None:
        del tree["meshes"][0]["primitives"][0]["material"]
    path = tmp_path / "square.glb"
    path.write_bytes(glb_bytes(tree))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        picture = render(path, width=24, height=16, rsm_resolution=16)
    assert picture.radiance.max() > 0
    assert [str(one.message) for one in said if "doubleSided" in str(one.message)] == ([] if share is None else [
        f"square: {share} % of what the picture shows are backs that the file leaves out (glTF's doubleSided): "
        "drawn and lit as fronts"])


def test_backs_do_not_change_the_record_of_materials(tmp_path: Path) -> None:
    digests = set()
    for sides in (True, False):
        (material,), _ = loaded(tmp_path, {"pbrMetallicRoughness": DIFFUSE, "doubleSided": sides})
        assert material.one_sided is not sides
        digests.add(materials_digest(load_scene(tmp_path / "square.glb")))
    assert len(digests) == 1
