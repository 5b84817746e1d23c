"""Materials of a glTF document and their textures; what they leave out is counted.

The model of metal and roughness has no counterpart here: its base colour is taken as diffuse. Specular and glossiness
are a diffuse part and a Phong lobe as wide as the microfacets: alpha = (1 - glossiness)^2, P = 2 / alpha^2 - 2.

A texture is image, sampler, set of texture coordinates and KHR_texture_transform.
"""

import contextlib
import itertools
import math
import weakref
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import InputError, expect, shortened
from refgi.scene.gltf.container import IMAGES, Document, packed
from refgi.scene.model import BLACK, Material, Rgb
from refgi.scene.texture.image import Image, decoded, expect_all_fit
from refgi.scene.texture.table import Filter, Texture, Wrap
from refgi.types import Array

CUTOFF = 0.5  # glTF's default of alphaCutoff
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
TRANSMISSION, VOLUME, UNLIT = "KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_unlit"
STRENGTH, IOR = "KHR_materials_emissive_strength", "KHR_materials_ior"
READ = ("baseColorTexture", "emissiveTexture")
SHARPEST = 1e4  # exponent of a lobe of full glossiness, which would be a mirror
HALF = 0.5  # of the light: what transmits less is opaque
WHITE = (1.0, 1.0, 1.0)
UNPAINTED = Material(diffuse=WHITE, one_sided=True)  # of a primitive without material

Say = Callable[[str], None]  # counts a line of what is not as the file says


def read_material(document: Document, index: int, say: Say) -> Material:
    """Return a material without its textures; `say` is told of each thing that is not as the file has it."""
    entry, where = document.items("materials")[index], f"materials[{index}]"
    extensions = document.member(entry, "extensions", where)
    surface = document.member(entry, "pbrMetallicRoughness", where)
    for key in (*entry, *(() if GLOSSY in extensions else surface)):
        if key == "normalTexture":
            say("material(s)' normal maps (shading normals stay the mesh's) passed over")
        elif key.endswith("Texture") and key not in READ:
            say(f"material(s)' {key} passed over")
    ior = _glass(document, extensions, surface, where, say)
    specular, exponent = BLACK, 0.0
    if GLOSSY in extensions:
        base, specular, exponent = _glossy(document, extensions, where, say)
    else:
        base = document.numbers(surface, "baseColorFactor", f"{where}.pbrMetallicRoughness", (1.0,) * 4)
        if UNLIT in extensions:
            say(f"material(s) of {UNLIT} lit as others: diffuse in their base colour")
        elif not ior:
            _say_of_metal(document, surface, where, say)
    if ior:
        base, specular = (0.0, 0.0, 0.0, 1.0), BLACK
    cutoff = None if ior else _cutoff(document, entry, where, say)
    try:
        return Material(document.name(entry, where), (base[0], base[1], base[2]), specular, exponent, ior,
                        emission=_emission(document, entry, extensions, where),
                        alpha=1.0 if cutoff is None else base[3], cutoff=cutoff,
                        one_sided=not ior and entry.get("doubleSided") is not True)
    except InputError as error:
        raise InputError(f"{document.path}: {where}: {error}") from error


def _say_of_metal(document: Document, surface: dict[str, Any], where: str, say: Say) -> None:
    where = f"{where}.pbrMetallicRoughness"
    if document.number(surface, "metallicFactor", where, 1.0) > 0:
        say("material(s) of metal (metallicFactor, 1 where absent) taken as diffuse in their base colour")
    if document.number(surface, "roughnessFactor", where, 1.0) < 1:
        say("material(s) with roughnessFactor below 1 taken as diffuse: no gloss")


def _glossy(
    document: Document, extensions: dict[str, Any], where: str, say: Say
) -> tuple[tuple[float, ...], Rgb, float]:
    """Return diffuse reflectance and alpha, specular reflectance and exponent: c_diff = diffuse (1 - max(specular))."""
    entry, where = document.member(extensions, GLOSSY, where), f"{where}.extensions.{GLOSSY}"
    base = document.numbers(entry, "diffuseFactor", where, (1.0,) * 4)
    if "specularGlossinessTexture" in entry or "specularFactor" not in entry:
        said = ("' specularGlossinessTexture passed over" if "specularGlossinessTexture" in entry else
                " without specularFactor (a mirror by the extension) taken as diffuse")
        say(f"material(s){said}")
        return base, BLACK, 0.0
    red, green, blue = document.numbers(entry, "specularFactor", where, WHITE)
    kept = 1.0 - max(red, green, blue)
    width = (1.0 - document.number(entry, "glossinessFactor", where, 1.0)) ** 2
    exponent = min(2.0 / max(width, 1e-9) ** 2 - 2.0, SHARPEST)
    return (base[0] * kept, base[1] * kept, base[2] * kept, base[3]), (red, green, blue), exponent


def _glass(
    document: Document, extensions: dict[str, Any], surface: dict[str, Any], where: str, say: Say
) -> float:
    """Return the index of refraction of a solid that light goes through, 0 where none does."""
    entry = document.member(extensions, TRANSMISSION, where)
    share = document.number(entry, "transmissionFactor", f"{where}.extensions.{TRANSMISSION}", 0.0)
    volume, place = document.member(extensions, VOLUME, where), f"{where}.extensions.{VOLUME}"
    thick = document.number(volume, "thicknessFactor", place, 0.0) > 0
    if share <= 0 or not thick or share < HALF or document.number(surface, "metallicFactor", where, 1.0) >= 1:
        if share > 0:
            say(f"material(s) of {TRANSMISSION} opaque: metal, without a volume, or less than half transparent")
        return 0.0
    tints = (*document.numbers(surface, "baseColorFactor", where, (1.0,) * 4)[:3],
             *(document.numbers(volume, "attenuationColor", place, WHITE) if "attenuationDistance" in volume else ()))
    textures = any(key.endswith("Texture") for key in (*entry, *volume, *surface))
    rough = document.number(surface, "roughnessFactor", where, 1.0) > 0
    if share < 1 or min(tints) < 1 or rough or textures:
        say(f"material(s) of {TRANSMISSION} taken as clear, smooth glass")
    index = document.number(document.member(extensions, IOR, where), "ior", f"{where}.extensions.{IOR}", 1.5)
    return max(index, 1.0)


def _emission(document: Document, entry: dict[str, Any], extensions: dict[str, Any], where: str) -> Rgb:
    factor = document.numbers(entry, "emissiveFactor", where, BLACK)
    found = document.member(extensions, STRENGTH, where)
    strength = document.number(found, "emissiveStrength", f"{where}.extensions.{STRENGTH}", 1.0)
    return factor[0] * strength, factor[1] * strength, factor[2] * strength


def _cutoff(document: Document, entry: dict[str, Any], where: str, say: Say) -> float | None:
    """Return from which alpha on a material is there, None where it is there everywhere."""
    mode = entry.get("alphaMode", "OPAQUE")
    expect(mode in ("OPAQUE", "MASK", "BLEND"), f"{document.path}: {where}.alphaMode", "OPAQUE, MASK or BLEND", mode)
    if mode == "OPAQUE":
        return None
    if mode == "BLEND":
        say(f"material(s) of alphaMode BLEND taken as MASK with a cutoff of {CUTOFF}: no partial transparency")
        return CUTOFF
    return document.number(entry, "alphaCutoff", where, CUTOFF)


EXTENSION = "KHR_texture_transform"
WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
NEAREST, LINEAR, TRILINEAR = 9728, 9729, 9987
FILTERS: dict[int, Filter] = {NEAREST: "nearest", LINEAR: "bilinear", 9984: "trilinear", 9985: "trilinear",
                              9986: "trilinear", TRILINEAR: "trilinear"}
NAMES = {NEAREST: "NEAREST", LINEAR: "LINEAR", 9984: "NEAREST_MIPMAP_NEAREST", 9985: "LINEAR_MIPMAP_NEAREST",
         9986: "NEAREST_MIPMAP_LINEAR", TRILINEAR: "LINEAR_MIPMAP_LINEAR"}
# of magFilter and minFilter, what one filter here is; None: the file leaves it open. Mip levels are blended in any case
ALIKE = {(NEAREST, NEAREST), (NEAREST, None), (None, NEAREST),
         *itertools.product((LINEAR, None), (LINEAR, 9985, TRILINEAR, None))}
LARGEST_SET = 15  # of texture coordinates

_judged: "weakref.WeakSet[Document]" = weakref.WeakSet()  # documents whose images fit in memory


class Look(NamedTuple):
    """A texture as a material names it."""

    texture: Texture
    coordinates: int  # n of TEXCOORD_n
    transform: Array  # (2, 3): u' and v' from u, v, 1

    def lies_as(self, other: "Look") -> bool:
        """Return whether both lie on a surface alike."""
        return self.coordinates == other.coordinates and np.array_equal(self.transform, other.transform)


def base_colour(document: Document, material: dict[str, Any], where: str, say: Say) -> Look | None:
    """Return the texture of a material's base colour, None where it has none.

    `say` is told of a filter that is not as the file has it. Raises `InputError` that names file and image if it cannot
    be read.
    """
    extensions = document.member(material, "extensions", where)
    if GLOSSY in extensions:
        glossy = document.member(extensions, GLOSSY, where)
        return _look(document, glossy, "diffuseTexture", f"{where}.extensions.{GLOSSY}", say)
    surface = document.member(material, "pbrMetallicRoughness", where)
    return _look(document, surface, "baseColorTexture", f"{where}.pbrMetallicRoughness", say)


def emissive(document: Document, material: dict[str, Any], where: str, say: Say) -> Look | None:
    """Return the texture of a material's emission, as `base_colour` does."""
    return _look(document, material, "emissiveTexture", where, say)


def _look(document: Document, owner: dict[str, Any], key: str, where: str, say: Say) -> Look | None:
    if key not in owner:
        return None
    where = f"{where}.{key}"
    info = document.member(owner, key, where)
    change = document.member(document.member(info, "extensions", where), EXTENSION, f"{where}.extensions")
    number = document.integer(change, "texCoord", where, document.integer(info, "texCoord", where, 0))
    expect(number <= LARGEST_SET, f"{document.path}: {where}.texCoord", f"0 to {LARGEST_SET}", number)
    transform = _transform(document, change, f"{where}.extensions.{EXTENSION}")
    return Look(_texture(document, info, where, say), number, transform)


def transformed(uv: Array, transform: Array) -> Array:
    """Return texture coordinates (n, 2) after an affine map (2, 3)."""
    return np.asarray(uv @ transform[:, :2].T + transform[:, 2])


def _transform(document: Document, change: dict[str, Any], where: str) -> Array:
    sx, sy = document.numbers(change, "scale", where, (1.0, 1.0))
    ox, oy = document.numbers(change, "offset", where, (0.0, 0.0))
    angle = document.number(change, "rotation", where, 0.0)
    c, s = math.cos(angle), math.sin(angle)
    # u' = c sx u + s sy v + ox, v' = -s sx u + c sy v + oy
    return np.array([[c * sx, s * sy, ox], [-s * sx, c * sy, oy]])


def _texture(document: Document, info: dict[str, Any], where: str, say: Say) -> Texture:
    index = info.get("index")
    entry, where = document.item("textures", index, f"{where}.index"), f"textures[{index}]"
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    chosen: Filter = "trilinear"
    if "sampler" in entry:
        sampler = document.item("samplers", entry["sampler"], f"{where}.sampler")
        key = f"samplers[{entry['sampler']}]"
        across, down = (_code(document, sampler, name, key, WRAPS, 10497) for name in ("wrapS", "wrapT"))
        wrap = WRAPS[across], WRAPS[down]
        chosen = _filter(document, sampler, key, say)
    if "source" not in entry:
        found = document.member(entry, "extensions", where)
        for name, form in IMAGES.items():
            if name in found:
                raise packed(f"{document.path}: {where}.source", f"{form} images", name)
        extensions = ", ".join(found) or "none"
        raise InputError(f"{document.path}: {where}.source: expected a PNG or JPEG image, got none "
                         f"(extensions: {shortened(extensions, 80)})")
    return Texture(_image(document, entry["source"], f"{where}.source"), wrap, chosen)


def _filter(document: Document, sampler: dict[str, Any], where: str, say: Say) -> Filter:
    """Return the one filter that stands for a sampler's two; `say` is told where it is not as both."""
    larger, smaller = sampler.get("magFilter"), sampler.get("minFilter")
    larger = larger if larger in (NEAREST, LINEAR) else None  # any other is not of the format
    default = NEAREST if larger == NEAREST else TRILINEAR
    chosen = FILTERS[_code(document, sampler, "minFilter", where, FILTERS, default)]
    if (larger, smaller) not in ALIKE:
        both = (("magFilter", larger), ("minFilter", smaller))
        told = ", ".join(f"{key} {NAMES[code]}" for key, code in both if code)
        say(f"material texture(s) of {told} filtered {chosen}")
    return chosen


def _code(document: Document, owner: dict[str, Any], key: str, where: str, known: dict[int, Any], default: int) -> int:
    code = owner.get(key, default)
    expect(type(code) is int and code in known, f"{document.path}: {where}.{key}", f"one of {sorted(known)}", code)
    return code  # type: ignore[no-any-return]


def _image(document: Document, index: Any, referrer: str) -> Image:
    if document not in _judged:
        expect_all_fit(_used_images(document), f"{document.path}: images")
        _judged.add(document)
    return decoded(*_content(document, index, referrer))


def _content(document: Document, index: Any, referrer: str) -> tuple[bytes, str]:
    """Return the bytes of an image's file, and how messages name it."""
    entry, where = document.item("images", index, referrer), f"images[{index}]"
    uri = entry.get("uri")
    name = f"{document.path}: {where}"
    if uri is None:
        expect("bufferView" in entry, f"{name}", "a uri or a bufferView", sorted(entry))
        return document.view(entry["bufferView"], f"{where}.bufferView"), name
    expect(isinstance(uri, str), f"{name}.uri", "a string", uri)
    content = document.from_uri(uri, where)
    return content, name if uri.startswith("data:") else f"{name}: {shortened(uri, 200)}"


def _used_images(document: Document) -> Iterator[bytes]:
    """Yield the images that materials may show, as far as they are there; what is wrong is told when one is shown."""
    for material in document.items("materials"):
        glossy = material.get("extensions", {}).get(GLOSSY) if isinstance(material.get("extensions"), dict) else None
        owners: Any = ((glossy, "diffuseTexture"), (material.get("pbrMetallicRoughness"), "baseColorTexture"),
                       (material, "emissiveTexture"))
        for owner, key in owners:
            with contextlib.suppress(InputError, KeyError, TypeError, AttributeError):
                texture = document.item("textures", owner[key]["index"], "texture")
                yield _content(document, texture["source"], "image")[0]
