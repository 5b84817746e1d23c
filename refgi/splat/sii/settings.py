"""What `sii` can be set to: which pixel lights, and how far each reaches."""

import dataclasses
import math
from typing import ClassVar, Literal, get_args

from refgi.errors import expect
from refgi.lights.settings import LightSettings
from refgi.pairs.settings import LAST_SEED, PairSettings
from refgi.scene.values import LARGEST, is_count

Bound = Literal["full", "quad", "ellipsoid", "tangent", "mesh"]

MESHES = (8, 20, 80, 320, 1280)  # faces of an octahedron and of icosahedra, subdivided


@dataclasses.dataclass(frozen=True)
class SplatSettings(PairSettings):
    """How far a pixel light reaches (SII Sec. 3.4 and appendix), besides how it lights a receiver.

    A pair counts where B = I_0 cos^n / r^2 is at least I_low, one irradiance for all lights: `i_low` (0: no cut; the
    paper's is 0.05) of the largest peak intensity I_0 over the square of `reference_length` (m; none: under which 0.05
    leave as large a share of the pairs as in the paper, see `with_reference_length`), or `irradiance_low` (W/m^2) where
    that is given. `bound` says which geometry finds the pixels that come into question; it changes no
    bit of the picture but for a "mesh" of `mesh_faces` faces that is not made to enclose its ellipsoid (`inflate`).
    `stochastic_range` cuts at a random share of I_low instead, drawn by `seed`, and weighs what is left: no bias.
    """

    i_low: float = 0.0
    reference_length: float | None = None
    irradiance_low: float | None = None
    bound: Bound = "tangent"
    mesh_faces: int = 80
    inflate: bool = True
    stochastic_range: bool = False
    seed: int = 0

    SWITCHES: ClassVar[frozenset[str]] = PairSettings.SWITCHES | {"per_light_ilow"}

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(0 <= self.i_low <= LARGEST, "i_low", f"a share of the brightest light's intensity, 0 to {LARGEST:g}",
               self.i_low)
        expect(self.reference_length is None or 1 / LARGEST <= self.reference_length <= LARGEST, "reference_length",
               f"none or {1 / LARGEST:g} to {LARGEST:g} m", self.reference_length)
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


@dataclasses.dataclass(frozen=True)
class SiiSettings(LightSettings, SplatSettings):
    """What `sii` can be set to; the defaults are the paper's (768 lights, no importance) but for its cut.

    Nothing is cut: the sum of all lights takes at most 1.7 times as long as the paper's cut of 5 % (`i_low=0.05`, Fig.
    12), which takes up to a third of the light.

    Beside which lights and how far each reaches, `half_resolution` lights every second pixel and interpolates
    (Table 3).
    """

    half_resolution: bool = False

    SWITCHES: ClassVar[frozenset[str]] = LightSettings.SWITCHES | SplatSettings.SWITCHES

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(not self.half_resolution or self.bound not in ("quad", "mesh"), "bound",
               "one in space, not on the screen, at half resolution", self.bound)
