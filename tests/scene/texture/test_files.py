"""Base colour textures from glTF, OBJ and scene files: where they lie, how they repeat, and what a fault is called."""

import base64
import contextlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import Geometry, Material, Mesh, Texture, load_scene, merge
from refgi.scene.files import reading_as
from refgi.scene.gltf import read_gltf
from refgi.scene.model import Scene
from refgi.scene.motion import moved, transformed_all, with_own_vertices
from refgi.scene.obj import read_obj
from refgi.scene.repair import repaired
from refgi.scene.texture.image import Image
from tests.scene.samples import BUFFER, glb_bytes, gltf_tree, write_scene

CODES = np.random.default_rng(1).integers(0, 256, (4, 6, 3), np.uint8)
PNG: bytes = imageio.v3.imwrite("<bytes>", CODES, extension=".png")
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)  # of the sample's square: the picture upright
SECOND = np.array([[0.25, 0.5], [2, 0.5], [2, -1], [0.25, -1]], np.float32)
EXACT = 1e-12
Edit = Callable[[dict[str, Any]], Any]


def textured(folder: Path, edit: Edit | None = None, *, image: bytes = PNG, suffix: str = ".glb") -> Path:
    """Write the sample square with two sets of coordinates and an image inside its buffer."""
    tree = gltf_tree()
    buffer = BUFFER + UV.tobytes() + SECOND.tobytes() + image
    tree["buffers"][0]["byteLength"] = len(buffer)
    tree["bufferViews"] += [{"buffer": 0, "byteOffset": 60, "byteLength": 32},
                            {"buffer": 0, "byteOffset": 92, "byteLength": 32},
                            {"buffer": 0, "byteOffset": 124, "byteLength": len(image)}]
    tree["accessors"] += [{"bufferView": k, "componentType": 5126, "count": 4, "type": "VEC2"} for k in (2, 3)]
    tree["images"] = [{"bufferView": 4, "mimeType": "image/png"}]
    tree["textures"] = [{"source": 0}]
    tree["meshes"][0]["primitives"][0]["attributes"] |= {"TEXCOORD_0": 2, "TEXCOORD_1": 3}
    tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    if edit is not None:
        edit(tree)
    path = folder / f"square{suffix}"
    path.write_bytes(glb_bytes(tree, buffer))
    return path


def info(tree: dict[str, Any]) -> dict[str, Any]:
    return tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]  # type: ignore[no-any-return]


def texture_of(scene: Scene) -> Texture:
    found = scene.materials[0].texture
    assert found is not None
    return found


def corners(uv: np.ndarray) -> np.ndarray:
    return uv.astype(np.float64)[[[0, 1, 2], [0, 2, 3]]]


@pytest.mark.feature("REF-22")
def test_a_texture_inside_a_glb_multiplies_the_factor(tmp_path: Path) -> None:
    scene = load_scene(textured(tmp_path))
    assert scene.materials[0].diffuse == (0.1, 0.2, 0.3)
    found = texture_of(scene)
    assert np.array_equal(found.image.pixels, CODES)
    assert (found.wrap, found.filter) == (("repeat", "repeat"), "trilinear")
    assert scene.geometry.uv is not None
    assert np.array_equal(scene.geometry.uv, corners(UV))


@pytest.mark.parametrize("place", ["data", "beside"])
def test_images_come_from_data_uris_and_files_beside(tmp_path: Path, place: str) -> None:
    (tmp_path / "the wood.png").write_bytes(PNG)
    uri = "the%20wood.png" if place == "beside" else "data:image/png;base64," + base64.b64encode(PNG).decode()
    scene = load_scene(textured(tmp_path, lambda tree: tree.update(images=[{"uri": uri}])))
    assert np.array_equal(texture_of(scene).image.pixels, CODES)
    assert scene.source is not None
    assert ("the wood.png" in dict(scene.source.files)) == (place == "beside")


@pytest.mark.feature("REF-22")
@pytest.mark.parametrize(("sampler", "wrap", "chosen"), [
    ({}, ("repeat", "repeat"), "trilinear"),
    ({"wrapS": 33071, "wrapT": 33648, "minFilter": 9728}, ("clamp", "mirror"), "nearest"),
    ({"minFilter": 9728, "magFilter": 9728}, ("repeat", "repeat"), "nearest"),
    ({"magFilter": 9728}, ("repeat", "repeat"), "nearest"),  # what is smaller than texels, the file leaves open
    ({"wrapS": 33648, "wrapT": 10497, "minFilter": 9729, "magFilter": 9729}, ("mirror", "repeat"), "bilinear"),
    ({"minFilter": 9987, "magFilter": 9729}, ("repeat", "repeat"), "trilinear"),
    ({"minFilter": 9987}, ("repeat", "repeat"), "trilinear"), ({"minFilter": 9985}, ("repeat", "repeat"), "trilinear"),
    ({"magFilter": 9729}, ("repeat", "repeat"), "trilinear"),
])
def test_samplers(tmp_path: Path, sampler: dict[str, int], wrap: tuple[str, str], chosen: str) -> None:
    found = texture_of(load_scene(textured(tmp_path, sampled(sampler))))
    assert (found.wrap, found.filter) == (wrap, chosen)


@pytest.mark.parametrize(("sampler", "chosen", "said"), [
    ({"magFilter": 9728, "minFilter": 9987}, "trilinear", "magFilter NEAREST, minFilter LINEAR_MIPMAP_LINEAR"),
    ({"magFilter": 9728, "minFilter": 9729}, "bilinear", "magFilter NEAREST, minFilter LINEAR"),
    ({"magFilter": 9729, "minFilter": 9728}, "nearest", "magFilter LINEAR, minFilter NEAREST"),
    *(({"wrapT": 33071, "minFilter": code}, "trilinear", f"minFilter {name}") for code, name in (
        (9984, "NEAREST_MIPMAP_NEAREST"), (9986, "NEAREST_MIPMAP_LINEAR")))])
def test_filters_that_are_not_as_the_file_says_are_said(
    tmp_path: Path, sampler: dict[str, int], chosen: str, said: str
) -> None:
    def edit(tree: dict[str, Any]) -> None:
        sampled(sampler)(tree)
        tree["textures"] += [tree["textures"][0], {"source": 0}]
        first, primitive = tree["materials"][0], tree["meshes"][0]["primitives"][0]
        for index in (1, 2):
            surface = first["pbrMetallicRoughness"] | {"baseColorTexture": {"index": index}}
            tree["materials"].append({"pbrMetallicRoughness": surface})
            tree["meshes"][0]["primitives"].append(primitive | {"material": index})

    path = textured(tmp_path, edit)
    with pytest.warns(RefgiWarning) as warned:
        assert texture_of(load_scene(path)).filter == chosen
    assert [str(one.message) for one in warned] == [f"{path}: 2 material texture(s) of {said} filtered {chosen}"]


def sampled(sampler: dict[str, int]) -> Edit:
    """Return what gives the sample's texture a sampler."""
    return lambda tree: (tree.update(samplers=[{}, sampler]), tree["textures"][0].update(sampler=1))


@pytest.mark.feature("REF-22")
def test_the_set_of_coordinates_is_the_one_that_is_asked_for(tmp_path: Path) -> None:
    scene = load_scene(textured(tmp_path, lambda tree: info(tree).update(texCoord=1)))
    assert np.array_equal(scene.geometry.uv, corners(SECOND))

    def both(tree: dict[str, Any]) -> None:
        info(tree).update(texCoord=0, extensions={"KHR_texture_transform": {"texCoord": 1}})

    assert np.array_equal(load_scene(textured(tmp_path, both)).geometry.uv, corners(SECOND))


@pytest.mark.feature("REF-22")
def test_a_quarter_turn_turns_the_way_the_extension_says(tmp_path: Path) -> None:
    """By hand, with the sine of the corrected text: u' = 2 u + 0.1, v' = 3 v + 0.2 unturned; a quarter: see below."""
    def changed(**change: Any) -> np.ndarray:
        def edit(tree: dict[str, Any]) -> None:
            tree["extensionsRequired"] = ["KHR_texture_transform"]
            info(tree)["extensions"] = {"KHR_texture_transform": change}

        uv = load_scene(textured(tmp_path, edit)).geometry.uv
        assert uv is not None
        return uv

    u, v = np.moveaxis(corners(UV), -1, 0)
    plain = changed(offset=[0.1, 0.2], scale=[2, 3])
    assert np.allclose(plain, np.stack([2 * u + 0.1, 3 * v + 0.2], axis=-1), rtol=0, atol=EXACT)
    turned = changed(offset=[0.1, 0.2], scale=[2, 3], rotation=np.pi / 2)
    assert np.allclose(turned, np.stack([3 * v + 0.1, -2 * u + 0.2], axis=-1), rtol=0, atol=EXACT)
    sixth = changed(rotation=np.pi / 6)
    assert np.allclose(sixth[0, 1], [np.sqrt(0.75) + 0.5, -0.5 + np.sqrt(0.75)], rtol=0, atol=EXACT)  # of (1, 1)


def test_normalised_coordinates_and_mirrored_nodes(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["accessors"][2].update(componentType=5121, normalized=True)
        tree["nodes"][0]["scale"] = [1, 1, -1]

    scene = load_scene(textured(tmp_path, edit))
    raw = np.frombuffer(UV.tobytes(), np.uint8)[:8].reshape(4, 2) / 255
    assert np.allclose(scene.geometry.uv, corners(raw)[:, ::-1], rtol=0, atol=EXACT)


def test_materials_share_images_and_scenes_without_textures_have_no_coordinates(tmp_path: Path) -> None:
    def two(tree: dict[str, Any]) -> None:
        tree["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
                                                           "metallicFactor": 0}})
        tree["meshes"][0]["primitives"].append(tree["meshes"][0]["primitives"][0] | {"material": 1})

    first, second = load_scene(textured(tmp_path, two)).materials
    assert first.texture is not None
    assert second.texture is not None
    assert first.texture.image is second.texture.image
    surface = "pbrMetallicRoughness"
    plain = load_scene(textured(tmp_path, lambda tree: tree["materials"][0][surface].pop("baseColorTexture")))
    assert plain.geometry.uv is None
    assert plain.materials[0].texture is None


@pytest.mark.parametrize(("edit", "image", "said"), [
    (lambda t: t.update(images=[{"uri": "gone.png"}]), PNG, ("images[0].uri", "gone.png: no such file")),
    (lambda t: t.update(images=[{"uri": "../gone.png"}]), PNG, ("images[0].uri", "a file beside")),
    (lambda t: t.update(images=[{}]), PNG, ("images[0]", "a uri or a bufferView")),
    (lambda t: t.update(images=[]), PNG, ("textures[0].source", "an index into the 0 images")),
    (lambda t: t.update(textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}]), PNG,
     ("textures[0].source", "KHR_texture_basisu")),
    (lambda t: info(t).update(index=4), PNG, ("baseColorTexture.index", "1 textures")),
    (lambda t: info(t).update(texCoord=-1), PNG, ("baseColorTexture.texCoord",)),
    (lambda t: (t.update(samplers=[{"wrapS": 7}]), t["textures"][0].update(sampler=0)), PNG, ("samplers[0].wrapS",)),
    (lambda t: info(t).update(extensions={"KHR_texture_transform": {"scale": [1]}}), PNG, ("scale",)),
    (lambda t: t["accessors"][2].update(count=3), PNG, ("TEXCOORD_0", "4 elements")),
    (lambda t: t["bufferViews"][4].update(byteLength=9999), PNG, ("bufferViews[4]", "inside the buffer")),
    (None, PNG[:60], ("images[0]", "damaged or cut short")), (None, b"GIF89a" * 9, ("images[0]", "expected an image")),
])
def test_each_fault_names_file_and_image(tmp_path: Path, edit: Edit | None, image: bytes,
                                         said: tuple[str, ...]) -> None:
    path = textured(tmp_path, edit, image=image)
    with pytest.raises(InputError) as error:
        load_scene(path)
    for words in (str(path), *said):
        assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["materials"][0] |= {"normalTexture": {"index": 0}, "occlusionTexture": {"index": 0}}
        del tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]

    with pytest.warns(RefgiWarning) as said:
        scene = load_scene(textured(tmp_path, edit))
    assert {str(one.message).partition(": ")[2] for one in said} == {
        "1 material(s)' normal maps (shading normals stay the mesh's) passed over",
        "1 material(s)' occlusionTexture passed over",
        "1 primitive(s)' textures for lack of TEXCOORD_0 passed over"}
    assert scene.materials[0].texture is None


OBJ = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\n"


def obj(folder: Path, library: str, faces: str = "f 1/1 2/2 3/3 4/4\n") -> Path:
    (folder / "wood.png").write_bytes(PNG)
    (folder / "m.mtl").write_text(library)
    (folder / "square.obj").write_text(OBJ + faces)
    return folder / "square.obj"


@pytest.mark.feature("REF-22")
def test_obj_coordinates_count_from_the_bottom_of_the_picture(tmp_path: Path) -> None:
    mesh, = read_obj(obj(tmp_path, "newmtl a\nKd 0.5 0.25 1\nmap_Kd wood.png\n")).meshes
    assert mesh.material.texture == Texture(Image(CODES))
    assert mesh.material.diffuse == (0.5, 0.25, 1.0)
    assert mesh.uv is not None
    upright = {(0.0, 0.0): (0.0, 1.0), (1.0, 0.0): (1.0, 1.0), (1.0, 1.0): (1.0, 0.0), (0.0, 1.0): (0.0, 0.0)}
    for corner, uv in zip(mesh.vertices[mesh.faces].reshape(-1, 3), mesh.uv.reshape(-1, 2), strict=True):
        assert tuple(uv) == upright[tuple(corner[:2])]


@pytest.mark.feature("REF-22")
def test_obj_scale_offset_and_clamp(tmp_path: Path) -> None:
    library = "newmtl a\nmap_Kd -s 2 3 1 -o 0.25 0.5 -clamp on ./wood.png\n"
    mesh, = read_obj(obj(tmp_path, library)).meshes
    found = mesh.material.texture
    assert found is not None
    assert found.wrap == ("clamp", "clamp")
    assert mesh.material.diffuse == (1, 1, 1)  # no Kd
    assert mesh.uv is not None
    # u' = 2 u + 0.25, v' = 3 v + 0.5 upwards, turned: 1 - v'
    assert mesh.uv[0].tolist() == [[0.25, 0.5], [2.25, 0.5], [2.25, -2.5]]


def test_obj_faces_without_coordinates_and_options_that_are_not_read(tmp_path: Path) -> None:
    path = obj(tmp_path, "newmtl a\nmap_Kd -bm 2 -imfchan r wood.png\n", "f 1/1 2/2 3/3\nf 1 3 4\n")
    with pytest.warns(RefgiWarning) as said:
        painted, plain = read_obj(path).meshes
    assert [str(one.message).partition(": ")[2] for one in said] == [
        "options -bm, -imfchan of map_Kd passed over",
        "textures of 1 triangles passed over for lack of texture coordinates (vt)"]
    assert painted.material.texture is not None
    assert (plain.material.texture, plain.uv) == (None, None)
    assert [len(mesh.faces) for mesh in (painted, plain)] == [1, 1]


@pytest.mark.parametrize("option", ["-s 1 1e12", "-o 1e30", "-s 1e308 1e308", "-s 1 1e308 -o 0 -1e308"])
def test_an_obj_texture_that_lies_too_far_away_names_its_material(tmp_path: Path, option: str) -> None:
    with pytest.raises(InputError, match=r"square\.obj: material 'a': uv of face 0: expected finite texture"):
        load_scene(obj(tmp_path, f"newmtl a\nmap_Kd {option} wood.png\n"))


def test_an_obj_texture_that_is_missing_names_line_and_image(tmp_path: Path) -> None:
    path = obj(tmp_path, "newmtl a\nmap_Kd woad.png\nnewmtl unused\nmap_Kd never.png\n")
    said = r"m\.mtl: line 2: map_Kd: .*woad\.png: no such file; did you mean 'wood"
    with pytest.raises(InputError, match=said), reading_as(strict=True):
        read_obj(path)
    with pytest.warns(RefgiWarning, match=r"1 texture\(s\) of map_Kd and map_d not there, left out: woad\.png"):
        assert read_obj(path).meshes[0].material == Material("a")  # grey, as without Kd
    read_obj(obj(tmp_path, "newmtl a\nKd 1 1 1\nnewmtl unused\nmap_Kd never.png\n"))


def test_without_its_textures_a_material_has_its_colour_and_no_holes(tmp_path: Path) -> None:
    path = obj(tmp_path, "newmtl a\nKd 0.1 0.2 0.3\nmap_Kd woad.png\nmap_d leaf.png\nd 0.5\n")
    with pytest.warns(RefgiWarning) as said:
        assert read_obj(path).meshes[0].material == Material("a", (0.1, 0.2, 0.3))
    assert "2 texture(s) of map_Kd and map_d not there, left out: woad.png, leaf.png" in str(said[-1].message)


def painted_scene(folder: Path, reflectance: dict[str, Any], mesh: str = "square.glb") -> Path:
    (folder / "wood.png").write_bytes(PNG)
    textured(folder)
    return write_scene(folder, objects=[{"mesh": mesh, "material": "paint"}],
                       materials={"paint": {"type": "diffuse", "diffuse": reflectance}})


def test_scene_files_name_an_image_in_place_of_a_colour(tmp_path: Path) -> None:
    scene = load_scene(painted_scene(tmp_path, {"texture": "wood.png", "factor": [0.5, 1, 0.25], "filter": "bilinear",
                                                "wrap": ["mirror", "clamp"]}))
    assert scene.materials == (Material("paint", (0.5, 1.0, 0.25), texture=Texture(
        Image(CODES), ("mirror", "clamp"), "bilinear")),)
    assert np.array_equal(scene.geometry.uv, corners(UV))
    plain = load_scene(painted_scene(tmp_path, {"texture": "wood.png", "wrap": "clamp"}))
    assert plain.materials[0].diffuse == (1, 1, 1)
    assert texture_of(plain).wrap == ("clamp", "clamp")
    assert plain.source is not None
    assert "wood.png" in dict(plain.source.files)


@pytest.mark.parametrize(("reflectance", "mesh", "said"), [
    ({"texture": "gone.png"}, "square.glb", "materials.paint.diffuse.texture: "),
    ({"texture": "wood.png", "wrap": "border"}, "square.glb", "materials.paint.diffuse.wrap"),
    ({"texture": "wood.png", "factor": [1, 2, 0]}, "square.glb", "materials.paint: diffuse"),
    ({"textur": "wood.png"}, "square.glb", "materials.paint.diffuse.texture: expected a value"),
    ({"texture": "wood.png"}, "square.ply", "square.ply: expected texture coordinates for the texture of material"),
])
def test_faults_of_scene_files(tmp_path: Path, reflectance: dict[str, Any], mesh: str, said: str) -> None:
    with pytest.raises(InputError) as error:
        load_scene(painted_scene(tmp_path, reflectance, mesh))
    assert said in str(error.value)
    assert "sample.json" in str(error.value)


def test_a_material_inline_has_its_texture_too(tmp_path: Path) -> None:
    inline = {"type": "phong", "diffuse": {"texture": "wood.png", "factor": [0.5] * 3}, "specular": [0.5] * 3,
              "exponent": 9}
    painted_scene(tmp_path, {"texture": "wood.png"})
    path = write_scene(tmp_path, objects=[{"mesh": "square.glb", "material": inline}], materials={})
    assert np.array_equal(texture_of(load_scene(path)).image.pixels, CODES)
    path = write_scene(tmp_path, objects=[{"mesh": "square.glb", "material": inline | {"specular": [0.6] * 3}}])
    with pytest.raises(InputError, match=r"diffuse \+ specular"):
        load_scene(path)


UVS = np.arange(12.0).reshape(2, 3, 2)
VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
PAINT = Material("paint", texture=Texture(Image(CODES)))


def test_coordinates_follow_their_faces() -> None:
    flat = Mesh(VERTICES, np.array([[0, 1, 1], [0, 1, 2], [0, 2, 3]]), None, PAINT, "a",
                np.concatenate([np.full((1, 3, 2), 9.0), UVS]))
    mesh, dropped = repaired(flat, "a")
    assert dropped == 1
    assert np.array_equal(mesh.uv, UVS)
    mirrored, = transformed_all([mesh], np.diag([-1.0, 1, 1, 1])[None])
    assert np.array_equal(mirrored.uv, UVS[:, ::-1])
    assert np.array_equal(mirrored.faces, FACES[:, ::-1])
    geometry, _ = merge([Mesh(VERTICES, FACES), mesh, with_normals(mesh)], smooth=True)
    assert np.array_equal(geometry.uv, np.concatenate([np.zeros((2, 3, 2)), UVS, UVS]))
    assert merge([Mesh(VERTICES, FACES, None, Material(), "a", UVS)])[0].uv is None  # nothing looks there
    chosen = np.array([True, False, False, False, False, False])
    own = with_own_vertices(geometry, chosen)
    assert own.uv is geometry.uv
    assert moved(own, chosen, np.eye(3), (0, 0, 0), (1, 0, 0)).uv is geometry.uv


def with_normals(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces, np.tile([0.0, 0, 1], (4, 1)), mesh.material, "b", mesh.uv)


@pytest.mark.parametrize(("uv", "said"), [
    (UVS[:1], "uv: expected shape"), (UVS * np.nan, "uv of face 0"), (np.where(UVS == 8, np.inf, UVS), "uv of face 1"),
    (None, "texture coordinates for the texture of material 'paint'"),
])
def test_meshes_with_wrong_coordinates_are_refused(uv: np.ndarray | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        merge([Mesh(VERTICES, FACES, None, PAINT, "a", uv)])
    if uv is not None:
        with pytest.raises(InputError, match="geometry: uv"):
            Geometry(VERTICES, FACES, np.zeros(2, np.int32), None, uv)


def test_a_scene_needs_coordinates_for_its_textures(tmp_path: Path) -> None:
    scene = load_scene(textured(tmp_path))
    geometry = Geometry(VERTICES, FACES, np.zeros(2, np.int32))
    with pytest.raises(InputError, match="geometry: uv"):
        Scene("a", geometry, (PAINT,), scene.camera, scene.lights)


def test_images_count_in_the_memory_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    meshes = [Mesh(VERTICES, FACES, None, PAINT, "a", UVS)] * 3
    monkeypatch.setattr("refgi.scene.mesh.physical_memory", lambda: 12 * 48.0 + 6 * (32 + 96) + 24 * 40)
    merge(meshes)
    monkeypatch.setattr("refgi.scene.mesh.physical_memory", lambda: 12 * 48.0 + 6 * (32 + 96) + 24 * 40 - 1)
    with pytest.raises(InputError, match="12 vertices and 6 faces and 24 texels"):
        merge(meshes)


def test_no_image_is_opened_where_no_texture_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("refgi.scene.texture.image._codes", lambda *_: pytest.fail("an image was decoded"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        load_scene(textured(tmp_path, lambda tree: tree["materials"][0].pop("pbrMetallicRoughness")))


def test_files_that_change_one_byte_raise_only_input_errors(tmp_path: Path) -> None:
    path = textured(tmp_path)
    content, rng = bytearray(path.read_bytes()), np.random.default_rng(2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(150):
            broken = bytearray(content)
            broken[int(rng.integers(12, len(content)))] = int(rng.integers(256))
            path.write_bytes(broken)
            with contextlib.suppress(InputError):
                read_gltf(path)
