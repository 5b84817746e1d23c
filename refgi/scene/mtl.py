"""MTL files of OBJ meshes, and the lines of both as words and numbers.

`map_d`, which asks for partial transparency, becomes a cut-out with a cutoff of 1/2, unless it lies on a surface other
than `map_Kd`: a corner has one pair of coordinates.
"""

import dataclasses
import itertools
import math
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect, first_faults, shortened
from refgi.scene.files import is_strict, is_there, read_text
from refgi.scene.material import reflects_too_much
from refgi.scene.model import Material, Rgb
from refgi.scene.texture.image import Image, image_file
from refgi.scene.texture.table import Texture

TEXTURES = ("bump", "disp", "decal", "norm", "refl")  # and all that starts with map_
NAMED = ("newmtl", "usemtl", "mtllib", *TEXTURES)  # what a name follows


def lines_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line that says something, continued lines joined."""
    for number, line in enumerate(read_text(path).replace("\\\n", " ").split("\n"), 1):
        words = line.split()
        if words and "#" in line:
            words = _without_comment(words, line)
        if words:
            yield number, words


def _without_comment(words: list[str], line: str) -> list[str]:
    """Return the words before a comment; in a name, such as "Material #25", only a lone # starts one."""
    if words[0].lower() in NAMED or words[0].lower().startswith("map_"):
        return words[: words.index("#")] if "#" in words else words
    return line.partition("#")[0].split()


def numbers_of(words: list[str], where: str, count: int = 3) -> tuple[float, ...]:
    """Return so many numbers of a line; raises `InputError` if there are others."""
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    expect(len(values) == count, where, f"{count} number(s)", " ".join(words))
    return values


def colour_of(words: list[str], where: str) -> tuple[float, ...]:
    """Return the three numbers of a colour; one alone is grey."""
    return numbers_of(words * 3 if len(words) == 1 else words, where)


CUTOFF = 0.5
WHITE = (1.0, 1.0, 1.0)
SAME = 1e-3  # of a colour in CIE XYZ, which files round
# arguments that an option of map_Kd and map_d has at most
OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-clamp": 1, "-mm": 2, "-bm": 1, "-boost": 1, "-blendu": 1, "-blendv": 1,
           "-cc": 1, "-texres": 1, "-imfchan": 1, "-type": 1}


class TextureMap(NamedTuple):
    """What map_Kd or map_d says: an image, and where it lies: u' = scale u + offset, v upwards."""

    path: Path
    scale: tuple[float, float]
    offset: tuple[float, float]
    clamp: bool
    where: str  # file and line, for errors

    def texture(self, *, opacity: bool = False) -> Texture:
        """Return the texture, its image decoded; raises `InputError` naming the line if that cannot be read.

        `opacity`: that of map_d, whose alpha is the image's, or its grey where it has none.
        """
        try:
            image = image_file(self.path)
        except InputError as error:
            key = "map_d" if opacity else "map_Kd"
            raise InputError(f"{self.where}: {key}: {shortened(str(error), 1000)}") from error
        if opacity and image.alpha is None:
            grey = np.round(image.pixels.mean(axis=2, dtype=np.float64)).astype(image.pixels.dtype)
            image = Image(image.pixels, image.name, grey)
        return Texture(image, ("clamp", "clamp") if self.clamp else ("repeat", "repeat"))

    def lies_as(self, other: "TextureMap") -> bool:
        """Return whether both lie on a surface alike."""
        return self[1:4] == other[1:4]


class Maps(NamedTuple):
    """The textures of a material, not yet decoded; one of them at least."""

    diffuse: TextureMap | None
    opacity: TextureMap | None = None
    grey: bool = False  # without its texture, as there is no Kd

    @property
    def absent(self) -> list[TextureMap]:
        """Those whose file is not there."""
        return [found for found in self[:2] if found and not is_there(found.path)]

    @property
    def place(self) -> TextureMap:
        """What says where they lie on a surface."""
        found = self.diffuse or self.opacity
        assert found is not None
        return found

    def painted(self, material: Material) -> Material:
        """Return a material with them, decoded; raises `InputError` if one is absent where readers are strict."""
        absent = [] if is_strict() else self.absent
        if self.diffuse in absent:
            material = dataclasses.replace(material, diffuse=Material().diffuse if self.grey else material.diffuse)
        if self.opacity in absent:
            material = dataclasses.replace(material, cutoff=None, alpha=1.0)
        diffuse, opacity = (None if found in absent else found for found in self[:2])
        return dataclasses.replace(material, texture=diffuse and diffuse.texture(),
                                   alpha_texture=opacity and opacity.texture(opacity=True))


def read_library(path: Path) -> tuple[dict[str, Material], dict[str, Maps]]:
    """Read the materials of an MTL file: Kd as albedo, Ks and Ns as Phong lobe, Ke as emission; textures apart.

    Result: materials by name, and the textures of those that have some, not yet decoded. A lobe that would reflect more
    than arrives together with Kd is left out. Raises `InputError` if the file is missing or a value is out of range.

    Warns `RefgiWarning` if lobes are left out, opacity is not what the file says, or other textures or unknown options
    of textures are named.
    """
    textures: list[tuple[str, ...]] = []
    maps: dict[str, Maps] = {}
    opacities: dict[str, TextureMap] = {}
    options: set[str] = set()
    spectral, cut = 0, 0
    name = ""
    values: dict[str, dict[str, tuple[float, ...]]] = {}
    current: dict[str, tuple[float, ...]] = {}
    for number, words in lines_of(path):
        if words[0] == "newmtl":
            name = " ".join(words[1:])
            current = values.setdefault(name, {})
        elif words[0] in ("Kd", "Ks", "Ke") and words[1:2] == ["spectral"]:
            spectral += 1
        elif words[0] in ("Kd", "Ks", "Ke") and words[1:2] == ["xyz"]:
            current[words[0]], outside = _in_rec_709(colour_of(words[2:5], f"{path}: line {number}"), words[0])
            cut += outside
        elif words[0] in ("Kd", "Ks", "Ke"):
            current[words[0]] = colour_of(words[1:4], f"{path}: line {number}")
        elif words[0] == "Ns":
            current["Ns"] = numbers_of(words[1:2], f"{path}: line {number}", 1)
        elif words[0] in ("d", "Tr") and _is_number(words[-1]):
            opacity = float(words[-1])
            current["d"] = (opacity if words[0] == "d" else 1.0 - opacity,)
        elif words[0].lower() in ("map_kd", "map_d") and len(words) > 1:
            found, unread = _texture_map(words[1:], path, f"{path}: line {number}")
            if words[0].lower() == "map_kd":
                maps[name] = Maps(found)
            else:
                opacities[name] = found
            options |= unread
        elif words[0].lower().startswith("map_") or words[0].lower() in TEXTURES:
            textures.append(tuple(words))
    _warn_of_textures(textures, path)
    for count, text in ((spectral, f"{spectral:,} spectral colour(s) (.rfl) passed over: no spectra here"),
                        (cut, f"{cut:,} colour(s) of CIE XYZ outside of Rec. 709 cut"),
                        (len(options), f"options {', '.join(sorted(options))} of map_Kd passed over")):
        if count:
            warnings.warn(RefgiWarning(f"{path}: {text}"), stacklevel=5)
    for name in maps.keys() & values.keys():
        if "Kd" not in values[name]:
            values[name]["Kd"] = WHITE
            maps[name] = maps[name]._replace(grey=True)
    _add_cut_outs(opacities, values, maps, path)
    too_bright = sum(_is_lobed(found) and reflects_too_much(*_reflectances(found)) for found in values.values())
    if too_bright:
        warnings.warn(RefgiWarning(f"{path}: {too_bright:,} of {len(values):,} materials with diffuse + specular "
                                   f"(Kd + Ks) over 1 in a channel: specular left out"), stacklevel=5)
    return {name: _material(name, found, path) for name, found in values.items()}, maps


def _add_cut_outs(opacities: dict[str, TextureMap], values: dict[str, dict[str, tuple[float, ...]]],
                  maps: dict[str, Maps], path: Path) -> None:
    """Give materials of map_d a cutoff, and warn of it and of what of d, Tr and map_d is passed over."""
    cut, elsewhere = 0, 0
    for name, found in opacities.items():
        diffuse = maps[name].diffuse if name in maps else None
        if diffuse is not None and not found.lies_as(diffuse):
            elsewhere += 1
            continue
        maps[name] = Maps(diffuse, found, name in maps and maps[name].grey)
        values.setdefault(name, {})["cutoff"] = (CUTOFF,)
        cut += 1
    partial = sum("cutoff" not in found and found.get("d", (1.0,))[0] < 1 for found in values.values())
    for count, what in ((cut, f"with map_d cut out where opacity is below {CUTOFF}: no partial transparency"),
                        (elsewhere, "with map_d, which lies other than map_Kd, opaque here"),
                        (partial, "with opacity below 1 (d, Tr), opaque here")):
        if count:
            warnings.warn(RefgiWarning(f"{path}: {count:,} material(s) {what}"), stacklevel=6)


def _texture_map(words: list[str], path: Path, where: str) -> tuple[TextureMap, set[str]]:
    """Return what the arguments of map_Kd or map_d say, and the options among them that are not read."""
    scale, offset, clamp, unread = [1.0, 1.0], [0.0, 0.0], False, set[str]()
    while len(words) > 1 and words[0] in OPTIONS:
        option, most = words[0], OPTIONS[words[0]]
        values = words[1:-1][:most]
        if most > 1:
            values = list(itertools.takewhile(_is_number, values))
        if option in ("-s", "-o"):
            expect(bool(values), f"{where}: {option}", "one to three numbers", words[1])
            target = scale if option == "-s" else offset
            target[: len(values[:2])] = map(float, values[:2])
        elif option == "-clamp":
            clamp = values[:1] == ["on"]
        else:
            unread.add(option)
        words = words[1 + len(values) :]
    name = " ".join(words).replace("\\", "/")
    return TextureMap(path.parent / name, (scale[0], scale[1]), (offset[0], offset[1]), clamp, where), unread


def _in_rec_709(xyz: tuple[float, ...], key: str) -> tuple[tuple[float, ...], bool]:
    """Return a colour of CIE XYZ as linear Rec. 709, and whether it had to be cut: reflectances lie from 0 to 1."""
    from refgi.image.picture import REC_709, xyz_of  # few files ask for it

    rgb = np.linalg.solve(xyz_of(REC_709), xyz)
    found = np.clip(rgb, 0, None if key == "Ke" else 1)
    return tuple(found.tolist()), bool((np.abs(found - rgb) > SAME).any())


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _warn_of_textures(textures: Sequence[tuple[str, ...]], path: Path) -> None:
    """Say how many textures a file names, and which of them are not there."""
    if not textures:
        return
    kinds = ", ".join(sorted({shortened(words[0], 40) for words in textures})[:10])
    # options come before the name, which may hold spaces
    found = {words: any(is_there(path.parent / " ".join(words[k:]).replace("\\", "/"))
                        for k in range(1, min(len(words), 20))) for words in set(textures)}
    missing = [" ".join(words[1:]) for words in textures if not found[words]]
    absent = f"; {len(missing):,} of them name no file: {first_faults([shortened(m, 80) for m in missing], ', ')}"
    bumps = any(word in words[0].lower() for words in textures for word in ("bump", "norm"))
    normals = " (shading normals stay the mesh's)" if bumps else ""
    text = f"{path}: {len(textures):,} texture(s) ({kinds}) passed over{normals}{absent if missing else ''}"
    warnings.warn(RefgiWarning(text), stacklevel=6)


def _is_lobed(found: dict[str, tuple[float, ...]]) -> bool:
    return found.get("Ns", (0.0,))[0] > 0


def _reflectances(found: dict[str, tuple[float, ...]]) -> tuple[Rgb, Rgb]:
    return _rgb(found.get("Kd", (0.5, 0.5, 0.5))), _rgb(found.get("Ks", (0.0, 0.0, 0.0)))


def _material(name: str, found: dict[str, tuple[float, ...]], path: Path) -> Material:
    diffuse, specular = _reflectances(found)
    exponent = found.get("Ns", (0.0,))[0]
    if not _is_lobed(found) or reflects_too_much(diffuse, specular):
        specular, exponent = (0.0, 0.0, 0.0), 0.0
    try:
        cutoff = found.get("cutoff", (None,))[0]
        return Material(name, diffuse, specular, exponent, emission=_rgb(found.get("Ke", (0.0, 0.0, 0.0))),
                        alpha=1.0 if cutoff is None else min(max(found.get("d", (1.0,))[0], 0.0), 1.0), cutoff=cutoff)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _rgb(values: tuple[float, ...]) -> Rgb:
    return values[0], values[1], values[2]
