"""How one pixel light lights one receiver: what sums over pairs can be set to."""

import dataclasses
from typing import ClassVar, Literal, get_args

from refgi.errors import expect
from refgi.scene.values import LARGEST

ClampMode = Literal["auto", "none", "distance", "geometry", "disc", "sphere"]
LobeNorm = Literal["none", "full_lobe", "clamped"]

FOOTPRINT_CLAMPS = ("disc", "sphere")  # need the surface area that each light stands for
STRONGEST_CLAMP = 1e18  # m, 1/m^2 or 1: its square stays within float32
LAST_SEED = 2**32 - 1


@dataclasses.dataclass(frozen=True)
class PairSettings:
    """How one pixel light lights one receiver.

    `clamp` keeps near pairs finite: not at all, by a minimum `distance` of `clamp_value` m, by a `geometry` term of
    at most `clamp_value` 1/m^2, by the form factor of a `disc` of the light's footprint A, or by a virtual `sphere`
    light of radius r, pi r^2 = `clamp_value` A (0: 1 A), for diffuse lights alone; "auto" leaves it to the method.
    `offset` moves lights back along their normals (m). `lobe_norm` is the norm of Phong lobes and `widening` the
    distance a (m) within which their exponents fall (0: nowhere). `as_published` names forms to use as printed; see
    docs/methods/sii.
    """

    clamp: ClampMode = "none"
    clamp_value: float = 0.0
    offset: float = 0.0
    lobe_norm: LobeNorm = "clamped"
    widening: float = 0.0
    as_published: frozenset[str] = frozenset()

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"sii_no_pi", "sii_widening", "sii_widening_unnorm"})

    def __post_init__(self) -> None:
        expect(self.clamp in get_args(ClampMode), "clamp", " or ".join(map(repr, get_args(ClampMode))), self.clamp)
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

    @property
    def effective_clamp(self) -> ClampMode:
        """The clamp in use: "auto" is none, unless a method has one of its own."""
        return "none" if self.clamp == "auto" else self.clamp
