"""Images: each form gives its codes, linear light is the exact curve, a fault names the file; judged before decoded."""

import io
import json
import struct
import zlib
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from PIL import Image as Pictures

from refgi.errors import InputError
from refgi.scene import load_scene
from refgi.scene.obj import read_obj
from refgi.scene.texture.image import BYTES_OF_TEXEL, Image, decoded, image_file, srgb_table
from refgi.scene.texture.table import level_sizes, next_level
from tests.naive import textures as naive
from tests.scene.samples import BUFFER, glb_bytes, gltf_tree, write_scene

ROUNDING = 1e-15  # of one power in float64
RNG = np.random.default_rng(5)
CODES = RNG.integers(0, 256, (5, 7, 3), np.uint8)


def encoded(picture: Pictures.Image, kind: str = "PNG", **options: object) -> bytes:
    out = io.BytesIO()
    picture.save(out, kind, **options)  # type: ignore[arg-type]
    return out.getvalue()


def png16(codes: np.ndarray) -> bytes:
    """A 16-bit PNG of 1, 3 or 4 channels, chunk by chunk: Pillow and imageio write none in colour."""
    height, width, channels = codes.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in codes)

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    head = struct.pack(">IIBBBBB", width, height, 16, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@pytest.mark.feature("REF-22")
@pytest.mark.parametrize("codes", [256, 65536])
def test_the_curve_is_exact_at_every_code(codes: int) -> None:
    table = srgb_table(codes)
    assert len(table) == codes
    assert np.abs(table - [naive.linear(code, codes - 1) for code in range(codes)]).max() <= ROUNDING
    assert (table[0], table[-1]) == (0.0, 1.0)


@pytest.mark.feature("REF-22")
def test_texels_are_decoded_one_by_one_and_16_bits_hold_those_of_8() -> None:
    eight, sixteen = Image(CODES), Image(CODES.astype(np.uint16) * 257)
    assert np.array_equal(eight.linear(), srgb_table(256).astype(np.float32)[CODES])
    assert np.array_equal(eight.linear(), sixteen.linear())
    assert eight.linear().dtype == np.float32


@pytest.mark.feature("REF-22")
def test_eight_bits_in_colour_with_and_without_alpha() -> None:
    alpha = np.concatenate([CODES, RNG.integers(0, 256, (5, 7, 1), np.uint8)], axis=2)
    for content in (imageio.v3.imwrite("<bytes>", CODES, extension=".png"), encoded(Pictures.fromarray(alpha))):
        assert np.array_equal(decoded(content, "a").pixels, CODES)


@pytest.mark.feature("REF-22")
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_sixteen_bits_keep_their_lower_byte(channels: int) -> None:
    codes = RNG.integers(0, 65536, (4, 3, channels), np.uint16)
    found = decoded(png16(codes), "a").pixels
    assert found.dtype == np.uint16
    assert np.array_equal(found, np.broadcast_to(codes, (4, 3, 1 if channels == 1 else channels))[..., [0, 0, 0]
                          if channels == 1 else [0, 1, 2]])


@pytest.mark.feature("REF-22")
def test_grey_and_palettes_of_few_bits() -> None:
    grey = CODES[..., 0]
    assert np.array_equal(decoded(encoded(Pictures.fromarray(grey)), "a").pixels, np.repeat(grey[..., None], 3, 2))
    with_alpha = encoded(Pictures.merge("LA", [Pictures.fromarray(grey), Pictures.fromarray(CODES[..., 1])]))
    assert np.array_equal(decoded(with_alpha, "b").pixels, np.repeat(grey[..., None], 3, 2))
    palette = Pictures.new("P", (7, 5))
    colours = RNG.integers(0, 256, (4, 3), np.uint8)
    palette.putpalette(colours.tobytes())
    palette.putdata((grey % 4).ravel().tolist())
    for options in ({}, {"transparency": 1}, {"bits": 2}):
        assert np.array_equal(decoded(encoded(palette, **options), "c").pixels, colours[grey % 4])
    bits = Pictures.fromarray(grey > 127)
    assert np.array_equal(decoded(encoded(bits), "d").pixels[..., 1], (grey > 127) * 255)


@pytest.mark.feature("REF-22")
def test_jpeg_in_colour_grey_and_four_inks() -> None:
    for mode, ink, expected in (("RGB", (200, 100, 50), (200, 100, 50)), ("L", 90, (90, 90, 90)),
                                ("CMYK", (51, 0, 102, 51), (163.2, 204, 122.4))):  # 255 (1 - C) (1 - K)
        content = encoded(Pictures.new(mode, (8, 8), ink), "JPEG", quality=100)
        found = decoded(content, "a").pixels
        assert found.shape == (8, 8, 3)
        assert np.abs(found - np.array(expected)).max() <= 2  # of a lossy file


def test_one_texel_and_sizes_that_are_no_powers_of_two() -> None:
    assert decoded(encoded(Pictures.new("RGB", (1, 1), (1, 2, 3))), "a").pixels.tolist() == [[[1, 2, 3]]]
    assert level_sizes(7, 5) == [(7, 5), (3, 2), (1, 1)]
    assert level_sizes(1, 6) == [(1, 6), (1, 3), (1, 1)]


@pytest.mark.feature("REF-23")
@pytest.mark.parametrize("shape", [(5, 7), (4, 6), (3, 1), (1, 1), (2, 9), (13, 11)])
def test_levels_are_means_of_areas_and_keep_the_whole(shape: tuple[int, int]) -> None:
    level = image = RNG.random((*shape, 3))
    while level.shape[:2] != (1, 1):
        above = next_level(level)
        assert np.allclose(above, naive.halved(level), rtol=0, atol=1e-14)
        level = above
    assert np.allclose(level[0, 0], image.mean(axis=(0, 1)), rtol=0, atol=1e-14)


def test_equal_files_are_one_image_and_equality_is_by_texels(tmp_path: Path) -> None:
    content = encoded(Pictures.fromarray(CODES))
    for name in ("one.png", "two.png"):
        (tmp_path / name).write_bytes(content)
    first = image_file(tmp_path / "one.png")
    assert image_file(tmp_path / "two.png") is first
    assert first == Image(CODES)
    assert hash(first) == hash(Image(CODES))
    assert first != Image(CODES ^ np.uint8(1))
    assert first != Image(CODES.astype(np.uint16))
    assert first != Image(CODES.reshape(7, 5, 3))


def test_faults_name_the_file_and_what_is_wrong(tmp_path: Path) -> None:
    good = encoded(Pictures.fromarray(RNG.integers(0, 256, (64, 64, 3), np.uint8)))
    jpeg = encoded(Pictures.fromarray(RNG.integers(0, 256, (64, 64, 3), np.uint8)), "JPEG")
    for name, content, said in (
        ("cut.png", good[: len(good) // 2], "damaged or cut short"), ("cut.jpg", jpeg[: len(jpeg) // 2], "cut short"),
        ("none.png", b"no image at all", "expected an image"), ("gif.png", b"GIF89a" + good, "expected an image"),
        ("empty.png", b"", "the file is empty"), ("head.png", good[:20], "head.png"),
        ("flip.png", good[:60] + bytes([good[60] ^ 255]) + good[61:], "damaged"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=said) as error:
            image_file(tmp_path / name)
        assert str(tmp_path / name) in str(error.value)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"absent\.png: no such file"):
        image_file(tmp_path / "absent.png")


def test_an_image_that_is_too_large_is_refused_before_it_is_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    content = encoded(Pictures.new("L", (60, 50)))
    monkeypatch.setattr("refgi.scene.texture.image.MOST_TEXELS", 2999)
    with pytest.raises(InputError, match=r"a\.png: expected at most 2,999 texels, got '60 x 50'"):
        decoded(content, "a.png")
    monkeypatch.setattr("refgi.scene.texture.image.MOST_TEXELS", 3000)
    monkeypatch.setattr("refgi.scene.texture.image.physical_memory", lambda: 3000.0 * 30)
    with pytest.raises(InputError, match=r"a\.png: expected an image that fits in 0\.0 GiB of memory"):
        decoded(content, "a.png")


@pytest.mark.parametrize("pixels", [CODES[..., :2], CODES[0], CODES.astype(np.int32), CODES / 200.0,
                                    np.full((1, 1, 3), np.nan), CODES[:0]])
def test_texels_of_other_forms_are_refused(pixels: np.ndarray) -> None:
    with pytest.raises(InputError, match="image: expected"):
        Image(pixels)


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
