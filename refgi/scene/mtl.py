"""MTL files of OBJ meshes: diffuse, specular and emissive colours of materials, and the texture of the diffuse one."""

import itertools
import math
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from refgi.errors import InputError, RefgiWarning, expect, first_faults, shortened
from refgi.scene.files import is_there, read_bytes
from refgi.scene.material import reflects_too_much
from refgi.scene.model import Material, Rgb
from refgi.scene.texture.image import image_file
from refgi.scene.texture.texture import Texture

TEXTURES = ("bump", "disp", "decal", "norm", "refl")  # and all that starts with map_
# arguments that an option of map_Kd has at most
OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-clamp": 1, "-mm": 2, "-bm": 1, "-boost": 1, "-blendu": 1, "-blendv": 1,
           "-cc": 1, "-texres": 1, "-imfchan": 1, "-type": 1}


class DiffuseMap(NamedTuple):
    """What map_Kd says: an image, and where it lies: u' = scale u + offset, v upwards."""

    path: Path
    scale: tuple[float, float]
    offset: tuple[float, float]
    clamp: bool
    where: str  # file and line, for errors

    def texture(self) -> Texture:
        """Return the texture, its image decoded; raises `InputError` naming the line if that cannot be read."""
        try:
            image = image_file(self.path)
        except InputError as error:
            raise InputError(f"{self.where}: map_Kd: {shortened(str(error), 1000)}") from error
        return Texture(image, ("clamp", "clamp") if self.clamp else ("repeat", "repeat"))


def read_library(path: Path) -> tuple[dict[str, Material], dict[str, DiffuseMap]]:
    """Read the materials of an MTL file: Kd as albedo, Ks and Ns as Phong lobe, Ke as emission; map_Kd apart.

    Result: materials by name, and the texture of those that have one, not yet decoded. A lobe that would reflect more
    than arrives together with Kd is left out. Raises `InputError` if the file is missing or a value is out of range.

    Warns `RefgiWarning` if lobes are left out, or other textures or unknown options of map_Kd are named.
    """
    textures: list[tuple[str, ...]] = []
    maps: dict[str, DiffuseMap] = {}
    options: set[str] = set()
    name = ""
    values: dict[str, dict[str, tuple[float, ...]]] = {}
    current: dict[str, tuple[float, ...]] = {}
    for number, words in lines_of(path):
        if words[0] == "newmtl":
            name = " ".join(words[1:])
            current = values.setdefault(name, {})
        elif words[0] in ("Kd", "Ks", "Ke"):
            current[words[0]] = numbers_of(words[1:4], f"{path}: line {number}")
        elif words[0] == "Ns":
            current["Ns"] = numbers_of(words[1:2], f"{path}: line {number}", 1)
        elif words[0].lower() == "map_kd" and len(words) > 1:
            maps[name], unread = _diffuse_map(words[1:], path, f"{path}: line {number}")
            options |= unread
        elif words[0].lower().startswith("map_") or words[0].lower() in TEXTURES:
            textures.append(tuple(words))
    _warn_of_textures(textures, path)
    if options:
        text = f"{path}: options {', '.join(sorted(options))} of map_Kd passed over"
        warnings.warn(RefgiWarning(text), stacklevel=5)
    for name in maps.keys() & values.keys():
        values[name].setdefault("Kd", (1.0, 1.0, 1.0))
    too_bright = sum(_is_lobed(found) and reflects_too_much(*_reflectances(found)) for found in values.values())
    if too_bright:
        warnings.warn(RefgiWarning(f"{path}: {too_bright:,} of {len(values):,} materials with diffuse + specular "
                                   f"(Kd + Ks) over 1 in a channel: specular left out"), stacklevel=5)
    return {name: _material(name, found, path) for name, found in values.items()}, maps


def _diffuse_map(words: list[str], path: Path, where: str) -> tuple[DiffuseMap, set[str]]:
    """Return what the arguments of map_Kd say, and the options among them that are not read."""
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
    return DiffuseMap(path.parent / name, (scale[0], scale[1]), (offset[0], offset[1]), clamp, where), unread


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
    found = {words: any(is_there(path.parent / " ".join(words[k:])) for k in range(1, min(len(words), 20)))
             for words in set(textures)}
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
        return Material(name, diffuse, specular, exponent, emission=_rgb(found.get("Ke", (0.0, 0.0, 0.0))))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def lines_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line that says something, continued lines joined."""
    text = read_bytes(path).decode("utf-8", "replace").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def numbers_of(words: list[str], where: str, count: int = 3) -> tuple[float, ...]:
    """Return so many numbers of a line; raises `InputError` if there are others."""
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    expect(len(values) == count, where, f"{count} number(s)", " ".join(words))
    return values


def _rgb(values: tuple[float, ...]) -> Rgb:
    return values[0], values[1], values[2]
