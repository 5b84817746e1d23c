"""Images of a scene are judged together, by their headers, before one of them is decoded."""

import json
from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from refgi.errors import InputError
from refgi.scene import load_scene
from refgi.scene.obj import read_obj
from refgi.scene.texture.image import BYTES_OF_TEXEL
from tests.scene.samples import BUFFER, glb_bytes, gltf_tree, write_scene

COUNT, WIDTH, HEIGHT = 3, 50, 40
NEEDED = COUNT * WIDTH * HEIGHT * BYTES_OF_TEXEL
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)


def picture(number: int) -> bytes:
    texels = np.full((HEIGHT, WIDTH, 3), number, np.uint8)
    return imageio.v3.imwrite("<bytes>", texels, extension=".png")


def inside(folder: Path, shown: int = COUNT) -> Path:
    """The sample square once for each image, all of them in the file's buffer, the first image by two textures."""
    tree, buffer = gltf_tree(), BUFFER + UV.tobytes()
    tree["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": 32})
    tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"})
    tree["images"], tree["materials"], primitives = [], [], []
    for number in range(COUNT):
        tree["bufferViews"].append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(picture(number))})
        tree["images"].append({"bufferView": 3 + number, "mimeType": "image/png"})
        buffer += picture(number)
        colour = {"baseColorTexture": {"index": number}} if number < shown else {}
        tree["materials"].append({"pbrMetallicRoughness": colour | {"metallicFactor": 0}})
        first = tree["meshes"][0]["primitives"][0]
        primitives.append(first | {"material": number, "attributes": first["attributes"] | {"TEXCOORD_0": 2}})
    tree["textures"] = [{"source": number} for number in (*range(COUNT), 0)]
    tree["materials"][0]["emissiveTexture"] = {"index": COUNT}
    tree["meshes"][0]["primitives"] = primitives
    tree["buffers"][0]["byteLength"] = len(buffer)
    path = folder / "a.glb"
    path.write_bytes(glb_bytes(tree, buffer))
    return path


def beside(folder: Path) -> Path:
    """A scene file of one square, and as many painted materials."""
    path = write_scene(folder)
    scene = json.loads(path.read_text())
    for number in range(COUNT):
        (folder / f"{number}.png").write_bytes(picture(number))
        scene["materials"][f"painted{number}"] = {"type": "diffuse", "diffuse": {"texture": f"{number}.png"}}
    scene["materials"]["again"] = {"type": "diffuse", "diffuse": {"texture": "0.png"}}
    path.write_text(json.dumps(scene))
    return path


def library(folder: Path) -> Path:
    """An OBJ of a triangle for each image."""
    text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"
    materials = ""
    for number in range(COUNT):
        (folder / f"{number}.png").write_bytes(picture(number))
        materials += f"newmtl m{number}\nmap_Kd {number}.png\n"
        text += f"usemtl m{number}\nf 1/1 2/1 3/1\n"
    (folder / "a.mtl").write_text(materials + "newmtl unused\nmap_Kd 0.png\nnewmtl other\nmap_Kd gone.png\n")
    (folder / "a.obj").write_text(text)
    return folder / "a.obj"


def read(path: Path) -> None:
    if path.suffix == ".obj":
        read_obj(path)
    else:
        load_scene(path)


@pytest.mark.parametrize("made", [inside, beside, library])
def test_all_of_them_are_judged_before_one_is_decoded(tmp_path, monkeypatch, made):
    path = made(tmp_path)
    for key, amount in (("refgi.scene.texture.image.available_bytes", NEEDED - 1),
                        ("refgi.scene.texture.image.physical_memory", float(NEEDED - 1))):
        with monkeypatch.context() as patch:
            patch.setattr(key, lambda amount=amount: amount)
            patch.setattr("refgi.scene.texture.image._read", lambda *_: pytest.fail("an image was decoded"))
            with pytest.raises(InputError, match=f"{COUNT} images that fit in .* memory, got '"
                                                 f"{COUNT * WIDTH * HEIGHT:,} texels"):
                read(path)


@pytest.mark.parametrize("made", [inside, beside, library])
def test_each_counts_once(tmp_path, monkeypatch, made):
    path = made(tmp_path)
    monkeypatch.setattr("refgi.scene.texture.image.available_bytes", lambda: NEEDED)
    read(path)


def test_an_image_that_no_material_shows_does_not_count(tmp_path, monkeypatch):
    path = inside(tmp_path, shown=COUNT - 1)
    monkeypatch.setattr("refgi.scene.texture.image.available_bytes",
                        lambda: NEEDED - WIDTH * HEIGHT * BYTES_OF_TEXEL)
    load_scene(path)
