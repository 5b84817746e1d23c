"""The record of a picture: which refgi made it, what the scene consists of, what a difference in it is called."""

import dataclasses
import hashlib
import subprocess
from pathlib import Path

import numpy as np
import pytest

import refgi
from refgi.errors import InputError
from refgi.provenance import plain, program, scene_record
from refgi.provenance.frames import same_sequence
from refgi.provenance.record import camera_from, geometry_digest, git_id, light_from, light_json, materials_digest
from refgi.scene import (
    Camera,
    DirectionalLight,
    Geometry,
    Image,
    Material,
    PointLight,
    Scene,
    SpotLight,
    Texture,
    load_scene,
)
from tests.scene.samples import write_scene
from tests.textured import room

OPTIONS = {"dtype": "float32", "rsm_resolution": 16, "shadows": "map"}
PAINT = (Material("a"),)
LIGHTS = [SpotLight((0.1, 2.0, 0.3), (0.0, -1.0, 0.1), 0.3, 0.7, (9.1, 8.0, 7.0)),
          PointLight((0.1, 0.2, 0.3), (1.0, 2.0, 1 / 3)), DirectionalLight((0.1, -1.0, 0.0), (3.0, 3.0, 0.1))]


def git(folder, *arguments):
    identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
    done = subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.fixture
def package(tmp_path):
    """A package in a git checkout of its own, with one commit."""
    folder = tmp_path / "tree" / "package"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("one = 1\n")
    git(tmp_path / "tree", "init", "-q")
    git(tmp_path / "tree", "add", "-A")
    git(tmp_path / "tree", "commit", "-q", "-m", "one")
    return folder


@pytest.fixture(autouse=True)
def _fresh():
    git_id.cache_clear()
    yield
    git_id.cache_clear()


def test_a_checkout_is_named_by_its_commit_and_marked_where_sources_differ(package):
    commit = git(package, "rev-parse", "HEAD")
    assert len(commit) == 40
    assert git_id(package) == commit
    for change in ("__init__.py", "new.py"):
        git_id.cache_clear()
        (package / change).write_text("two = 2\n")
        assert git_id(package) == f"{commit}-dirty"
        git(package, "add", "-A")
        git(package, "commit", "-q", "-m", change)
        commit = git(package, "rev-parse", "HEAD")
    (package.parent / "notes.txt").write_text("beside the package")
    git_id.cache_clear()
    assert git_id(package) == commit


def test_a_package_that_a_checkout_does_not_keep_has_no_commit(package, tmp_path, monkeypatch):
    installed = package.parent / ".venv" / "package"
    installed.mkdir(parents=True)
    (installed / "__init__.py").write_text("")
    assert git_id(installed) is None  # in another project's checkout
    assert git_id(tmp_path) is None
    monkeypatch.setenv("PATH", "")
    git_id.cache_clear()
    assert git_id(package) is None


def test_the_program_is_this_refgi():
    own = program()
    assert own["version"] == refgi.__version__
    assert own.get("git") == git_id(Path(refgi.__file__).resolve().parent)


def test_lights_and_cameras_come_back_to_the_bit():
    for light in LIGHTS:
        assert light_from(light_json(light)) == light
    ramp = SpotLight((0, 1, 0), (0, -1, 0), 0.1, 0.4, (1, 2, 3), "squared_ramp")
    assert light_from(light_json(ramp)) == ramp
    assert "falloff" not in light_json(dataclasses.replace(ramp, falloff="smoothstep"))  # records of earlier versions
    camera = Camera((0.1, 0.2, 0.3), (1 / 3, 0.0, 0.0), (0.0, 1.0, 0.1), 0.7000000000000001, 12, 10)
    assert camera_from(plain(camera)) == camera


@pytest.mark.parametrize("content", [{"type": "point", "position": [0, 0, 0]}, {"type": "lamp"}, {}])
def test_what_is_no_light_is_refused(content):
    with pytest.raises(InputError, match="light: expected the keys"):
        light_from(content)


def scene_of(vertices, faces=((0, 1, 2),), materials=PAINT, normals=None):
    faces = np.asarray(faces, np.int32)
    geometry = Geometry(np.asarray(vertices, float), faces, np.zeros(len(faces), np.int32), normals)
    return Scene("s", geometry, materials, Camera((0, 0, 5), (0, 0, 0)), (LIGHTS[1],))


def test_digests_change_with_what_they_are_of_and_with_nothing_else():
    corners = np.eye(3)
    scene = scene_of(corners)
    assert geometry_digest(scene) == geometry_digest(scene_of(corners.copy()))
    assert geometry_digest(scene) == geometry_digest(scene.with_camera(width=9).with_lights(LIGHTS[0]))
    moved = corners.copy()
    moved[0, 0] = np.nextafter(1.0, 2.0)
    others = [scene_of(moved), scene_of(corners, ((0, 2, 1),)), scene_of(corners, normals=corners)]
    second = dataclasses.replace(scene.geometry, material_of_face=np.ones(1, np.int32))
    others.append(dataclasses.replace(scene, geometry=second, materials=(Material("a"), Material("b"))))
    assert len({geometry_digest(one) for one in [scene, *others]}) == 5
    materials = [Material("a"), Material("b"), Material("a", (0.5, 0.5, 0.4)), Material("a", ior=1.5),
                 Material("a", emission=(1, 0, 0)), Material("a", specular=(0.1, 0, 0)), Material("a", exponent=2)]
    assert len({materials_digest(scene_of(corners, materials=(one,))) for one in materials}) == len(materials)
    assert geometry_digest(scene) == geometry_digest(scene_of(corners, materials=(Material("b"),)))


def test_a_digest_is_what_its_text_says():
    """By hand: shape and little-endian content of each array, in order."""
    text = b"(3, 3)\0" + np.eye(3).astype("<f8").tobytes() + b"(1, 3)\0" + bytes([0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])
    text += b"(1,)\0" + bytes(4) + b"(0,)\0"
    assert geometry_digest(scene_of(np.eye(3))) == hashlib.sha256(text).hexdigest()


def test_a_scene_knows_its_files_and_keeps_them_when_it_changes(tmp_path, monkeypatch):
    path = write_scene(tmp_path)
    digests = {name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
               for name in ("sample.json", "square.ply")}
    monkeypatch.chdir(tmp_path.parent)
    for name in (str(path), str(path.relative_to(tmp_path.parent))):
        source = load_scene(name).with_camera(width=7).with_lights(LIGHTS[0]).source
        assert source.name == name
        assert dict(source.files) == digests
    assert load_scene("wedge:angle_deg=60").source == ("wedge:angle_deg=60", ())


def test_the_record_of_a_scene_made_in_python_names_no_source():
    record = scene_record(scene_of(np.eye(3)), OPTIONS, size=(30, 20), exposure=2.0)
    assert record["scene"]["source"] is None
    assert (record["scene"]["camera"]["width"], record["scene"]["camera"]["height"]) == (30, 20)
    assert (record["exposure"], record["options"]) == (2.0, OPTIONS)


def test_frames_are_of_one_sequence_however_scene_and_path_are_named():
    a = {"scene": {"source": "a.json", "faces": 3}, "path": {"source": "p.toml", "sha256": "1"}, "settings": {"n": 1}}
    b = {"scene": {"source": "../a.json", "faces": 3}, "path": {"source": "q", "sha256": "1"}, "settings": {"n": 1}}
    assert same_sequence(a, b) == []
    assert same_sequence(a, b | {"settings": {"n": 2, "m": 3}}) == ["settings.m", "settings.n"]
    assert same_sequence(a, {**b, "path": {"source": "p.toml", "sha256": "2"}}) == ["path.sha256"]
    assert same_sequence(a, {"frame": 1}) != []


@pytest.mark.feature("REF-22")
def test_a_changed_texel_or_coordinate_changes_the_digests():
    scene = room()
    paint, uv = scene.materials[1], scene.geometry.uv
    pixels = paint.texture.image.pixels.copy()
    pixels[1, 2, 0] += np.float32(1e-7)
    others = [dataclasses.replace(paint, texture=change) for change in (
        None, Texture(Image(pixels), ("clamp", "clamp")), Texture(paint.texture.image, ("clamp", "mirror")),
        Texture(paint.texture.image, ("clamp", "clamp"), "bilinear"))]
    digests = {materials_digest(dataclasses.replace(scene, materials=(scene.materials[0], one)))
               for one in (paint, *others)}
    assert len(digests) == 5
    assert materials_digest(room()) in digests
    turned = dataclasses.replace(scene, geometry=dataclasses.replace(scene.geometry, uv=uv[:, ::-1]))
    bare = dataclasses.replace(scene, materials=(others[0], others[0]), geometry=dataclasses.replace(
        scene.geometry, uv=None))
    assert len({geometry_digest(one) for one in (scene, turned, bare)}) == 3
