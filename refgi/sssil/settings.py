"""What `hssil` can be set to."""

import dataclasses
import math
from typing import Any, ClassVar, Literal, get_args

from refgi.errors import expect
from refgi.scene.model import Camera
from refgi.scene.values import is_count, is_number

Start = Literal["full", "half", "quarter"]
Pattern = Literal["row", "pixel", "fixed", "all"]
Downsample = Literal["closest", "average", "closest_average"]
FormFactor = Literal["disc", "point"]
Upsampling = Literal["bilateral", "bilinear", "nearest"]
Visibility = Literal["none", "bitmask", "rays"]

CHOICES: dict[str, Any] = {
    "start": Start, "pattern": Pattern, "downsample": Downsample, "form_factor": FormFactor, "upsampling": Upsampling,
    "visibility": Visibility}
FIRST_LEVEL = {"full": 0, "half": 1, "quarter": 2}
LAST_SEED = 2**32 - 1
MOST_LEVELS, MOST_SAMPLES, MOST_SLICES, MOST_CAMERAS = 16, 1 << 16, 256, 16
LARGEST_RADIUS = 65536.0  # texels: the widest picture there may be
# least and most of each number
COUNTS = (("levels", 1, MOST_LEVELS), ("samples", 1, MOST_SAMPLES), ("seed", 0, LAST_SEED),
          ("cameras", 0, MOST_CAMERAS))
# the same of those that may be none
COUNTS_OR_NONE = (("inner_samples", 0, MOST_SAMPLES), ("slices", 1, MOST_SLICES))
# least and most of each number that may have a fraction, and what it is
NUMBERS = {
    "depth_sigma": (1e-6, 1e6, "a share of the depth"), "normal_power": (0.0, 1e4, "an exponent"),
    "thickness": (0.0, 100.0, "a share of the scene's diagonal"), "depth_tolerance": (0.0, 1.0, "a share of the depth"),
    "normal_cosine": (-1.0, 1.0, "a cosine")}


@dataclasses.dataclass(frozen=True)
class HssilSettings:
    """What `hssil` can be set to; the defaults are the paper's, those of docs/methods/hssil where it is silent.

    Sampling (Sec. 3.2): `levels` levels from `start` resolution on; at each, `samples` points of the crown from
    `radius` to twice as many texels around a receiver (none: the smallest with which the levels cover the screen), and
    `inner_samples` (none: a third) of the disc within, at the first level. `pattern` says who shares them: a "row" of
    receivers, each "pixel" its own, one "fixed" mirror-symmetric set for all, or "all" texels, each once, whatever
    `samples`. `seed` draws them.

    Levels: a texel takes over the `closest` of four with its position, normal and radiance, or the `average` of all,
    or position and normal of the closest and the average radiance (`downsample`). A sample's form factor is that of a
    "disc" (Eq. 4) or of a "point" (Eq. 3). `only_level` (0: the first) leaves all levels but one dark.

    `upsampling` from level to level is "bilateral", with weights of `depth_sigma` (share of the depth) and
    `normal_power`, "bilinear" or "nearest". `visibility` of samples is ignored as published ("none"), found by a
    "bitmask" of the screen in `slices` directions (none: the root of `samples`) with surfaces of `thickness` (share of
    the scene's diagonal), or by "rays". Extra `views`, and as many `cameras` as asked for where they see most of what
    the picture does not, light what they see as well; they are joined by the maximum where depth and normal agree
    within `depth_tolerance` (share of the depth) and `normal_cosine`. `as_published` names forms to use as printed.
    """

    radius: float | None = 20.0
    levels: int = 4
    samples: int = 64
    inner_samples: int | None = None
    start: Start = "half"
    pattern: Pattern = "row"
    seed: int = 0
    downsample: Downsample = "closest"
    form_factor: FormFactor = "disc"
    only_level: int | None = None
    upsampling: Upsampling = "bilateral"
    depth_sigma: float = 0.02
    normal_power: float = 8.0
    visibility: Visibility = "none"
    slices: int | None = None
    thickness: float = 0.01
    cameras: int = 0
    views: tuple[Camera, ...] = ()
    depth_tolerance: float = 0.02
    normal_cosine: float = 0.95
    as_published: frozenset[str] = frozenset()

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"hss_tan_f", "hss_disc_pi", "hss_level_factor"})

    def __post_init__(self) -> None:
        for key, names in CHOICES.items():
            expect(getattr(self, key) in get_args(names), key, " or ".join(map(repr, get_args(names))),
                   getattr(self, key))
        for key, least, most in COUNTS:
            count = getattr(self, key)
            expect(is_count(count) and least <= count <= most, key, f"a whole number, {least} to {most:,}", count)
        for key, (low, high, what) in NUMBERS.items():
            value = getattr(self, key)
            expect(is_number(value) and low <= value <= high, key, f"{what}, {low:g} to {high:g}", value)
        expect(self.radius is None or (is_number(self.radius) and 1 <= self.radius <= LARGEST_RADIUS), "radius",
               f"none or 1 to {LARGEST_RADIUS:g} texels", self.radius)
        for key, least, most in COUNTS_OR_NONE:
            count = getattr(self, key)
            expect(count is None or (is_count(count) and least <= count <= most), key,
                   f"none or a whole number, {least} to {most:,}", count)
        expect(self.only_level is None or (is_count(self.only_level) and 0 <= self.only_level < self.levels),
               "only_level", f"none or a level, 0 to {self.levels - 1}", self.only_level)
        expect(self.visibility != "bitmask" or self.pattern != "all", "pattern",
               "'row', 'pixel' or 'fixed' with the visibility 'bitmask'", self.pattern)
        object.__setattr__(self, "views", tuple(self.views))
        expect(all(isinstance(view, Camera) for view in self.views), "views", "cameras", self.views)
        object.__setattr__(self, "as_published", frozenset(self.as_published))
        expect(self.as_published <= self.SWITCHES, "as_published", f"names out of {sorted(self.SWITCHES)}",
               sorted(self.as_published))

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return self.visibility == "rays"

    @property
    def first_level(self) -> int:
        """Level of the pyramid that light is gathered at first: 0 is full resolution."""
        return FIRST_LEVEL[self.start]

    @property
    def inner(self) -> int:
        """Samples of the first level's disc: as dense as the crown's unless given."""
        return max(1, round(self.samples / 3)) if self.inner_samples is None else self.inner_samples

    @property
    def slice_count(self) -> int:
        """Directions that a bitmask is marched in: as many as samples along each unless given."""
        return max(1, round(math.sqrt(self.samples))) if self.slices is None else self.slices
