"""OBJ and MTL: indices of either sign, materials as floats, the line of every fault; files as programs write them."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import Scene, load_scene
from refgi.scene.files import reading_as
from refgi.scene.obj import read_obj
from tests.scene.samples import write_scene

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "square.obj"
    path.write_text(text)
    return path


def test_triangles_quadrilaterals_and_relative_indices(tmp_path: Path) -> None:
    mesh = read_obj(written(tmp_path, QUAD + "f 1 2 3 4\n# note\nf -4/1 -3/2 -1/3 # tail\n")).meshes[0]
    corners = mesh.vertices[mesh.faces]
    assert corners[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert corners[1].tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert corners[2].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_negative_indices_count_from_their_line(tmp_path: Path) -> None:
    mesh = read_obj(written(tmp_path, QUAD + "f -4 -3 -2\nv 9 9 9\nf -5 -4 -3\n")).meshes[0]
    assert np.array_equal(mesh.vertices[mesh.faces[0]], mesh.vertices[mesh.faces[1]])


def test_geometry_equals_trimesh(tmp_path: Path) -> None:
    import io

    import trimesh

    body = trimesh.creation.icosphere(subdivisions=2)
    text = trimesh.exchange.obj.export_obj(body, include_normals=True, digits=17)
    oracle = trimesh.load_mesh(io.StringIO(text), file_type="obj", process=False, maintain_order=True)
    mesh = read_obj(written(tmp_path, text)).meshes[0]
    assert np.array_equal(mesh.vertices[mesh.faces], oracle.vertices[oracle.faces])
    assert mesh.normals is not None
    assert np.allclose(mesh.normals[mesh.faces], body.vertex_normals[body.faces], atol=1e-12)


def test_materials_are_floats_in_order_of_use(tmp_path: Path) -> None:
    (tmp_path / "colours.mtl").write_text(
        "newmtl matt\nKd 0.1 0.2 0.0001\n\nnewmtl shiny\nKd 0.3 0.3 0.3\nKs 0.5 0.5 0.5\nNs 40\nKe 1 2 3\n"
        "newmtl too_bright\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNs 40\n")
    text = ("mtllib colours.mtl\n" + QUAD + "usemtl shiny\nf 1 2 3\nusemtl matt\nf 1 3 4\n"
            "usemtl too_bright\nf 1 2 4\nusemtl unheard\nf 2 3 4\nusemtl shiny\nf 2 3 4\n")
    with pytest.warns(RefgiWarning, match=r"colours.mtl: 1 of 3 materials with diffuse \+ specular .* over 1"):
        meshes = read_obj(written(tmp_path, text)).meshes
    shiny, matt, bright, unheard, again = (mesh.material for mesh in meshes)
    assert matt.diffuse == (0.1, 0.2, 0.0001)
    assert (shiny.specular, shiny.exponent, shiny.emission) == ((0.5, 0.5, 0.5), 40, (1, 2, 3))
    assert not bright.is_glossy
    assert unheard.diffuse == (0.5, 0.5, 0.5)
    assert again == shiny
    assert [len(mesh.faces) for mesh in meshes] == [1, 1, 1, 1, 1]


@pytest.mark.parametrize(("tail", "said"), [
    ("f 1 2 9\n", "line 5: expected an index from 1 to 4 (or negative), got '9'"),
    ("f 0 1 2\n", "line 5"), ("f -5 1 2\n", "line 5"), ("f 1 2\n", "line 5: expected three or more corners"),
    ("f 1 2 x\n", "line 5"), ("f 1//7 2//1 3//1\n", "line 5"), ("v 1 2\nf 1 2 3\n", "line 5: expected 3 number(s)"),
    ("v 1 2 x\nf 1 2 3\n", "line 5"), ("v nan 2 3\nf 1 2 5\n", "finite coordinates"), ("", "at least one polygon"),
    ("mtllib absent.mtl\nf 1 2 3\n", "absent.mtl: no such file"),
])
def test_each_fault_names_file_and_line(tmp_path: Path, tail: str, said: str) -> None:
    with pytest.raises(InputError) as error, reading_as(strict=True):
        read_obj(written(tmp_path, QUAD + tail))
    assert str(tmp_path) in str(error.value)
    assert said in str(error.value)


def test_albedo_over_one_in_a_material_file(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1.5 0 0\n")
    with pytest.raises(InputError, match=r"m\.mtl: material 'a': diffuse"):
        read_obj(written(tmp_path, "mtllib m.mtl\n" + QUAD + "usemtl a\nf 1 2 3\n"))


def test_textures_are_passed_over_with_a_count_and_those_that_are_missing_named(tmp_path: Path) -> None:
    (tmp_path / "the wood.png").write_bytes(b"")
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.5 0.5\nmap_Ka -s 1 1 1 the wood.png\nbump absent bump.png\n"
                                    "newmtl b\nmap_Ks gone.png\n")
    with pytest.warns(RefgiWarning) as said:
        read_obj(written(tmp_path, "mtllib m.mtl\n" + QUAD + "usemtl a\nf 1 2 3\nmtllib m.mtl\n"))
    assert [str(warning.message) for warning in said] == [
        f"{tmp_path / 'm.mtl'}: 3 texture(s) (bump, map_Ka, map_Ks) passed over (shading normals stay the mesh's); "
        "2 of them name no file: absent bump.png, gone.png"]


def test_textures_that_are_there_are_passed_over_with_a_count(tmp_path: Path) -> None:
    (tmp_path / "wood.png").write_bytes(b"")
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Ka wood.png\n")
    with pytest.warns(RefgiWarning, match=r"m\.mtl: 1 texture\(s\) \(map_Ka\) passed over$"):
        read_obj(written(tmp_path, "mtllib m.mtl\n" + QUAD + "usemtl a\nf 1 2 3\n"))


def test_normals_belong_to_their_corners_in_every_material(tmp_path: Path) -> None:
    text = QUAD + ("vn 1 0 0\nvn 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//2 3//3\nusemtl b\nf 1//3 3//2 4//1\n"
                     "vn 0 0 -1\nusemtl a\nf 1//4 2//4 4//4\n")
    a, b, c = read_obj(written(tmp_path, text)).meshes
    assert a.normals is not None
    assert b.normals is not None
    assert c.normals is not None
    assert a.normals[a.faces].tolist() == [[[1, 0, 0], [0, 1, 0], [0, 0, 1]]]
    assert b.normals[b.faces].tolist() == [[[0, 0, 1], [0, 1, 0], [1, 0, 0]]]
    assert c.normals[c.faces].tolist() == [[[0, 0, -1]] * 3]
    assert b.vertices[b.faces].tolist() == [[[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
RED, BLUE = (0.8, 0.1, 0.1), (0.1, 0.1, 0.8)
RED_MTL, BLUE_MTL = "newmtl red\nKd 0.8 0.1 0.1\n", "newmtl blue\nKd 0.1 0.1 0.8\n"
GREY = (0.5, 0.5, 0.5)


class Folder:
    """A folder of files, and what loading its mesh says."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def put(self, **files: str | bytes) -> "Folder":
        for name, content in files.items():
            place = self.path / name.replace("__", "/").replace("_mtl", ".mtl")
            place.parent.mkdir(exist_ok=True)
            place.write_bytes(content if isinstance(content, bytes) else content.encode())
        return self

    def load(self, text: str | bytes, *, strict: bool = False) -> tuple[Scene, list[str]]:
        """Return the scene of an OBJ file and its warnings, but for that of the placed camera and lamp."""
        path = self.path / "mesh.obj"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            scene = load_scene(path, strict=strict)
        assert all(isinstance(one.message, RefgiWarning) for one in said)
        return scene, [text for one in said if "was placed" not in (text := str(one.message))]


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def corners(scene: Scene) -> list[list[list[float]]]:
    return scene.geometry.vertices[scene.geometry.faces].tolist()


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_byte_order_mark_hides_nothing(folder: Folder, mark: bytes, end: str) -> None:
    folder.put(a_mtl=mark + RED_MTL.replace("\n", end).encode())
    text = f"{SQUARE}v 9 9 9\nmtllib a.mtl\nusemtl red\nf 1 2 3 4\n".replace("\n", end).encode()
    scene, said = folder.load(mark + text)
    assert scene.geometry.bounds[1].tolist() == [1, 1, 0]
    assert scene.materials[0].diffuse == RED
    scene, more = folder.load(mark + b"mtllib a.mtl\n" + text)
    assert (scene.materials[0].diffuse, said, more) == (RED, [], [])


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_is_named(folder: Folder, coding: str) -> None:
    with pytest.raises(InputError, match=r"mesh\.obj: expected text in UTF-8, got UTF-16"):
        folder.load((SQUARE + "f 1 2 3\n").encode(coding))
    folder.put(a_mtl=RED_MTL.encode(coding))
    with pytest.raises(InputError, match=r"a\.mtl: expected text in UTF-8, got UTF-16"):
        folder.load(SQUARE + "mtllib a.mtl\nf 1 2 3\n")


def test_what_no_library_defines_is_named(folder: Folder) -> None:
    folder.put(a_mtl=RED_MTL)
    faces = "usemtl Red\nf 1 2 3\nusemtl wood\nf 1 3 4\nusemtl Red\nf 1 2 4\n"
    scene, said = folder.load("mtllib a.mtl\n" + SQUARE + faces)
    assert scene.materials[0].diffuse == GREY
    assert said == [f"{folder.path / 'mesh.obj'}: 2 material(s) used and not defined, rendered grey: 'Red', 'wood'"]


def test_a_scene_file_may_define_it(folder: Folder) -> None:
    folder.load(SQUARE + "usemtl paint\nf 1 2 3\n")
    path = write_scene(folder.path, objects=[{"mesh": "mesh.obj"}])
    assert load_scene(path).materials[0].diffuse == (0.1, 0.2, 0.3)
    path = write_scene(folder.path, objects=[{"mesh": "mesh.obj"}, {"mesh": "mesh.obj"}],
                       materials={"other": {"type": "diffuse", "diffuse": [0.1, 0.2, 0.3]}})
    with pytest.warns(RefgiWarning, match=r"sample\.json: 1 material\(s\) used and not defined.*'paint'") as said:
        load_scene(path)
    assert len(said) == 1
    load_scene(write_scene(folder.path, objects=[{"mesh": "mesh.obj", "material": "paint"}]))


def test_faces_before_any_material_have_none(folder: Folder) -> None:
    folder.put(a_mtl="newmtl default\nKd 0 0 1\n")
    scene, said = folder.load(SQUARE + "f 1 2 3\nmtllib a.mtl\nusemtl default\nf 1 3 4\n")
    assert [scene.materials[k].diffuse for k in scene.geometry.material_of_face] == [GREY, (0, 0, 1)]
    assert said == []


def test_faces_keep_the_order_of_the_file(folder: Folder) -> None:
    folder.put(a_mtl=RED_MTL + BLUE_MTL)
    faces = "usemtl red\nf 1 2 3\nusemtl blue\nf 2 3 4\nf 3 4 1\nusemtl red\nf 4 1 2\n"
    scene, said = folder.load("mtllib a.mtl\n" + SQUARE + faces)
    place = {(0, 0, 0): 1, (1, 0, 0): 2, (1, 1, 0): 3, (0, 1, 0): 4}
    assert [[place[tuple(map(int, corner))] for corner in face] for face in corners(scene)] == [
        [1, 2, 3], [2, 3, 4], [3, 4, 1], [4, 1, 2]]
    assert [scene.materials[k].name for k in scene.geometry.material_of_face] == ["red", "blue", "blue", "red"]
    assert said == []


@pytest.mark.parametrize(("line", "found"), [
    ("mtllib a.mtl b.mtl", [RED, BLUE]), ("mtllib a.mtl\nmtllib b.mtl", [RED, BLUE]),
    ("mtllib mats\\c.mtl b.mtl", [RED, BLUE]), ("mtllib mats\\c.mtl", [RED, GREY]), ("mtllib the red.mtl", [RED, GREY]),
    ("mtllib ./mats/c.mtl # tail", [RED, GREY])])
def test_libraries_are_found(folder: Folder, line: str, found: list[tuple[float, ...]]) -> None:
    folder.put(a_mtl=RED_MTL, b_mtl=BLUE_MTL, mats__c_mtl=RED_MTL, **{"the red_mtl": RED_MTL})
    for text in (f"{line}\n{SQUARE}usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n",
                 f"{SQUARE}usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n{line}\n"):  # faces before their library
        scene, said = folder.load(text)
        assert [scene.materials[k].diffuse for k in scene.geometry.material_of_face] == found
        assert len(said) == found.count(GREY)


def test_the_first_library_with_a_name_counts(folder: Folder) -> None:
    folder.put(a_mtl=RED_MTL, b_mtl=RED_MTL.replace("0.8", "0.2") + BLUE_MTL)
    scene, _ = folder.load("mtllib a.mtl b.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n")
    assert [material.diffuse for material in scene.materials] == [RED, BLUE]


def test_an_absent_library_is_grey_and_refused_when_strict(folder: Folder) -> None:
    text = "mtllib gone.mtl\nmtllib gone.mtl\nmtllib far.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\n"
    scene, said = folder.load(text)
    assert scene.materials[0].diffuse == GREY
    assert said == [f"{folder.path / 'mesh.obj'}: 2 material file(s) not there, their materials are grey: "
                    "gone.mtl, far.mtl"]
    with pytest.raises(InputError, match=r"line 1: mtllib: .*gone\.mtl: no such file"):
        folder.load(text, strict=True)


@pytest.mark.parametrize(("line", "diffuse"), [("Kd 0.3", (0.3, 0.3, 0.3)), ("Kd 0.3 0.2 0.1", (0.3, 0.2, 0.1))])
def test_one_number_is_grey(folder: Folder, line: str, diffuse: tuple[float, ...]) -> None:
    folder.put(a_mtl=f"newmtl a\n{line}\nKs 0.5\nNs 20\nKe 2\n")
    material = folder.load("mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")[0].materials[0]
    assert material.diffuse == diffuse
    assert (material.specular, material.emission) == ((0.5, 0.5, 0.5), (2, 2, 2))


@pytest.mark.parametrize(("line", "diffuse", "cut"), [
    ("Kd xyz 0.2 0.3 0.1", (0.13710, 0.37311, 0.05564), 0),
    ("Kd xyz 0.3", (0.36144, 0.28452, 0.27261), 0),  # equal energy: pinkish
    ("Kd xyz 0.9505 1 1.0891", (1, 1, 1), 0),  # the white of Rec. 709: over 1 by rounding alone
    ("Kd xyz 0 0.5 0", (0, 0.9379, 0), 1)])  # green of no display: red and blue are below 0
def test_cie_xyz_is_linear_rec_709(folder: Folder, line: str, diffuse: tuple[float, ...], cut: int) -> None:
    """By the matrix of IEC 61966-2-1: rows 3.2406 -1.5372 -0.4986, -0.9689 1.8758 0.0415, 0.0557 -0.2040 1.0570."""
    folder.put(a_mtl=f"newmtl a\n{line}\nKe xyz 0.9505 1 1.0891\nnewmtl b\nKd 1 0 0\n")
    scene, said = folder.load("mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")
    assert scene.materials[0].diffuse == pytest.approx(diffuse, abs=2e-4)
    assert scene.materials[0].emission == pytest.approx((1, 1, 1), abs=2e-4)
    assert [one for one in said if "CIE" in one] == [
        f"{folder.path / 'a.mtl'}: 1 colour(s) of CIE XYZ outside of Rec. 709 cut"] * cut


def test_spectral_colours_are_passed_over_and_said(folder: Folder) -> None:
    folder.put(a_mtl="newmtl a\nKd spectral leaf.rfl 0.5\nKs spectral leaf.rfl\nNs 9\nnewmtl b\nKd 0.8 0.1 0.1\n")
    scene, said = folder.load("mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert [one.diffuse for one in scene.materials] == [GREY, RED]
    assert not scene.materials[0].is_glossy
    assert said == [f"{folder.path / 'a.mtl'}: 2 spectral colour(s) (.rfl) passed over: no spectra here"]


@pytest.mark.parametrize("line", ["Kd xyz", "Kd xyz a", "Kd xyz 0.1 0.2", "Kd XYZ 0.1 0.2 0.3", "Kd 0.1 0.2"])
def test_colours_that_lack_numbers_are_refused(folder: Folder, line: str) -> None:
    folder.put(a_mtl=f"newmtl a\n{line}\n")
    with pytest.raises(InputError, match=r"a\.mtl: line 2: expected 3 number"):
        folder.load("mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")


@pytest.mark.parametrize("name", ["Material #25", "wire#1", "a b  c", "grün"])
def test_names_hold_what_programs_write(folder: Folder, name: str) -> None:
    library = f"# a\nnewmtl {name}\nKd 0.8 0.1 0.1 # red\nnewmtl Material #26\nKd 0 0 1\n"
    for coding in ("utf-8", "latin-1"):
        folder.put(a_mtl=library.encode(coding))
        scene, said = folder.load(f"mtllib a.mtl\n{SQUARE}usemtl {name} # note\nf 1 2 3 #tail\n".encode(coding))
        assert scene.materials[0].diffuse == RED
        assert said == []


def test_corners_without_a_normal_take_that_of_their_face(folder: Folder) -> None:
    vertices = SQUARE + "v 3 0 0\nv 4 0 0\nv 3 0 1\nvn 0 1 0\nvn 0.6 0.8 0\nvn 0 0.8 0.6\n"
    text = vertices + "f 1//1 2//2 3//3\nf 5 6 7\nf 1//1 2 3//-1\n"
    scene, said = folder.load(text)
    normals = scene.geometry.vertex_normals[scene.geometry.faces]
    assert np.allclose(normals[0], [[0, 1, 0], [0.6, 0.8, 0], [0, 0.8, 0.6]])
    assert np.allclose(normals[1], [[0, -1, 0]] * 3)  # (1, 0, 0) x (0, 0, 1)
    assert np.allclose(normals[2], [[0, 1, 0], [0, 0, 1], [0, 0.8, 0.6]])
    assert said == []


def test_a_smooth_vertex_and_a_flat_one_at_its_place_are_two(folder: Folder) -> None:
    scene, _ = folder.load(SQUARE + "vn 0 1 0\nf 1//1 2//1 3//1\nf 1 3 4\n")
    assert len(scene.geometry.vertices) == 6
    assert np.allclose(scene.geometry.vertex_normals[scene.geometry.faces[1]], [[0, 0, 1]] * 3)


@pytest.mark.parametrize(("line", "count", "what"), [
    ("f 1//1 2//2 3//3 4//4", 4, "normals (vn)"), ("f -4//-4 -3//-3 -2//-2", 3, "normals (vn)"),
    ("f 1//0 2//0 3//0", 3, "normals (vn)"), ("vt 0 0\nf 1/1 2/2 3/3", 2, "texture coordinates (vt)"),
    ("f 1/1 2/2 3/3", 0, ""), ("f 1/1/ 2/2/ 3/3/", 0, "")])
def test_indices_of_what_is_absent_are_passed_over(folder: Folder, line: str, count: int, what: str) -> None:
    scene, said = folder.load(SQUARE + line + "\n")
    assert corners(scene)[0] == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert scene.geometry.vertex_normals is None
    file = folder.path / "mesh.obj"
    assert said == [f"{file}: {count} indices of absent {what} passed over"] * (count > 0)
    if count:
        with pytest.raises(InputError, match="expected an index from"):
            folder.load(SQUARE + line + "\n", strict=True)


def test_negative_indices_beside_a_missing_normal(folder: Folder) -> None:
    more = "v 5 0 0\nv 6 0 0\nv 6 0 1\nvn 1 0 0\nf -3//-1 -2//-2 -1\n"
    scene, said = folder.load(SQUARE + "vn 0 0 1\nf -4//-1 -3//-1 -2//-1\nf -4 -2 -1\n" + more)
    normals = scene.geometry.vertex_normals[scene.geometry.faces].tolist()
    assert normals == [[[0, 0, 1]] * 3, [[0, 0, 1]] * 3, [[1, 0, 0], [0, 0, 1], [0, -1, 0]]]
    assert said == []


def test_polygons_that_bend_inwards_keep_their_area(folder: Folder) -> None:
    outline = ("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n"
               "vt 0 0\nvt 1 0\nvt 1 0.5\nvt 0.5 0.5\nvt 0.5 1\nvt 0 1\n")
    for first in range(6):
        order = " ".join(f"{k}/{k}" for k in ((j + first) % 6 + 1 for j in range(6)))
        path = folder.path / "bent.obj"
        path.write_text(outline + f"f {order}\n")
        mesh, = read_obj(path).meshes
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        assert across[:, 2].min() >= 0
        assert np.isclose(across[:, 2].sum() / 2, 3.0)
        assert mesh.uv is not None
        assert np.allclose(mesh.uv[..., 0], mesh.vertices[mesh.faces][..., 0] / 2)
        assert np.allclose(1 - mesh.uv[..., 1], mesh.vertices[mesh.faces][..., 1] / 2)


def test_what_is_no_polygon_is_counted(folder: Folder) -> None:
    _, said = folder.load(SQUARE + "f 1 2 3\nl 1 2\nl 2 3 4\np 1\nf 1 2\n")
    assert [text.rpartition(": ")[2] for text in said] == [
        "2 lines passed over", "1 points passed over", "1 faces of fewer than three corners passed over"]


def test_very_many_runs_take_time_in_proportion(folder: Folder) -> None:
    folder.put(a_mtl=RED_MTL + BLUE_MTL)
    text = "mtllib a.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n" * 3000
    scene, said = folder.load(text)
    assert scene.geometry.material_of_face.tolist() == [0, 1] * 3000
    assert said == []
