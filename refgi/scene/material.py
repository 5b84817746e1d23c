"""Materials, the table of them that kernels read, and vertex colours as factors of their reflectance.

Files that name no material say with their colours what a surface reflects: its material is then white.
"""

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import RefgiWarning, expect
from refgi.scene.texture.image import srgb_table
from refgi.scene.texture.table import Texture, Textures, textures_of
from refgi.scene.values import BLACK, BRIGHTEST, Rgb, as_float_tuples, is_number, is_vector
from refgi.types import Array

SHARPEST = 1e20  # Phong exponent; far within float32
DENSEST = 1e3  # index of refraction
ROUNDING = 1e-6  # of a sum of two reflectances that are float32 numbers
TEXTURES = ("texture", "emission_texture", "alpha_texture")  # fields of a material


@dataclasses.dataclass(frozen=True)
class Material:
    """How a surface reflects: a diffuse part, a Phong lobe, or clear glass.

    `diffuse` and `specular` are reflectances (1), `exponent` is the Phong exponent of the lobe around the mirror
    direction (normalised so that `specular` is its reflectance), `ior` the index of refraction of a dielectric (0:
    opaque), `emission` the radiance the surface emits by itself (W/m^2/sr; seen by the camera, not a light source).
    `texture` multiplies `diffuse`, `emission_texture` the emission, where a surface has texture coordinates. With a
    `cutoff` the surface has holes: it is there only where `alpha` times the texture's alpha is at least the cutoff
    (None: it is there everywhere); `alpha_texture` is one whose alpha counts in place of the texture's. `one_sided`:
    the file leaves out its back, which is there as the front is; of no meaning but for a warning. Of an object that
    `sends` nothing the reflectance counts as 0 wherever it would light others; it is seen and lit as any other. Objects
    of one `solid` number (0: none) count as one rigid body where points are followed back to the frame before.
    """

    name: str = "default"
    diffuse: Rgb = (0.5, 0.5, 0.5)
    specular: Rgb = BLACK
    exponent: float = 0.0
    ior: float = 0.0
    emission: Rgb = BLACK
    texture: Texture | None = None
    alpha: float = 1.0
    cutoff: float | None = None
    emission_texture: Texture | None = None
    alpha_texture: Texture | None = None
    one_sided: bool = dataclasses.field(default=False, compare=False)
    sends: bool = True
    solid: int = 0

    def __post_init__(self) -> None:
        for key in ("diffuse", "specular"):
            value = getattr(self, key)
            expect(is_vector(value) and all(0 <= c <= 1 for c in value), f"material {self.name!r}: {key}",
                   "three numbers from 0 to 1", value)
        expect(is_vector(self.emission) and min(self.emission) >= 0 and max(self.emission) <= BRIGHTEST,
               f"material {self.name!r}: emission", f"three numbers from 0 to {BRIGHTEST:g}", self.emission)
        expect(is_number(self.exponent) and 0 <= self.exponent <= SHARPEST, f"material {self.name!r}: exponent",
               f"a number from 0 to {SHARPEST:g}", self.exponent)
        expect(is_number(self.ior) and (self.ior == 0 or 1 <= self.ior <= DENSEST), f"material {self.name!r}: ior",
               f"0 (opaque) or a number from 1 to {DENSEST:g}", self.ior)
        possible = self.is_dielectric or not reflects_too_much(self.diffuse, self.specular)
        expect(possible, f"material {self.name!r}: diffuse + specular", "at most 1 in each channel",
               [round(d + s, 6) for d, s in zip(self.diffuse, self.specular, strict=True)])
        for key in TEXTURES:
            value = getattr(self, key)
            expect(value is None or isinstance(value, Texture), f"material {self.name!r}: {key}", "a Texture or None",
                   type(value).__name__)
        expect(is_number(self.alpha) and 0 <= self.alpha <= 1, f"material {self.name!r}: alpha", "a number from 0 to 1",
               self.alpha)
        expect(self.cutoff is None or (is_number(self.cutoff) and self.cutoff >= 0), f"material {self.name!r}: cutoff",
               "a number >= 0, or None", self.cutoff)
        as_float_tuples(self, "diffuse", "specular", "emission")

    @property
    def textures(self) -> tuple[Texture, ...]:
        """All that need texture coordinates."""
        found = (getattr(self, key) for key in TEXTURES)
        return tuple(one for one in found if one is not None)

    @property
    def is_glossy(self) -> bool:
        """Whether the material has a Phong lobe."""
        return any(self.specular)

    @property
    def is_dielectric(self) -> bool:
        """Whether the material is clear glass."""
        return self.ior > 0


def reflects_too_much(diffuse: Rgb, specular: Rgb) -> bool:
    """Return whether a surface reflects more than arrives in any channel, by more than rounding."""
    return any(d + s > 1 + ROUNDING for d, s in zip(diffuse, specular, strict=True))


UNPAINTED = Material()  # of a mesh that names none


def as_senders(materials: Sequence[Material]) -> tuple[Material, ...]:
    """Return materials as they light others: those that send nothing are black (HSS Sec. 4)."""
    return tuple(one if one.sends else dataclasses.replace(one, diffuse=BLACK, specular=BLACK) for one in materials)


class MaterialTable(NamedTuple):
    """The materials as arrays for kernels: one row a material."""

    diffuse: Array  # (m, 3) reflectance of the diffuse part
    specular: Array  # (m, 3) reflectance of the Phong lobe
    exponent: Array  # (m,) Phong exponent
    ior: Array  # (m,) index of refraction, 0 where opaque
    emission: Array  # (m, 3) radiance, W/m^2/sr
    textures: Textures | None = None  # that multiply `diffuse`; None where no material has one
    emissive: Textures | None = None  # that multiply `emission`; None where no material has one


def material_table(materials: Sequence[Material], dtype: npt.DTypeLike = np.float64) -> MaterialTable:
    """Gather materials into arrays for kernels.

    Parameters
    ----------
    materials : sequence of Material
        The scene's materials.
    dtype : dtype
        Element type of the arrays.

    Returns
    -------
    MaterialTable
        One row a material.
    """
    def column(key: str, width: int) -> Array:
        values = np.array([getattr(m, key) for m in materials], dtype)
        return values.reshape((-1, width) if width > 1 else -1)

    return MaterialTable(column("diffuse", 3), column("specular", 3), column("exponent", 1), column("ior", 1),
                         column("emission", 3), textures_of([material.texture for material in materials]),
                         textures_of([material.emission_texture for material in materials]))


WHITE = Material(diffuse=(1.0, 1.0, 1.0))  # of a mesh that names no material and has colours
CODES = 256


def factors(colours: Array, where: str) -> Array | None:
    """Return linear colours (n, 3) as factors from 0 to 1, float64; None where all are white: they change nothing.

    `where`: the file, for the warning that says how many lie beyond and are cut.
    """
    values = np.asarray(colours, np.float64)
    found = np.nan_to_num(np.clip(values, 0.0, 1.0))
    if cut := int(np.count_nonzero((found != values).any(axis=-1))):
        text = f"{where}: {cut:,} vertex colour(s) beyond 0 to 1 cut: a surface reflects what arrives at most"
        warnings.warn(RefgiWarning(text), stacklevel=6)
    return None if (found == 1).all() else found


def from_codes(values: Array) -> Array:
    """Return linear colours of sRGB codes of 8 or 16 bits, or of numbers that are linear already."""
    kind: np.dtype[Any] = values.dtype
    if kind.kind == "f":
        return values
    count = np.iinfo(kind).max + 1 if kind in (np.uint8, np.uint16) else CODES
    return np.asarray(srgb_table(count)[np.clip(values, 0, count - 1)])
