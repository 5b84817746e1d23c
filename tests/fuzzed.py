"""Formats to spoil beside those of `benchmarks.stability.file_formats`: files with all that their readers look at."""

import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import OpenEXR

from benchmarks.stability.file_formats import Format, read_scene
from refgi.errors import InputError
from refgi.image.picture import read_colour
from refgi.vectors.check import Asked, Kit, check_output
from refgi.vectors.manifest import BugEntry, BugWriter, Told
from tests.scene.samples import FACES, TRIANGLES
from tests.scene.test_gltf_pose import File
from tests.scene.test_ply import ply
from tests.vectors.test_kit_safety import npy, write_kit

RANDOM = np.random.default_rng(37)
CODES = RANDOM.integers(0, 256, (5, 6, 4), np.uint8)
PNG: bytes = imageio.v3.imwrite("<bytes>", CODES, extension=".png")
OBJ = b"""mtllib a.mtl more.mtl
o square
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0 0.5 0.5 0.5
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
usemtl wood
g one
s 1
f 1/1/1 2/2/1 3/3/1 4/4/1
usemtl leaf
f -4/-4 -3/-3 -2/-2
usemtl gone
f 1//1 2//1 4
l 1 2
p 1
"""
MTL = b"""newmtl wood
Kd xyz 0.2 0.3 0.1
Ks 0.1
Ns 9
Ke spectral lamp.rfl 2
map_Kd -s 2 3 -o 0.5 0 -clamp on wood.png
newmtl leaf
Kd 0.3
d 0.5
map_d wood.png
map_Bump -bm 2 wood.png
newmtl gone
Tr 0.3
Kd 1 1 1
Ks 1 1 1
Ns 3
"""


def _glb() -> list[bytes]:
    """Return a square that bends, is drawn thrice, has colours and a texture; and one that follows joints."""
    bent = File()
    bent.primitive["targets"] = [{"POSITION": bent.sparse(np.array([1, 3], np.uint16), TRIANGLES[:2])}]
    bent.tree["meshes"][0]["weights"] = [0.5]
    bent.primitive["attributes"] |= {"COLOR_0": bent.add(CODES[0, :4], normalized=True),
                                     "TEXCOORD_0": bent.add(TRIANGLES[:, :2].copy())}
    bent.instanced(TRANSLATION=(TRIANGLES[:3],))
    bent.tree |= {"images": [{"bufferView": bent.view(np.frombuffer(PNG, np.uint8)), "mimeType": "image/png"}],
                  "samplers": [{"magFilter": 9728, "minFilter": 9986, "wrapS": 33648}],
                  "textures": [{"source": 0, "sampler": 0}], "materials": [{
                      "alphaMode": "MASK", "alphaCutoff": 0.3, "emissiveFactor": [0.1, 0.2, 0.3],
                      "emissiveTexture": {"index": 0}, "pbrMetallicRoughness": {"baseColorTexture": {
                          "index": 0, "extensions": {"KHR_texture_transform": {"rotation": 0.1, "scale": [2, 2]}}}},
                      "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 2}}}]}
    bent.primitive["material"] = 0
    skinned = File()
    joints, weights = np.zeros((4, 4), np.uint8), np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1))
    skinned.skin(joints, weights, [{"translation": [2, 0, 0]}], inverse=np.eye(4)[None])
    skinned.primitive["material"] = 0
    skinned.tree["materials"] = [{"extensions": {
        "KHR_materials_pbrSpecularGlossiness": {"specularFactor": [0.1, 0.2, 0.3], "glossinessFactor": 0.4},
        "KHR_materials_transmission": {"transmissionFactor": 0.2}, "KHR_materials_volume": {"thicknessFactor": 1}}}]
    with tempfile.TemporaryDirectory() as folder:
        return [one.written(Path(folder)).read_bytes() for one in (bent, skinned)]


def _ply() -> list[bytes]:
    points = [(*one, 255 * (k % 2), 10 * k, 7, 0.5, 0.25 * k) for k, one in enumerate(TRIANGLES.tolist())]
    vertices = ("vertex", "float x, double y, float z, uchar red, uchar green, uchar blue, float s, float t", points)
    faces = ("face", "list uchar int vertex_indices, list uchar float texcoord, int texnumber", [
        (FACES[0].tolist(), [0.0] * 6, 0), ([0, 1, 2, 3], [0.5] * 8, 0)])
    strips = ("tristrips", "list int int vertex_indices", [([0, 1, 2, 3, -1, 2, 1, 0],)])
    return [ply(form, vertices, faces, strips, comments="comment TextureFile wood.png\n")
            for form in ("ascii", "binary_little_endian", "binary_big_endian")]


def _images() -> list[bytes]:
    forms = CODES[..., :3], CODES[..., 0].astype(np.uint16) * 257, CODES[..., 0]
    made = [imageio.v3.imwrite("<bytes>", one, extension=".png") for one in forms]
    return [PNG, *made, imageio.v3.imwrite("<bytes>", CODES[..., :3], extension=".jpg")]


def _pictures() -> list[bytes]:
    """Return a crop in XYZ with a layer, a tiled picture of half floats, and one of several parts."""
    planes = RANDOM.random((3, 12, 16)).astype(np.float32)
    named = {prefix: {f"{prefix}{name}": plane for name, plane in zip("RGB", planes, strict=True)}
             for prefix in ("", "View.Combined.")}
    lines: dict[str, Any] = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    crop = lines | {"dataWindow": ((2, 3), (17, 14)), "displayWindow": ((0, 0), (23, 15)),
                    "chromaticities": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)}
    tiled = lines | {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    half = {name: plane.astype(np.float16) for name, plane in named[""].items()}
    files = [OpenEXR.File(crop, named[""]), OpenEXR.File(crop, named["View.Combined."]), OpenEXR.File(tiled, half),
             OpenEXR.File([OpenEXR.Part(lines | {"name": name}, planes) for name, planes in named.items() if name])]
    with tempfile.TemporaryDirectory() as folder:
        for number, one in enumerate(files):
            one.write(f"{folder}/{number}.exr")
        return [Path(f"{folder}/{number}.exr").read_bytes() for number in range(len(files))]


def read_painted(path: Path) -> None:
    """Load what the file is part of: a mesh with an image and a library beside it."""
    for name, content in (("wood.png", PNG), ("a.obj", OBJ), ("a.mtl", MTL)):
        if name != path.name:
            (path.parent / name).write_bytes(content)
    read_scene(path if path.suffix in (".ply", ".obj") else path.with_name("a.obj"))


def read_other_picture(path: Path) -> None:
    try:
        read_colour(path)
    except InputError as error:
        if "--layer takes" not in str(error):
            raise
        read_colour(path, layer="View.Combined")


def _kit_file(name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        kit = write_kit(Path(folder) / "kit")
        return (kit / name).read_bytes()


def _bugs() -> bytes:
    bugs, values = BugWriter(), {"sum": np.arange(6, dtype=np.float32).reshape(2, 3)}
    entry = BugEntry(cause="half", shapes={"sum": (2, 3)}, arrays={})
    bugs.add("sum", entry, {"sum": Told(np.array([1, 2]), np.array([0.5, 1.0], np.float32), 2)}, values,
             {"sum": np.full((2, 3), 1e-6, np.float32)})
    return bugs.content()


def read_kit(path: Path, name: str) -> None:
    """Check the output of a port by a kit that has the file, its hashes as they must be."""
    home = path.parent / "kit"
    shutil.rmtree(home, ignore_errors=True)
    write_kit(home)
    case, content = home / "cases" / "a", path.read_bytes()
    output = home.parent / "output" / "a"
    output.mkdir(parents=True, exist_ok=True)
    (output / "sum.npy").write_bytes(content if name == "output" else npy(np.ones((2, 3), np.float32)))
    if name != "output":
        (home / name).write_bytes(content)
    manifest = (case / "manifest.json").read_bytes()
    if name.endswith(".npz"):
        manifest = manifest.replace(_sha256(BugWriter().content()), _sha256(content))
        (case / "manifest.json").write_bytes(manifest)
    if name != "kit.json":
        text = (home / "kit.json").read_text()
        known = json.loads(text)["cases"][0]["sha256"]
        (home / "kit.json").write_text(text.replace(known, _sha256(manifest).decode()))
    check_output(Kit(home), home.parent / "output", Asked())


def _sha256(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _kit_format(file: str, name: str, seeds: Callable[[], list[bytes]], named: str = "") -> Format:
    return Format(file, seeds, partial(read_kit, name=name), named=named or file)


GLB = Format("a.glb", _glb, read_scene)
OBJS = Format("a.obj", lambda: [OBJ], read_painted)
LIBRARY = Format("a.mtl", lambda: [MTL], read_painted, named="a.obj")
POLYGONS = Format("a.ply", _ply, read_painted)
IMAGE = Format("wood.png", _images, read_painted, named="a.obj")
PICTURE = Format("a.exr", _pictures, read_other_picture)
KIT = _kit_format("kit.json", "kit.json", lambda: [_kit_file("kit.json")], "kit")
MANIFEST = _kit_format("manifest.json", "cases/a/manifest.json", lambda: [_kit_file("cases/a/manifest.json")], "kit")
BUGS = _kit_format("bugs.npz", "cases/a/bugs.npz", lambda: [_bugs()], "kit")
OUTPUT = _kit_format("sum.npy", "output", lambda: [npy(), npy(np.arange(6.0).reshape(2, 3).T)], "sum")
