"""Materials of a glTF document: diffuse part, Phong lobe or glass, emission, cut-outs; what they leave out is counted.

The model of metal and roughness has no counterpart here: its base colour is taken as diffuse. Specular and glossiness
are a diffuse part and a Phong lobe as wide as the microfacets: alpha = (1 - glossiness)^2, P = 2 / alpha^2 - 2.
"""

from collections.abc import Callable
from typing import Any

from refgi.errors import InputError, expect
from refgi.scene.gltf.container import Document
from refgi.scene.model import BLACK, Material, Rgb

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
