"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): settings and method."""

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy.typing as npt

from refgi.errors import expect
from refgi.scene.material import SHARPEST
from refgi.scene.values import LARGEST, is_count
from refgi.splat.half_resolution import half_resolution
from refgi.splat.irradiance import Receivers
from refgi.splat.lights.selection import choose_lights, footprints
from refgi.splat.lights.walk import MOST_BOUNCES
from refgi.splat.settings import FOOTPRINT_CLAMPS, SplatSettings
from refgi.splat.splat import splat

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]
Pattern = Literal["grid", "halton", "all", "random"]
Source = Literal["rsm", "walk"]
WarpMethod = Literal["none", "A", "B"]
Importance = Literal["flux", "peak", "openness"]
OpennessFlux = Literal["none", "scale", "roulette"]
Refraction = Literal["none", "back_face", "two_interface"]

FOR_MAPS = {"pattern": "halton", "filtered": False, "warp": "none", "renormalise_weights": False}  # else no effect
CHOICES: dict[str, Any] = {"pattern": Pattern, "source": Source, "warp": WarpMethod, "importance": Importance,
                           "openness_flux": OpennessFlux, "refraction": Refraction}
# least and most; lights: every texel of a map of 4096 x 4096
COUNTS = (("lights", 1, 1 << 24), ("bounces", 1, MOST_BOUNCES), ("warp_levels", 0, 32), ("openness_rays", 1, 1 << 16))


@dataclasses.dataclass(frozen=True)
class SiiSettings(SplatSettings):
    """What `sii` can be set to; the defaults are the paper's (768 lights and 5 % as in Fig. 12, no importance).

    Lights: `lights` of a shadow map (`source` "rsm"), or as many paths of `bounces` bounces from each light ("walk",
    Sec. 3.7), taken by a `pattern` ("all": every texel, `lights` is not used) with `seed`; `filtered` averages the
    flux over each light's cell (Sec. 4). `refraction` at glass is that of its back faces alone, as published, of both
    interfaces, or none; its lobes have `refraction_exponent`.

    Importance (Sec. 3.5): `warp` by method "A" or "B" over `warp_levels` levels, towards flux, flux times the lobe's
    `peak`, or that times 1 - `openness` (at least `openness_floor`), of which a share `defensive` is spread evenly;
    `renormalise_weights` makes their sum that of unwarped lights, at the cost of bias. `openness_flux` (Sec. 3.6)
    scales fluxes by 1 - openness, or plays roulette with them, which costs no energy in the mean. Openness is that of
    `openness_rays` rays of length `openness_radius` (m; 0: a tenth of the scene's diagonal).

    `half_resolution` lights every second pixel and interpolates (Table 3).
    """

    lights: int = 768
    pattern: Pattern = "halton"
    filtered: bool = False
    source: Source = "rsm"
    bounces: int = 1
    warp: WarpMethod = "none"
    warp_levels: int = 3
    importance: Importance = "flux"
    defensive: float = 0.0
    renormalise_weights: bool = False
    openness_radius: float = 0.0
    openness_rays: int = 16
    openness_floor: float = 0.05
    openness_flux: OpennessFlux = "none"
    refraction: Refraction = "back_face"
    refraction_exponent: float = 3000.0
    half_resolution: bool = False

    SWITCHES: ClassVar[frozenset[str]] = SplatSettings.SWITCHES | {"sii_no_tn"}

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, least, most in COUNTS:
            count = getattr(self, key)
            expect(is_count(count) and least <= count <= most, key, f"a whole number, {least} to {most:,}", count)
        for key, names in CHOICES.items():
            expect(getattr(self, key) in get_args(names), key, " or ".join(map(repr, get_args(names))),
                   getattr(self, key))
        expect(self.clamp not in FOOTPRINT_CLAMPS or self.source == "rsm", "clamp",
               "one without footprints with the source 'walk'", self.clamp)
        expect(self.clamp not in FOOTPRINT_CLAMPS or self.openness_flux != "roulette", "openness_flux",
               f"'none' or 'scale' with the clamp {self.clamp!r}", self.openness_flux)
        expect(self.bounces == 1 or self.source == "walk", "bounces", "1 with the source 'rsm'", self.bounces)
        if self.source == "walk":
            for key, only in FOR_MAPS.items():
                expect(getattr(self, key) == only, key, f"{only!r} with the source 'walk'", getattr(self, key))
            expect("sii_no_tn" not in self.as_published, "as_published", "no 'sii_no_tn' with the source 'walk'",
                   sorted(self.as_published))
        expect(self.warp == "none" or self.pattern != "all", "warp", "'none' with the pattern 'all'", self.warp)
        expect(not self.half_resolution or self.bound not in ("quad", "mesh"), "bound",
               "one in space, not on the screen, at half resolution", self.bound)
        expect(0 <= self.openness_radius <= LARGEST, "openness_radius", f"0 to {LARGEST:g} m", self.openness_radius)
        for key in ("defensive", "openness_floor"):
            expect(0 <= getattr(self, key) <= 1, key, "a share from 0 to 1", getattr(self, key))
        expect(self.openness_floor > 0 or self.openness_flux != "roulette", "openness_floor",
               "more than 0 for roulette", self.openness_floor)
        expect(0 <= self.refraction_exponent <= SHARPEST, "refraction_exponent", f"0 to {SHARPEST:g}",
               self.refraction_exponent)


def sii(frame: "Frame", settings: SiiSettings) -> Array:
    """Light every pixel by pixel lights.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : SiiSettings
        Which lights, how each lights a receiver and how far it reaches.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility.
    """
    lights = choose_lights(frame, settings)  # Sec. 3.1, 3.5 to 3.7
    footprint = footprints(frame, settings)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))  # Sec. 3.2: deferred shading

    def lit(some: Receivers) -> Array:
        return splat(some, lights, settings, footprint, frame.gbuffer.projection)  # Eq. (2), Sec. 3.4

    return half_resolution(receivers, lit) if settings.half_resolution else lit(receivers)
