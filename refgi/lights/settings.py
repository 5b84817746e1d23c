"""Which pixel lights a splatting method uses, beside how each lights a receiver."""

import dataclasses
from typing import Any, ClassVar, Literal, get_args

from refgi.errors import expect
from refgi.lights.walk import MOST_BOUNCES
from refgi.pairs.settings import FOOTPRINT_CLAMPS, LAST_SEED, PairSettings
from refgi.scene.material import SHARPEST
from refgi.scene.values import LARGEST, is_count

Pattern = Literal["grid", "halton", "all", "random"]
Source = Literal["rsm", "walk"]
WarpMethod = Literal["none", "A", "B"]
Importance = Literal["flux", "peak", "openness"]
OpennessFlux = Literal["none", "scale", "roulette"]
Refraction = Literal["none", "back_face", "two_interface"]

CHOICES: dict[str, Any] = {"pattern": Pattern, "source": Source, "warp": WarpMethod, "importance": Importance,
                           "openness_flux": OpennessFlux, "refraction": Refraction}
MOST_LIGHTS = 1 << 24  # every texel of a map of 4096 x 4096
# least and most of each number
COUNTS = (("lights", 1, MOST_LIGHTS), ("bounces", 1, MOST_BOUNCES), ("warp_levels", 0, 32),
          ("openness_rays", 1, 1 << 16), ("seed", 0, LAST_SEED))
FOR_MAPS = ("pattern", "filtered", "warp", "renormalise_weights")  # no effect on paths: must be left as they are
FOR_MAPS_AS_PUBLISHED = frozenset({"sii_no_tn", "equal_solid_angle"})


@dataclasses.dataclass(frozen=True)
class LightSettings(PairSettings):
    """Which pixel lights, and how one lights one receiver.

    `lights` of a shadow map (`source` "rsm"), or as many paths of `bounces` bounces from each light ("walk",
    Sec. 3.7 of SII), are taken by a `pattern` ("all": every texel, `lights` is not used) with `seed`; `filtered`
    averages the flux over each light's cell (Sec. 4). `refraction` at glass is that of its back faces alone, as
    published, of both interfaces, or none; its lobes have `refraction_exponent`.

    Importance (Sec. 3.5): `warp` by method "A" or "B" over `warp_levels` levels, towards flux, flux times the lobe's
    `peak`, or that times 1 - `openness` (at least `openness_floor`), of which a share `defensive` is spread evenly;
    `renormalise_weights` makes their sum that of unwarped lights, at the cost of bias. `openness_flux` (Sec. 3.6)
    scales fluxes by 1 - openness, or plays roulette with them, which costs no energy in the mean. Openness is that of
    `openness_rays` rays of length `openness_radius` (m; 0: a tenth of the scene's diagonal).
    """

    lights: int = 768
    pattern: Pattern = "halton"
    filtered: bool = False
    source: Source = "rsm"
    bounces: int = 1
    seed: int = 0
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

    SWITCHES: ClassVar[frozenset[str]] = PairSettings.SWITCHES | FOR_MAPS_AS_PUBLISHED

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, least, most in COUNTS:
            count = getattr(self, key)
            expect(is_count(count) and least <= count <= most, key, f"a whole number, {least} to {most:,}", count)
        expect_choices(self, CHOICES)
        self._expect_source()
        expect(self.effective_clamp not in FOOTPRINT_CLAMPS or self.openness_flux != "roulette", "openness_flux",
               f"'none' or 'scale' with the clamp {self.effective_clamp!r}", self.openness_flux)
        expect(self.warp == "none" or self.pattern != "all", "warp", "'none' with the pattern 'all'", self.warp)
        expect(0 <= self.openness_radius <= LARGEST, "openness_radius", f"0 to {LARGEST:g} m", self.openness_radius)
        for key in ("defensive", "openness_floor"):
            expect(0 <= getattr(self, key) <= 1, key, "a share from 0 to 1", getattr(self, key))
        expect(self.openness_floor > 0 or self.openness_flux != "roulette", "openness_floor",
               "more than 0 for roulette", self.openness_floor)
        expect(0 <= self.refraction_exponent <= SHARPEST, "refraction_exponent", f"0 to {SHARPEST:g}",
               self.refraction_exponent)

    @property
    def traces_rays(self) -> bool:
        """Whether lights are found by rays."""
        warped_by_rays = self.warp != "none" and self.importance == "openness"
        return self.source == "walk" or self.openness_flux != "none" or warped_by_rays

    def _expect_source(self) -> None:
        expect(self.effective_clamp not in FOOTPRINT_CLAMPS or self.source == "rsm", "clamp",
               "one without footprints with the source 'walk'", self.clamp)
        expect(self.bounces == 1 or self.source == "walk", "bounces", "1 with the source 'rsm'", self.bounces)
        if self.source == "walk":
            left = {field.name: field.default for field in dataclasses.fields(self)}
            for key in FOR_MAPS:
                expect(getattr(self, key) == left[key], key, f"{left[key]!r} with the source 'walk'",
                       getattr(self, key))
            of_maps = self.as_published & FOR_MAPS_AS_PUBLISHED
            expect(not of_maps, "as_published", f"no {' or '.join(map(repr, sorted(of_maps)))} with the source 'walk'",
                   sorted(self.as_published))


def expect_choices(settings: Any, choices: dict[str, Any]) -> None:
    """Check that settings are among the names their types list.

    Parameters
    ----------
    settings : object
        Settings.
    choices : dict of str to Literal
        The type of each key to check.

    Raises
    ------
    InputError
        If a value is not among the names.
    """
    for key, names in choices.items():
        value = getattr(settings, key)
        expect(value in get_args(names), key, " or ".join(map(repr, get_args(names))), value)
