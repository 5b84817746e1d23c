"""Pictures of other programs: windows, layers, parts, primaries and forms of storage, written by OpenEXR itself."""

import contextlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.errors import InputError, RefgiWarning
from refgi.image import read_exr, write_exr
from refgi.image.picture import read_colour
from refgi.methods import render

RNG = np.random.default_rng(5)
RGB = RNG.random((3, 12, 16)).astype(np.float32)
ROUNDED = 2e-4  # of matrices that are published with four digits
P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
TO_709 = {  # IEC 61966-2-1, SMPTE EG 432-1: linear XYZ and Display P3 to linear Rec. 709
    (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3): ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415),
                                                   (0.0557, -0.2040, 1.0570)),
    P3: ((1.2249, -0.2247, 0.0), (-0.0420, 1.0419, 0.0), (-0.0197, -0.0786, 1.0979))}


def save(path: Path, planes: np.ndarray = RGB, prefix: str = "", **header: object) -> Path:
    channels = {f"{prefix}{name}": np.ascontiguousarray(plane) for name, plane in zip("RGB", planes, strict=True)}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header,
                 channels).write(str(path))
    return path


def window(left: int, top: int, right: int, bottom: int) -> tuple[tuple[int, int], tuple[int, int]]:
    return (left, top), (right, bottom)


@pytest.mark.parametrize(("data", "display", "size", "rows", "columns", "stored"), [
    ((0, 0, 15, 11), (0, 0, 15, 11), (16, 12), (0, 12), (0, 16), np.s_[:, :, :]),
    ((8, 16, 23, 27), (0, 0, 63, 63), (64, 64), (16, 28), (8, 24), np.s_[:, :, :]),  # a crop
    ((-2, -1, 13, 10), (0, 0, 9, 7), (10, 8), (0, 8), (0, 10), np.s_[:, 1:9, 2:12]),  # overscan
    ((5, 5, 20, 16), (10, 10, 25, 21), (16, 12), (0, 7), (0, 11), np.s_[:, 5:, 5:]),  # both, and an origin elsewhere
])
def test_pixels_lie_where_the_windows_say(tmp_path, data, display, size, rows, columns, stored):
    found = read_colour(save(tmp_path / "a.exr", dataWindow=window(*data), displayWindow=window(*display)))
    assert (found.size, found.rows, found.columns) == (size, slice(*rows), slice(*columns))
    assert np.array_equal(found.planes, RGB[stored])


def test_a_picture_without_a_stored_pixel_is_refused(tmp_path):
    file = save(tmp_path / "a.exr", dataWindow=window(20, 0, 35, 11), displayWindow=window(0, 0, 15, 11))
    with pytest.raises(InputError, match=r"dataWindow: expected pixels inside the display window \(0, 0\)-\(15, 11\)"):
        read_colour(file)


@pytest.mark.parametrize(("chromaticities", "matrix"), TO_709.items(), ids=["XYZ", "P3"])
def test_primaries_are_converted_and_said(tmp_path, chromaticities, matrix):
    file = save(tmp_path / "a.exr", chromaticities=chromaticities)
    with pytest.warns(RefgiWarning, match=r"a\.exr: chromaticities .*: colours are converted to Rec\. 709"):
        found = read_colour(file)
    expected = np.einsum("ij,jhw->ihw", np.array(matrix), RGB)
    assert np.abs(found.planes - expected).max() < ROUNDED * 3 * RGB.max()
    assert np.abs(found.planes - RGB).max() > 0.01


def test_pixels_beyond_float32_are_infinite_after_a_conversion(tmp_path):
    """Of XYZ, red is 3.24 X - 1.54 Y - 0.50 Z: the largest numbers of X alone are more than float32 holds."""
    planes = np.zeros((3, 2, 2), np.float32)
    planes[0, 0] = np.finfo(np.float32).max, np.nan
    planes[0, 1] = np.inf, 1
    with pytest.warns(RefgiWarning, match="colours are converted") as warned:
        found = read_colour(save(tmp_path / "a.exr", planes, chromaticities=next(iter(TO_709)))).planes
    assert len(warned) == 1
    assert np.array_equal(np.isfinite(found[0]), [[False, False], [False, True]])
    assert found[0, 0, 0] == np.inf


def test_rec_709_by_name_is_left_to_the_bit(tmp_path):
    file = save(tmp_path / "a.exr", chromaticities=(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    assert np.array_equal(read_colour(file).planes, RGB)


@pytest.mark.parametrize("chromaticities", [
    (0.6, 0.3, 0.6, 0.3, 0.6, 0.3, 0.3, 0.3), (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0),
    (float("nan"),) * 8, (0.0,) * 8])
def test_primaries_without_a_space_are_refused(tmp_path, chromaticities):
    with pytest.raises(InputError, match="expected primaries that span a space of colours"):
        read_colour(save(tmp_path / "a.exr", chromaticities=chromaticities))


def test_an_attribute_of_another_type_is_refused(tmp_path):
    file = save(tmp_path / "a.exr", chromaticities=P3)
    content, known = file.read_bytes(), b"chromaticities\0chromaticities\0"
    assert content.count(known) == 1
    file.write_bytes(content.replace(known, known[:-2] + b"x\0"))
    with pytest.raises(InputError, match=r"a\.exr: chromaticities: expected an attribute of 8 number"):
        read_colour(file)


def test_layers_are_chosen_by_name(tmp_path):
    file = save(tmp_path / "a.exr", prefix="ViewLayer.Combined.")
    for name in ("ViewLayer.Combined", "ViewLayer.Combined."):
        assert np.array_equal(read_colour(file, layer=name).planes, RGB)
    with pytest.raises(InputError, match=r"expected channels R, G, B, got .*; --layer takes ViewLayer\.Combined"):
        read_colour(file)
    with pytest.raises(InputError, match=r"expected channels Other\.R, Other\.G, Other\.B, got"):
        read_colour(file, layer="Other")


def test_parts_are_chosen_by_name_or_number(tmp_path):
    file, other = tmp_path / "a.exr", np.flip(RGB, 0).copy()

    def part(name: str, planes: np.ndarray, prefix: str = "") -> OpenEXR.Part:
        return OpenEXR.Part({"name": name, "type": OpenEXR.scanlineimage},
                            {f"{prefix}{key}": plane for key, plane in zip("RGB", planes, strict=True)})

    depth = OpenEXR.Part({"name": "depth", "type": OpenEXR.scanlineimage}, {"Z": RGB[0]})
    OpenEXR.File([depth, part("left", RGB), part("right", other), part("sky", other, "Env.")]).write(str(file))
    for name in ("left", "1"):
        assert np.array_equal(read_colour(file, part=name).planes, RGB)
    for name in ("right", "2"):
        assert np.array_equal(read_colour(file, part=name).planes, other)
    assert np.array_equal(read_colour(file, layer="Env").planes, other)  # the only part that has it
    with pytest.raises(InputError, match="2 parts have channels R, G, B: --part names one of left, right"):
        read_colour(file)
    with pytest.raises(InputError, match="--part: expected one of depth, left, right, sky, got 'up'"):
        read_colour(file, part="up")
    with pytest.raises(InputError, match="--part: expected one of depth, left, right, sky, got '4'"):
        read_colour(file, part="4")
    with pytest.raises(InputError, match="expected channels R, G, B in part depth, got Z"):
        read_colour(file, part="depth")


FORMS = [{"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}, {"lineOrder": OpenEXR.DECREASING_Y},
         {"compression": OpenEXR.NO_COMPRESSION}, {"compression": OpenEXR.PIZ_COMPRESSION}]


@pytest.mark.parametrize("header", FORMS, ids=["tiled", "decreasing", "plain", "piz"])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_every_form_of_storage_is_the_same_picture(tmp_path, header, kind):
    found = read_colour(save(tmp_path / "a.exr", RGB.astype(kind), **header))
    assert np.array_equal(found.planes, RGB.astype(kind).astype(np.float32))


def test_channels_without_a_value_for_each_pixel_are_named(tmp_path):
    file, half = tmp_path / "a.exr", RGB[0, ::2, ::2].copy()
    channels = {name: OpenEXR.Channel(name, half, 2, 2) for name in "RGB"}
    OpenEXR.File({"type": OpenEXR.scanlineimage, "dataWindow": window(0, 0, 15, 11)}, channels).write(str(file))
    with pytest.raises(InputError, match=r"channels: expected a value for each pixel, not every other, got \['B', 'G"):
        read_colour(file)


def test_wide_pixels_are_said(tmp_path):
    with pytest.warns(RefgiWarning, match="pixelAspectRatio 2: pixels are taken as square"):
        read_colour(save(tmp_path / "a.exr", pixelAspectRatio=2.0))


def test_sizes_are_judged_before_pixels_are_read(tmp_path, monkeypatch):
    file = save(tmp_path / "a.exr")
    needed = 2 * 4 * RGB.size
    monkeypatch.setattr("refgi.image.exr.available_bytes", lambda: needed)
    assert np.array_equal(read_exr(file)[0]["R"], RGB[0])
    monkeypatch.setattr("refgi.image.exr.available_bytes", lambda: needed - 1)
    monkeypatch.setattr("refgi.image.exr._part", lambda _: pytest.fail("pixels were read"))
    for read in (read_exr, read_colour):
        with pytest.raises(InputError, match=f"its pixels need about {needed:,} bytes of memory, {needed - 1:,} are"):
            read(file)


def test_a_small_file_of_a_huge_picture_is_refused(tmp_path):
    """The same file but for the corner of its data window: 16 million times as many pixels."""
    content = save(tmp_path / "a.exr").read_bytes()
    corner = b"dataWindow\0box2i\0" + (16).to_bytes(4, "little") + bytes(8)
    place = content.index(corner) + len(corner)
    huge = (2**16 - 1).to_bytes(4, "little")
    (tmp_path / "b.exr").write_bytes(content[:place] + huge * 2 + content[place + 8 :])
    with pytest.raises(InputError, match=r"b\.exr: (its pixels need about|not a readable EXR)"):
        read_exr(tmp_path / "b.exr")


def test_a_file_that_another_program_has_changed_is_read_as_its_own(tmp_path):
    file = tmp_path / "a.exr"
    write_exr(file, dict(zip("RGB", RGB, strict=True)), {"n": 1})
    with OpenEXR.File(str(file), separate_channels=True) as held:
        mark = held.header()["refgi"]
    save(file, RGB[:, 2:8, 3:9].copy(), refgi=mark, dataWindow=window(3, 2, 8, 7), displayWindow=window(0, 0, 15, 11))
    with pytest.warns(RefgiWarning, match="differ from what refgi wrote"):
        assert np.array_equal(read_colour(file).planes, RGB[:, 2:8, 3:9])
    with pytest.raises(InputError, match="damaged"):
        read_exr(file)


def test_damaged_files_raise_input_errors_alone(tmp_path):
    content, chance = save(tmp_path / "a.exr", prefix="x.").read_bytes(), np.random.default_rng(2)
    for _ in range(300):
        changed = bytearray(content)
        changed[chance.integers(8, 420)] = chance.integers(256)
        (tmp_path / "b.exr").write_bytes(changed)
        with contextlib.suppress(InputError):
            read_colour(tmp_path / "b.exr", layer="x")


@pytest.fixture(scope="module")
def right():
    with pytest.warns(RefgiWarning, match="clamp"):
        return render("cornell_box", "sii", width=24, height=20, rsm_resolution=32)


def check(file: Path, *options: str):
    return CliRunner().invoke(VerbGroup.refgi(), [
        "check", str(file), "--against", "cornell_box", "--method", "sii", "--rsm-resolution", "32", *options])


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_a_crop_is_judged_by_its_own_pixels(tmp_path, right, off):
    planes = right.radiance[:, 5:15, 2:20] * np.float32(1 + off)
    file = save(tmp_path / "a.exr", planes, "Beauty.", dataWindow=window(2, 5, 19, 14),
                displayWindow=window(0, 0, 23, 19))
    result = check(file, "--layer", "Beauty")
    assert result.exit_code == bool(off), result.output
    assert "of 24x20 the stored pixels, columns 2 to 19, rows 5 to 14" in result.output
    assert check(file).exit_code == 2


def test_a_part_of_the_truth_is_judged_by_its_own_variance(tmp_path):
    """Overscan to the upper left, a crop at the lower right."""
    made = render("cornell_box", "truth", width=24, height=20, rsm_resolution=32)
    wide = np.pad(made.irradiance, ((0, 0), (3, 3), (3, 3)), constant_values=1e6)
    file = save(tmp_path / "a.exr", wide[:, :-8, :-9], "irradiance.", dataWindow=window(-3, -3, 17, 14),
                displayWindow=window(0, 0, 23, 19))
    result = CliRunner().invoke(VerbGroup.refgi(), ["check", str(file), "--against", "cornell_box",
                                                    "--rsm-resolution", "32"])
    assert result.exit_code == 0, result.output
    assert "indirect irradiance is that of" in result.output
