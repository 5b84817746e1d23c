"""Settings of one pixel light that lights one receiver: the clamp of near pairs, the light's offset, its lobe."""

import dataclasses
from typing import ClassVar, Literal

from refgi.errors import expect
from refgi.scene.values import LARGEST
from refgi.settings import Settings, setting

STRONGEST_CLAMP = 1e18  # m, 1/m^2 or 1: its square stays within float32
LEAST_LIGHTS = 8192  # that lightcuts "auto" may cluster
LARGEST_ERROR = "largest error of a receiver's sum over channels, as a share of it"


@dataclasses.dataclass(frozen=True)
class AutoClamp(Settings):
    """A disc where lights have footprints and a method sums them without rays; else none."""

    NAME = "auto"


@dataclasses.dataclass(frozen=True)
class DistanceClamp(Settings):
    """Pairs count as at least a distance apart."""

    NAME = "distance"

    value: float | None = setting(None, "least distance; must be given", above=0.0, most=STRONGEST_CLAMP, unit="m")


@dataclasses.dataclass(frozen=True)
class GeometryClamp(Settings):
    """The geometry term of a pair has a bound."""

    NAME = "geometry"

    value: float | None = setting(None, "largest term; must be given", above=0.0, most=STRONGEST_CLAMP, unit="1/m^2")


@dataclasses.dataclass(frozen=True)
class DiscClamp(Settings):
    """A light is a disc of its footprint A: r^2 + A / pi takes the place of one r^2."""

    NAME = "disc"


@dataclasses.dataclass(frozen=True)
class SphereClamp(Settings):
    """A light is a virtual spherical light of radius r, pi r^2 = `value` A, A its footprint; diffuse lights alone."""

    NAME = "sphere"

    value: float = setting(1.0, "pi r^2 of the sphere over the light's footprint", above=0.0, most=STRONGEST_CLAMP)


Clamp = AutoClamp | DistanceClamp | GeometryClamp | DiscClamp | SphereClamp


@dataclasses.dataclass(frozen=True)
class AutoLightcuts(Settings):
    """Bounded lightcuts where they are estimated to take less time than the sum of all lights; else none."""

    NAME = "auto"

    error: float = setting(0.02, LARGEST_ERROR, least=1e-6, most=1.0)


@dataclasses.dataclass(frozen=True)
class Lightcuts(Settings):
    """Clusters of lights stand for their lights where a bound on the sum's error allows it (Walter et al. 2005)."""

    NAME = "bounded"
    PRINCIPAL = "error"

    error: float = setting(0.02, LARGEST_ERROR, least=1e-6, most=1.0)


@dataclasses.dataclass(frozen=True)
class LobeSettings(Settings):
    """The Phong lobe of a glossy pixel light (SII Sec. 3.3)."""

    norm: Literal["none", "full_lobe", "clamped"] = setting("clamped", "norm of a lobe that the surface cuts off")
    widening: float = setting(0.0, "distance a within which exponents fall; 0: nowhere", least=0.0, most=LARGEST,
                              unit="m", study=True)


@dataclasses.dataclass(frozen=True)
class PairSettings(Settings):
    """How one pixel light lights one receiver."""

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"sii_no_pi", "sii_widening", "sii_widening_unnorm"})

    clamp: Clamp | None = setting(AutoClamp(), "what keeps near pairs finite")
    offset: float = setting(0.0, "how far lights lie behind their surface", least=-LARGEST, most=LARGEST, unit="m",
                            study=True)
    lobe: LobeSettings = setting(LobeSettings(), "lobes of glossy lights")
    as_published: frozenset[str] = setting(frozenset(), "forms of the pair term to use as printed", study=True)

    def check(self) -> None:
        """Check that a clamp has its value."""
        if isinstance(self.clamp, DistanceClamp | GeometryClamp):
            expect(self.clamp.value is not None, "clamp.value",
                   f"a number > 0 for the clamp {self.clamp.name()!r}, up to {STRONGEST_CLAMP:g}", None)

    @property
    def needs_footprints(self) -> bool:
        """Whether the clamp needs the surface area that each light stands for."""
        return isinstance(self.clamp, DiscClamp | SphereClamp)

    @property
    def clamps(self) -> bool:
        """Whether any pair is clamped; "auto" that no method has resolved clamps none."""
        return self.clamp is not None and not isinstance(self.clamp, AutoClamp)
