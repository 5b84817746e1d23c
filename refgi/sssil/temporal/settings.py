"""What the temporal filter can be set to."""

import dataclasses
from typing import Literal, get_args

from refgi.errors import expect
from refgi.scene.values import is_number
from refgi.sssil.reprojection.look_up import Fetch

Form = Literal["recursive", "printed"]

CHOICES = {"form": Form, "fetch": Fetch}
# least and most of each number, and what it is
NUMBERS = {
    "weight": (0.0, 0.9999, "a share"), "depth_tolerance": (0.0, 1.0, "a share of the depth"),
    "normal_cosine": (-1.0, 1.0, "a cosine"), "speed": (1e-3, 1e6, "pixels a frame")}


@dataclasses.dataclass(frozen=True)
class TemporalSettings:
    """How much of the light of earlier frames stays (Sec. 3.3, which gives no numbers).

    Of a pixel's light the share `weight`, a, comes from the frame before where that frame shows the same surface: a
    depth within `depth_tolerance` (share of the depth) and a normal within `normal_cosine`. A pixel that it does not
    show takes its new light alone. `form` "recursive" blends with the frame before as filtered, "printed" as computed.
    Where a surface moved of itself by v pixels since, a falls to a exp(-v / `speed`); a moving camera alone leaves a as
    it is. `fetch` takes the earlier light from the four texels around a point ("bilinear") or from the one it is in
    ("nearest").
    """

    weight: float = 0.9
    form: Form = "recursive"
    depth_tolerance: float = 0.02
    normal_cosine: float = 0.95
    speed: float = 16.0
    fetch: Fetch = "bilinear"

    def __post_init__(self) -> None:
        for key, names in CHOICES.items():
            expect(getattr(self, key) in get_args(names), key, " or ".join(map(repr, get_args(names))),
                   getattr(self, key))
        for key, (low, high, what) in NUMBERS.items():
            value = getattr(self, key)
            expect(is_number(value) and low <= value <= high, key, f"{what}, {low:g} to {high:g}", value)

    @property
    def variance(self) -> float:
        """Share of the variance of independent frames that stays where nothing moves, after many frames."""
        if self.form == "printed":
            return self.weight**2 + (1 - self.weight) ** 2
        return (1 - self.weight) / (1 + self.weight)
