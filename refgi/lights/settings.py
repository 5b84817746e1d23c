"""Settings of pixel lights, and what every method that uses pixel lights approximates by them."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, TypeVar

from refgi.errors import expect
from refgi.lights.walk import MOST_BOUNCES
from refgi.method import Approximation
from refgi.pairs.settings import AutoClamp, DiscClamp, PairSettings
from refgi.scene.material import SHARPEST
from refgi.scene.values import LARGEST
from refgi.settings import LAST_SEED, Settings, setting

S = TypeVar("S", bound=Any)

Pattern = Literal["grid", "halton", "all", "random"]

OCCLUSION = "openness of receivers in place of visibility (SII Sec. 7)"
MOST_LIGHTS = 1 << 24  # every texel of a map of 4096 x 4096


@dataclasses.dataclass(frozen=True)
class WarpSettings(Settings):
    """Warp the pattern towards what is important (SII Sec. 3.5)."""

    levels: int = setting(3, "levels of the importance pyramid", least=0, most=32)
    importance: Literal["flux", "peak", "openness"] = setting(
        "flux", "flux, flux times the lobe's peak, or that times 1 - openness")
    defensive: float = setting(0.0, "share of the importance that is spread evenly", least=0.0, most=1.0)
    renormalise_weights: bool = setting(False, "weights sum to those of unwarped lights, which costs a bias",
                                        study=True)


@dataclasses.dataclass(frozen=True)
class WarpA(WarpSettings):
    """Warping by method A of SII Sec. 3.5."""

    NAME = "A"


@dataclasses.dataclass(frozen=True)
class WarpB(WarpSettings):
    """Warping by method B of SII Sec. 3.5."""

    NAME = "B"


@dataclasses.dataclass(frozen=True)
class RefractionSettings(Settings):
    """What glass does to the light of a map."""

    exponent: float = setting(3000.0, "exponent of the lobes that leave glass", least=0.0, most=SHARPEST)


@dataclasses.dataclass(frozen=True)
class BackFace(RefractionSettings):
    """Refraction at back faces alone, as published."""


@dataclasses.dataclass(frozen=True)
class TwoInterface(RefractionSettings):
    """Refraction at both interfaces."""


@dataclasses.dataclass(frozen=True)
class MapLights(Settings):
    """Pixel lights are texels of reflective shadow maps."""

    NAME = "rsm"
    SWITCHES: ClassVar[frozenset[str]] = frozenset({"sii_no_tn", "equal_solid_angle", "sii_peak"})

    projection: Literal["auto", "cube", "paraboloid"] = setting(
        "auto", "maps of spots and point lights: those of shadows, or a cube or one or two paraboloids (SII Sec. 3.6)")
    pattern: Pattern = setting("halton", "where they lie in a map; all: every texel, whatever the count")
    filtered: bool = setting(False, "flux is averaged over each light's cell (SII Sec. 4)")
    warp: WarpA | WarpB | None = setting(None, "importance warping (SII Sec. 3.5)")
    refraction: BackFace | TwoInterface | None = setting(BackFace(), "refraction at glass")
    as_published: frozenset[str] = setting(frozenset(), "forms of the maps to use as printed", study=True)

    def check(self) -> None:
        """Check that a warped pattern leaves some texels out, and that a printed importance is in use."""
        expect(self.warp is None or self.pattern != "all", "warp", "none with the pattern 'all'",
               self.warp and self.warp.name())
        expect("sii_peak" not in self.as_published or (self.warp is not None and self.warp.importance != "flux"),
               "as_published", "no sii_peak without the warp's importance 'peak' or 'openness'",
               sorted(self.as_published))


@dataclasses.dataclass(frozen=True)
class PathLights(Settings):
    """Pixel lights are the ends of quasi-random light paths (SII Sec. 3.7)."""

    NAME = "walk"

    bounces: int = setting(1, "bounces of a path before its end lights", least=1, most=MOST_BOUNCES)


@dataclasses.dataclass(frozen=True)
class Openness(Settings):
    """Short rays from surface points: the share of cosine-weighted directions that nothing blocks (SII Sec. 3.5)."""

    radius: float = setting(0.0, "length of the rays; 0: a tenth of the scene's diagonal", least=0.0, most=LARGEST,
                            unit="m", study=True)
    rays: int = setting(16, "rays of one point", least=1, most=1 << 16, study=True)


@dataclasses.dataclass(frozen=True)
class OpennessSettings(Openness):
    """How open the surroundings of a light are, and what that does to its flux (SII Sec. 3.6)."""

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"sii_openness"})

    floor: float = setting(0.05, "least importance of a light in the open", least=0.0, most=1.0, study=True)
    flux: Literal["none", "scale", "roulette"] = setting(
        "none", "flux times 1 - openness, or roulette with it, which costs no energy in the mean")
    as_published: frozenset[str] = setting(frozenset(), "forms of the scaling to use as printed", study=True)

    def check(self) -> None:
        """Check that roulette can let a light live, and that a printed scaling is in use."""
        expect(self.floor > 0 or self.flux != "roulette", "floor", "more than 0 for roulette", self.floor)
        expect(not self.as_published or self.flux == "scale", "as_published",
               f"no sii_openness with the flux {self.flux!r}", sorted(self.as_published))


@dataclasses.dataclass(frozen=True)
class LightSettings(Settings):
    """Which pixel lights there are."""

    PRINCIPAL = "count"

    count: int = setting(768, "pixel lights, or light paths, of all lamps together, shared out by the flux they bring",
                         least=1, most=MOST_LIGHTS)
    seed: int = setting(0, "which random numbers", least=0, most=LAST_SEED)
    source: MapLights | PathLights = setting(MapLights(), "texels of shadow maps, or ends of light paths")
    openness: OpennessSettings = setting(OpennessSettings(), "lights in the open")

    @property
    def traces_rays(self) -> bool:
        """Whether lights are found by rays."""
        return isinstance(self.source, PathLights) or self.openness.flux != "none" or self._warps_by_rays

    @property
    def _warps_by_rays(self) -> bool:
        warp = self.source.warp if isinstance(self.source, MapLights) else None
        return warp is not None and warp.importance == "openness"

    @property
    def has_footprints(self) -> bool:
        """Whether each light stands for a known surface area."""
        return isinstance(self.source, MapLights) and self.openness.flux != "roulette"


def most_lights(lights: LightSettings, maps: int, texels: int) -> int:
    """Return how many pixel lights there may be at most, by shadow maps of all lamps and texels of a map."""
    if isinstance(lights.source, PathLights):
        return lights.count * lights.source.bounces
    maps *= 6 if lights.source.projection == "cube" else 1  # a spot's one becomes six
    if lights.source.pattern == "all":
        return maps * texels
    # a grid has a cell on each face at least, and at most 4 of 2.5 that are its share
    return 2 * lights.count + maps if lights.source.pattern == "grid" else lights.count


def clamped_pairs(lights: LightSettings, pairs: PairSettings) -> PairSettings:
    """Return pairs with the clamp that "auto" stands for: "disc", and none where lights have no footprints."""
    if not isinstance(pairs.clamp, AutoClamp):
        return pairs
    return dataclasses.replace(pairs, clamp=DiscClamp() if lights.has_footprints else None)


def with_clamp(settings: S) -> S:
    """Return settings of a method with pixel lights whose clamp is the one in use, never "auto"."""
    return dataclasses.replace(settings, pairs=settings.effective_pairs)


def expect_footprints(lights: LightSettings, pairs: PairSettings) -> None:
    """Raise `InputError` unless lights have the footprints that a clamp needs."""
    if pairs.needs_footprints:
        expect(isinstance(lights.source, MapLights), "pairs.clamp", "one without footprints with the source 'walk'",
               pairs.clamp and pairs.clamp.name())
        expect(lights.openness.flux != "roulette", "lights.openness.flux",
               f"'none' or 'scale' with the clamp {pairs.clamp and pairs.clamp.name()!r}", lights.openness.flux)


PATHS = 1 << 16  # light paths that stand for all
FINER = 2  # texels along a side for each one


def every_light(lights: LightSettings) -> LightSettings:
    """Return settings by which every texel of the maps is a pixel light, or many ends of light paths are."""
    if not isinstance(lights.source, MapLights):
        return dataclasses.replace(lights, count=max(lights.count, PATHS), seed=0)
    source = dataclasses.replace(lights.source, pattern="all", filtered=False, warp=None,
                                 as_published=lights.source.as_published - {"sii_peak"})
    return dataclasses.replace(lights, count=1, seed=0, source=source)


def changed(**values: Any) -> Callable[[Any, Mapping[str, Any]], Any]:
    """Return what switches an approximation off by other values of some settings."""
    return lambda settings, _: dataclasses.replace(settings, **values)


def without_clamp(settings: Any, _: Mapping[str, Any]) -> Any:
    """Return settings of a method whose near pairs are not clamped."""
    return dataclasses.replace(settings, pairs=dataclasses.replace(settings.pairs, clamp=None))


VISIBILITY = Approximation("visibility", "nothing blocks indirect light", limit=lambda _: {"visibility": False})
RSM_RESOLUTION = Approximation(
    "RSM resolution", f"texels of the reflective shadow map; off: {FINER} along a side for each",
    frame=lambda options: {**options, "rsm_resolution": FINER * options["rsm_resolution"]})
LIGHT_SAMPLING = Approximation(
    "light sampling", "N pixel lights for all texels of the reflective shadow map",
    lambda settings, _: dataclasses.replace(settings, lights=every_light(settings.lights)))
OPENNESS = Approximation("openness", "flux of lights in the open is scaled down or left to chance", lambda settings, _:
                         dataclasses.replace(settings, lights=dataclasses.replace(
                             settings.lights, openness=OpennessSettings())))
AMBIENT_OCCLUSION = Approximation(
    "ambient occlusion", "openness of receivers stands for visibility", changed(ambient_occlusion=None))
CLAMP = Approximation("clamp", "what bounds the light of near pairs", without_clamp)
