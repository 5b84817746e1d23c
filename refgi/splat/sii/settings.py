"""What `sii` can be set to: which pixel lights, and how far each reaches."""

import dataclasses
from typing import ClassVar, Literal

from refgi.errors import expect
from refgi.lights.settings import LightSettings, expect_footprints
from refgi.pairs.settings import LAST_SEED, PairSettings
from refgi.scene.values import LARGEST
from refgi.settings import Settings, setting

Bound = Literal["full", "quad", "ellipsoid", "tangent", "mesh"]


@dataclasses.dataclass(frozen=True)
class SplatSettings(Settings):
    """How far a pixel light reaches (SII Sec. 3.4 and appendix), besides how it lights a receiver.

    A pair counts where B = I_0 cos^n / r^2 is at least I_low, one irradiance for all lights: `i_low` (0: no cut; the
    paper's is 0.05) of the largest peak intensity I_0 over the square of `reference_length` (m; none: under which 0.05
    leave as large a share of the pairs as in the paper, see `with_reference_length`), or `irradiance_low` (W/m^2) where
    that is given. `bound` says which geometry finds the pixels that come into question; it changes no
    bit of the picture but for a "mesh" of `mesh_faces` faces that is not made to enclose its ellipsoid (`inflate`).
    `stochastic_range` cuts at a random share of I_low instead, drawn by `seed`, and weighs what is left: no bias.
    """

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"per_light_ilow"})

    pairs: PairSettings = setting(PairSettings(), "how one light lights one receiver")
    i_low: float = setting(0.0, "share of the brightest light's intensity", least=0.0, most=LARGEST)
    reference_length: float | None = setting(None, "length of the share", least=1 / LARGEST, most=LARGEST, unit="m")
    irradiance_low: float | None = setting(None, "irradiance under which pairs are cut", least=0.0, unit="W/m^2")
    bound: Bound = setting("tangent", "geometry that finds the pixels of a light")
    mesh_faces: Literal[8, 20, 80, 320, 1280] = setting(80, "faces of a mesh")
    inflate: bool = setting(True, "meshes enclose their ellipsoid")
    stochastic_range: bool = setting(False, "cut at a random share of I_low")
    seed: int = setting(0, "of the random shares", least=0, most=LAST_SEED)
    as_published: frozenset[str] = setting(frozenset(), "forms of the cut to use as printed", study=True)

    @property
    def cuts(self) -> bool:
        """Whether any pair may be left out."""
        return self.i_low > 0 if self.irradiance_low is None else self.irradiance_low > 0


@dataclasses.dataclass(frozen=True)
class SiiSettings(SplatSettings):
    """What `sii` can be set to; the defaults are the paper's (768 lights, no importance) but for its cut.

    Nothing is cut: the sum of all lights takes at most 1.7 times as long as the paper's cut of 5 % (`i_low=0.05`, Fig.
    12), which takes up to a third of the light.
    """

    lights: LightSettings = setting(LightSettings(), "pixel lights")
    half_resolution: bool = setting(False, "every second pixel is lit, the others are interpolated (Table 3)")

    def check(self) -> None:
        """Check what fields ask of each other."""
        expect_footprints(self.lights, self.pairs)
        expect(not self.half_resolution or self.bound not in ("quad", "mesh"), "bound",
               "one in space, not on the screen, at half resolution", self.bound)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return self.lights.traces_rays
