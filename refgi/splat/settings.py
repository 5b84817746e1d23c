"""How one pixel light lights one receiver, and how far it reaches: what splatting methods can be set to."""

import dataclasses
import math
from typing import ClassVar, Literal, get_args

from refgi.errors import expect
from refgi.scene.values import LARGEST, is_count

ClampMode = Literal["none", "distance", "geometry", "disc", "sphere"]
LobeNorm = Literal["none", "full_lobe", "clamped"]
Bound = Literal["full", "quad", "ellipsoid", "tangent", "mesh"]

MESHES = (8, 20, 80, 320, 1280)  # faces of an octahedron and of icosahedra, subdivided
FOOTPRINT_CLAMPS = ("disc", "sphere")  # need the surface area that each light stands for
STRONGEST_CLAMP = 1e18  # m, 1/m^2 or 1: its square stays within float32
LAST_SEED = 2**32 - 1


@dataclasses.dataclass(frozen=True)
class PairSettings:
    """How one pixel light lights one receiver.

    `clamp` keeps near pairs finite: not at all, by a minimum `distance` of `clamp_value` m, by a `geometry` term of
    at most `clamp_value` 1/m^2, by the form factor of a `disc` of the light's footprint A, or by a virtual `sphere`
    light of radius r, pi r^2 = `clamp_value` A (0: 1 A), for diffuse lights alone. `offset` moves lights back along
    their normals (m). `lobe_norm` is the norm of Phong lobes and `widening` the distance a (m) within
    which their exponents fall (0: nowhere). `as_published` names forms to use as printed; see docs/methods/sii.
    """

    clamp: ClampMode = "none"
    clamp_value: float = 0.0
    offset: float = 0.0
    lobe_norm: LobeNorm = "clamped"
    widening: float = 0.0
    as_published: frozenset[str] = frozenset()

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"sii_no_pi", "sii_widening", "sii_widening_unnorm"})

    def __post_init__(self) -> None:
        expect(self.clamp in ("none", "distance", "geometry", "disc", "sphere"), "clamp",
               "'none', 'distance', 'geometry', 'disc' or 'sphere'", self.clamp)
        needed = self.clamp in ("distance", "geometry")
        expect(0 <= self.clamp_value <= STRONGEST_CLAMP and (self.clamp_value > 0 or not needed), "clamp_value",
               f"{f'a number > 0 for the clamp {self.clamp!r},' if needed else '0'} up to {STRONGEST_CLAMP:g}",
               self.clamp_value)
        expect(abs(self.offset) <= LARGEST, "offset", f"a length up to {LARGEST:g} m", self.offset)
        expect(self.lobe_norm in ("none", "full_lobe", "clamped"), "lobe_norm",
               "'none', 'full_lobe' or 'clamped'", self.lobe_norm)
        expect(0 <= self.widening <= LARGEST, "widening", f"0 to {LARGEST:g} m", self.widening)
        object.__setattr__(self, "as_published", frozenset(self.as_published))
        expect(self.as_published <= self.SWITCHES, "as_published", f"names out of {sorted(self.SWITCHES)}",
               sorted(self.as_published))


@dataclasses.dataclass(frozen=True)
class SplatSettings(PairSettings):
    """How far a pixel light reaches (SII Sec. 3.4 and appendix), besides how it lights a receiver.

    A pair counts where B = I_0 cos^n / r^2 is at least I_low, one irradiance for all lights: `i_low` (the paper's
    x %; 0: no cut) of the largest peak intensity I_0 over the square of `reference_length` (m), or `irradiance_low`
    (W/m^2) where that is given. `bound` says which geometry finds the pixels that come into question; it changes no
    bit of the picture but for a "mesh" of `mesh_faces` faces that is not made to enclose its ellipsoid (`inflate`).
    `stochastic_range` cuts at a random share of I_low instead, drawn by `seed`, and weighs what is left: no bias.
    """

    i_low: float = 0.05
    reference_length: float = 1.0
    irradiance_low: float | None = None
    bound: Bound = "tangent"
    mesh_faces: int = 80
    inflate: bool = True
    stochastic_range: bool = False
    seed: int = 0

    SWITCHES: ClassVar[frozenset[str]] = PairSettings.SWITCHES | {"per_light_ilow"}

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(0 <= self.i_low <= LARGEST, "i_low", "a share of the brightest light's intensity, 0 or more", self.i_low)
        expect(1 / LARGEST <= self.reference_length <= LARGEST, "reference_length",
               f"{1 / LARGEST:g} to {LARGEST:g} m", self.reference_length)
        expect(self.irradiance_low is None or (math.isfinite(self.irradiance_low) and self.irradiance_low >= 0),
               "irradiance_low", "none or an irradiance of 0 or more, W/m^2", self.irradiance_low)
        expect(self.bound in get_args(Bound), "bound", " or ".join(map(repr, get_args(Bound))), self.bound)
        expect(self.mesh_faces in MESHES, "mesh_faces", f"one of {MESHES}", self.mesh_faces)
        expect(is_count(self.seed) and 0 <= self.seed <= LAST_SEED, "seed", f"a whole number, 0 to {LAST_SEED}",
               self.seed)

    @property
    def cuts(self) -> bool:
        """Whether any pair may be left out."""
        return self.i_low > 0 if self.irradiance_low is None else self.irradiance_low > 0
