"""Alpha of images and where it says that a surface is: against the literal twin, and what files say of it."""

import contextlib
import dataclasses
import itertools
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pictures

from refgi.cli.view import needed_bytes
from refgi.errors import InputError, RefgiWarning
from refgi.provenance.record import materials_digest
from refgi.scene import Image, Material, Mesh, Scene, Texture, load_scene, merge
from refgi.scene.texture.image import decoded
from refgi.scene.texture.lookup import is_opaque
from refgi.scene.triangles import cut_outs
from tests.cutouts import heap, opaque, spots
from tests.naive import cutouts as naive
from tests.scene.samples import write_scene
from tests.scene.texture.test_files import textured
from tests.scene.texture.test_image import encoded, png16

RNG = np.random.default_rng(4)
CODES = RNG.integers(0, 256, (4, 6, 4), np.uint8)
NEAR = 1e-6  # of a cutoff: alpha is float32
WRAPS = ("repeat", "clamp", "mirror")


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("chosen", ["nearest", "bilinear", "trilinear"])
def test_a_surface_is_there_where_the_twin_says_so(kind: str, chosen: str) -> None:
    image = spots((6, 5), 8, "float32" if kind == "uint16" else kind)
    if kind == "uint16":
        image = Image(np.zeros((6, 5, 3), np.uint16), "deep", np.round(65535 * image.alpha).astype(np.uint16))
    there = 0
    for wrap in itertools.product(WRAPS, WRAPS):
        material = Material(texture=Texture(image, wrap, chosen), alpha=0.8, cutoff=0.37)
        table = cut_outs((Material(), material)).table
        for u, v in RNG.uniform(-3, 3, (60, 2)):
            excess = naive.excess(material, u, v)
            if abs(excess) > NEAR:
                assert is_opaque(table, 0, u, v) == (excess > 0)
                there += excess > 0
    assert 60 < there < 480


@pytest.mark.feature("REF-28")
def test_equal_texels_are_compared_exactly() -> None:
    """A blend of ones is one: a cutoff of 1, or of a texel's own value, leaves no gaps between texels."""
    for code, cutoff in ((255, 1.0), (51, 0.2), (102, 0.4), (153, 0.6), (204, 0.8)):
        alpha = np.full((4, 4), code, np.uint8)
        alpha[3, 3] = 0
        material = Material(texture=Texture(Image(np.zeros((4, 4, 3), np.uint8), "a", alpha), ("clamp", "clamp")),
                            cutoff=cutoff)
        table = cut_outs((material,)).table
        assert all(is_opaque(table, 0, u, v) for u, v in RNG.uniform(0, 0.62, (500, 2)))
        assert not is_opaque(table, 0, 0.99, 0.99)


def test_places_without_a_number_or_an_end_break_nothing() -> None:
    for chosen in ("nearest", "bilinear"):
        table = cut_outs((Material(texture=Texture(spots(), ("repeat", "mirror"), chosen), cutoff=0.5),)).table
        for u, v in itertools.product((np.nan, np.inf, -np.inf, 1e300, -1e18), repeat=2):
            assert is_opaque(table, 0, u, v) in (True, False)


def test_alpha_of_files() -> None:
    def alpha_of(content: bytes) -> Any:
        return decoded(content, "a").alpha

    assert np.array_equal(alpha_of(encoded(Pictures.fromarray(CODES))), CODES[..., 3])
    assert alpha_of(encoded(Pictures.fromarray(CODES[..., :3]))) is None
    full = CODES.copy()
    full[..., 3] = 255
    assert alpha_of(encoded(Pictures.fromarray(full))) is None
    grey = Pictures.merge("LA", [Pictures.fromarray(CODES[..., k]) for k in (0, 1)])
    assert np.array_equal(alpha_of(encoded(grey)), CODES[..., 1])
    deep = RNG.integers(0, 65536, (4, 3, 4), np.uint16)
    assert np.array_equal(alpha_of(png16(deep)), deep[..., 3])
    assert alpha_of(png16(deep[..., :3])) is None
    palette = Pictures.new("P", (6, 4))
    palette.putpalette(RNG.integers(0, 256, (4, 3), np.uint8).tobytes())
    palette.putdata((CODES[..., 0] % 4).ravel().tolist())
    assert np.array_equal(alpha_of(encoded(palette, transparency=2)), np.where(CODES[..., 0] % 4 == 2, 0, 255))
    keyed = encoded(Pictures.fromarray(CODES[..., :3]), transparency=tuple(int(c) for c in CODES[1, 2, :3]))
    assert np.array_equal(alpha_of(keyed), np.where((CODES[..., :3] == CODES[1, 2, :3]).all(axis=2), 0, 255))
    assert decoded(keyed, "a").pixels.shape == (4, 6, 3)


def test_alpha_is_a_part_of_an_image() -> None:
    pixels = CODES[..., :3]
    plain, one, other = (Image(pixels, "a", alpha) for alpha in (None, CODES[..., 3], CODES[..., 3] // 2))
    assert len({plain, one, other}) == 3
    assert Image(pixels, "b", np.full((4, 6), 255, np.uint8)) == plain
    assert Image(pixels, "b", CODES[..., 3].copy()) == one
    assert np.array_equal(plain.linear_alpha(), np.ones((4, 6), np.float32))
    least, most = CODES[..., 3].min(), CODES[..., 3].max()
    assert one.alpha_range == (float(np.float32(least / 255)), float(np.float32(most / 255)))
    for wrong in (CODES[:2, :, 3], CODES[..., 3].astype(np.float32), CODES[..., :2]):
        with pytest.raises(InputError, match="a: alpha"):
            Image(pixels, "a", wrong)
    with pytest.raises(InputError, match="numbers from 0 to 1"):
        Image(np.zeros((1, 1, 3)), "a", np.array([[1.5]]))


@pytest.mark.parametrize("change", [{"alpha": -0.1}, {"alpha": 1.1}, {"alpha": np.nan}, {"cutoff": -0.1},
                                    {"cutoff": np.inf}, {"cutoff": "half"}])
def test_unusable_numbers_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"material 'm': {next(iter(change))}"):
        Material("m", **change)


def test_what_has_no_holes_costs_nothing() -> None:
    """Without cutoff, with alpha above it everywhere, or without alpha: no masks, no second pass."""
    picture, full = Texture(spots()), Texture(Image(CODES[..., :3]))
    low = float(spots().linear_alpha().min())
    for material in (Material(texture=picture), Material(texture=picture, cutoff=0.0), Material(cutoff=1.0),
                     Material(texture=picture, cutoff=low), Material(texture=full, cutoff=1.0)):
        assert cut_outs((material,)) is None
    assert cut_outs((Material(texture=picture, cutoff=low + 0.01),)) is not None
    hole, leaf = Material(texture=picture, alpha=0.1, cutoff=0.9), Material(texture=picture, cutoff=0.5)
    holes = cut_outs((Material(), hole, leaf))
    assert holes.of_material.tolist() == [-1, 0, 1]
    assert holes.table.mask[0].tolist() == [0] * 6  # a hole as a whole keeps no texels
    assert len(holes.table.alpha) == 30


def test_equal_materials_share_their_masks() -> None:
    one, other = heap(9), heap(9)
    assert one.geometry.cut_outs is other.geometry.cut_outs
    assert one.with_camera(width=7).geometry is one.geometry


def test_a_scene_s_materials_decide_about_its_geometry() -> None:
    scene = heap(9)
    plain = opaque(scene)
    assert plain.geometry.cut_outs is None
    again = dataclasses.replace(plain, materials=scene.materials)
    np.testing.assert_array_equal(again.geometry.cut.face, scene.geometry.cut.face)
    np.testing.assert_array_equal(again.geometry.cut.uv, scene.geometry.cut.uv)
    assert scene.geometry.cut.face.tolist() == [1, 2, 4, 5, 7, 8]
    with pytest.raises(InputError, match="cut_outs: expected those of 3 materials"):
        _ = dataclasses.replace(scene.geometry, cut_outs=cut_outs(scene.materials[:2])).cut
    with pytest.raises(InputError, match="texture coordinates for its cut-outs"):
        _ = dataclasses.replace(scene.geometry, uv=None).cut


def test_records_know_cutoff_and_alpha() -> None:
    scene = heap(9)

    def with_material(**changes: Any) -> Scene:
        changed = dataclasses.replace(scene.materials[1], **changes)
        return dataclasses.replace(scene, materials=(scene.materials[0], changed, scene.materials[2]))

    digests = {materials_digest(one) for one in (
        scene, with_material(cutoff=0.46), with_material(alpha=0.9), with_material(cutoff=None),
        with_material(texture=Texture(spots(seed=9), ("repeat", "mirror"))))}
    assert len(digests) == 5
    # alpha without a cutoff is of no meaning, and no part of the digest
    assert materials_digest(with_material(cutoff=None, alpha=0.9)) == materials_digest(with_material(cutoff=None))


def test_memory_counts_alpha_that_is_asked_for() -> None:
    scene = heap(9)
    assert needed_bytes(scene, 8, 8) - needed_bytes(opaque(scene), 8, 8) == 30 * 12


def loaded(path: Path, *said: str) -> Scene:
    """Return a scene whose file gives no other warnings of cut-outs than these."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        scene = load_scene(path)
    texts = [str(one.message).partition(": ")[2] for one in found if issubclass(one.category, RefgiWarning)]
    about = [text for text in texts if any(word in text for word in ("alpha", "opacity", "map_d"))]
    assert len(about) == len(said)
    for text, words in zip(about, said, strict=True):
        assert words in text
    return scene


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize(("keys", "cutoff", "alpha", "said"), [
    ({}, None, 1.0, ()), ({"alphaMode": "OPAQUE", "alphaCutoff": 0.3}, None, 1.0, ()),
    ({"alphaMode": "MASK"}, 0.5, 0.75, ()), ({"alphaMode": "MASK", "alphaCutoff": 0.3}, 0.3, 0.75, ()),
    ({"alphaMode": "MASK", "alphaCutoff": 2.0}, 2.0, 0.75, ()),
    ({"alphaMode": "BLEND", "alphaCutoff": 0.3}, 0.5, 0.75,
     ("1 material(s) of alphaMode BLEND taken as MASK with a cutoff of 0.5",)),
])
def test_gltf(tmp_path: Path, keys: dict[str, Any], cutoff: float | None, alpha: float, said: tuple[str, ...]) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["materials"][0] |= keys
        tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.5, 0.5, 0.75]

    scene = loaded(textured(tmp_path, edit, image=encoded(Pictures.fromarray(CODES))), *said)
    material = scene.materials[0]
    assert (material.cutoff, material.alpha) == (cutoff, alpha)
    assert np.array_equal(material.texture.image.alpha, CODES[..., 3])
    assert (scene.geometry.cut is None) == (cutoff is None)


@pytest.mark.parametrize(("keys", "said"), [({"alphaMode": "GLASS"}, "alphaMode"),
                                            ({"alphaMode": "MASK", "alphaCutoff": "much"}, "alphaCutoff"),
                                            ({"alphaMode": "MASK", "alphaCutoff": -1}, "cutoff")])
def test_gltf_faults_are_named(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_scene(textured(tmp_path, lambda tree: tree["materials"][0].update(keys)))


def test_gltf_without_coordinates_is_there_by_its_factor(tmp_path: Path) -> None:
    for factor, whole in ((0.4, False), (0.6, True)):
        def edit(tree: dict[str, Any], factor: float = factor) -> None:
            tree["materials"][0]["alphaMode"] = "MASK"
            tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.5, 0.5, factor]
            del tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]

        with pytest.warns(RefgiWarning, match="TEXCOORD_0"):
            scene = load_scene(textured(tmp_path, edit, image=encoded(Pictures.fromarray(CODES))))
        assert (scene.geometry.cut is None) == whole


def test_scene_files(tmp_path: Path) -> None:
    (tmp_path / "leaf.png").write_bytes(encoded(Pictures.fromarray(CODES)))
    textured(tmp_path)
    for kind in ({"type": "diffuse"}, {"type": "phong", "specular": [0.1, 0.1, 0.1], "exponent": 9}):
        material = {**kind, "diffuse": {"texture": "leaf.png", "factor": [0.8, 0.8, 0.8]}, "alpha": 0.9, "cutoff": 0.25}
        path = write_scene(tmp_path, objects=[{"mesh": "square.glb", "material": "leaf"}], materials={"leaf": material})
        scene = load_scene(path)
        assert (scene.materials[0].alpha, scene.materials[0].cutoff) == (0.9, 0.25)
        assert len(scene.geometry.cut.face) == 2
    for key, value in (("cutoff", -1), ("alpha", 2), ("cutoff", "x")):
        tree = json.loads(path.read_text())
        tree["materials"]["leaf"][key] = value
        path.write_text(json.dumps(tree))
        with pytest.raises(InputError, match=rf"materials\.leaf.*{key}"):
            load_scene(path)
        tree["materials"]["leaf"] |= {"alpha": 0.9, "cutoff": 0.25}
        path.write_text(json.dumps(tree))


def test_merge_gives_meshes_their_holes() -> None:
    quad = Mesh(np.eye(3), np.array([[0, 1, 2]]), material=heap(9).materials[1], uv=np.zeros((1, 3, 2)))
    geometry, materials = merge([dataclasses.replace(quad, material=Material("whole")), quad])
    assert geometry.cut.face.tolist() == [1]
    assert geometry.cut_outs == cut_outs(materials)
    with contextlib.suppress(InputError):
        merge([dataclasses.replace(quad, uv=None)])
        pytest.fail("a texture without coordinates was taken")


def obj(folder: Path, library: str, faces: str = "f 1/1 2/2 3/3\n") -> Path:
    """Write a triangle whose coordinates are the corners of a picture, and two pictures."""
    (folder / "wood.png").write_bytes(encoded(Pictures.fromarray(CODES[..., :3])))
    (folder / "leaf.png").write_bytes(encoded(Pictures.fromarray(CODES)))
    (folder / "m.mtl").write_text(library)
    path = folder / "leaf.obj"
    path.write_text(f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\n{faces}")
    return path


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize(("library", "expected"), [
    ("map_Kd wood.png\nmap_d leaf.png\n", CODES[..., 3]), ("map_d leaf.png\n", CODES[..., 3]),
    ("map_Kd leaf.png\nmap_d leaf.png\nd 1.0\n", CODES[..., 3]),
    ("map_d wood.png\n", np.round(CODES[..., :3].mean(axis=2)))])
def test_obj_s_opacity_is_a_cut_out(tmp_path: Path, library: str, expected: np.ndarray) -> None:
    scene = loaded(obj(tmp_path, f"newmtl a\nKd 0.5 0.5 0.5\n{library}"), "1 material(s) with map_d cut out")
    found = scene.materials[0]
    assert (found.cutoff, found.alpha) == (0.5, 1.0)
    assert np.array_equal(found.alpha_texture.image.alpha, expected)
    assert (found.texture is None) == ("map_Kd" not in library)
    assert scene.geometry.cut.face.tolist() == [0]
    assert scene.geometry.cut.uv.tolist() == [[0, 1, 1, 1, 1, 0]]
    assert scene.geometry.cut_outs.table.alpha.tolist() == (
        np.asarray(expected, np.float64) / 255).astype(np.float32).ravel().tolist()


def test_obj_s_factor_and_what_is_not_read(tmp_path: Path) -> None:
    half = loaded(obj(tmp_path, "newmtl a\nKd 0.5 0.5 0.5\nd 0.75\nmap_d leaf.png\n"), "map_d cut out")
    assert half.materials[0].alpha == 0.75
    for line in ("d 0.5", "Tr 0.5", "d -halo 0.25"):
        plain = loaded(obj(tmp_path, f"newmtl a\nKd 0.5 0.5 0.5\n{line}\n"), "1 material(s) with opacity below 1")
        assert plain.materials[0].cutoff is None
    for line in ("d 1.0", "Tr 0", "d", "Tr x"):
        loaded(obj(tmp_path, f"newmtl a\nKd 0.5 0.5 0.5\n{line}\n"))
    moved = loaded(obj(tmp_path, "newmtl a\nmap_Kd wood.png\nmap_d -s 2 2 leaf.png\n"), "map_d, which lies other than")
    assert moved.materials[0].cutoff is None
    bare = obj(tmp_path, "newmtl a\nmap_d leaf.png\n", "f 1 2 3\n")
    scene = loaded(bare, "map_d cut out")
    assert scene.geometry.cut is None  # alpha 1 where there is no picture
    gone = obj(tmp_path, "newmtl a\nmap_d gone.png\n")
    with pytest.warns(RefgiWarning), pytest.raises(InputError, match=r"m\.mtl: line 2: map_d: .*gone\.png"):
        load_scene(gone, strict=True)
