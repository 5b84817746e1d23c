"""Settings of `hssil` (Soler et al. 2009) and of temporal coherence (Sec. 3.3)."""

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar, Literal

from refgi.errors import expect
from refgi.scene.model import Camera
from refgi.settings import LAST_SEED, Settings, setting

Start = Literal["full", "half", "quarter"]
Pattern = Literal["interleaved", "row", "pixel", "fixed", "all"]
Density = Literal["inverse_distance", "uniform"]
Downsample = Literal["closest", "average", "closest_average", "resampled"]
FormFactor = Literal["disc", "texel", "point"]
Form = Literal["recursive", "printed"]
Fetch = Literal["bilinear", "nearest"]

FIRST_LEVEL = {"full": 0, "half": 1, "quarter": 2}
MOST_LEVELS, MOST_SAMPLES, MOST_SLICES = 16, 1 << 16, 256
MOST_CLAMP_RADIUS = 64
LARGEST_WINDOW, LARGEST_TILE = 16, 16
LARGEST_RADIUS = 65536.0  # texels: the widest picture there may be


@dataclasses.dataclass(frozen=True)
class SamplingSettings(Settings):
    """Crown sampling over mip levels (Sec. 3.2).

    At each level, samples lie in the crown from `radius` to twice as many texels around a receiver; at the first level
    also in the disc within. Patterns: "interleaved" samples, where each texel of a tile of `tile` x `tile` has its part
    of one larger set; a "row" of receivers shares samples, each "pixel" has its own, one "fixed" mirror-symmetric set
    serves all, or "all" texels are samples, each once, whatever `samples`. The density of samples is "uniform" or the
    "inverse_distance" from the receiver.
    """

    PRINCIPAL = "samples"

    samples: int = setting(64, "samples of the crown at each level", least=1, most=MOST_SAMPLES)
    radius: float | None = setting(
        20.0, "inner radius of the crowns; none: the smallest with which the levels cover the picture", least=1.0,
        most=LARGEST_RADIUS, unit="texels")
    levels: int = setting(4, "mip levels", least=1, most=MOST_LEVELS)
    start: Start = setting("half", "resolution of the first level")
    pattern: Pattern = setting("interleaved", "receivers that share samples")
    tile: int = setting(4, "texels along a side of a tile of interleaved samples, a power of two", least=1,
                        most=LARGEST_TILE, study=True)
    density: Density = setting("inverse_distance", "samples per texel, by the distance from the receiver", study=True)
    seed: int = setting(0, "seed of the samples' offsets", least=0, most=LAST_SEED)
    inner_samples: int | None = setting(
        None, "samples of the first level's inner disc; none: as dense as those of its crown", least=0,
        most=MOST_SAMPLES, study=True)

    def check(self) -> None:
        """Check that tiles are powers of two."""
        expect(self.tile & (self.tile - 1) == 0, "tile", f"a power of two, 1 to {LARGEST_TILE}", self.tile)

    @property
    def first_level(self) -> int:
        """Level of the pyramid that light is gathered at first: 0 is full resolution."""
        return FIRST_LEVEL[self.start]

    @property
    def inner(self) -> int:
        """Samples of the first level's disc: as dense as the crown's by default."""
        return self.counts(0)[0]

    def counts(self, index: int) -> tuple[int, int]:
        """Return the numbers of samples in the disc and in the crown of a level; `index` 0 is the first.

        Uniform samples add a third of the crown's for the disc, a third of its area. Where density falls with distance
        disc and crown are worth the same, and share the samples of the first level.
        """
        if index > 0:
            return 0, self.samples
        if self.inner_samples is not None:
            return self.inner_samples, self.samples
        if self.density == "uniform":
            return max(1, round(self.samples / 3)), self.samples
        return (self.samples + 1) // 2, max(1, self.samples // 2)


@dataclasses.dataclass(frozen=True)
class SenderSettings(Settings):
    """Texels as senders: downsampling (Sec. 4) and form factor (Sec. 3.1).

    A coarse texel takes position, normal and radiance of the "closest" of four, the "average" of all, or position and
    normal of the closest and the average radiance; "resampled", it sends the flux of all from one, drawn in
    proportion to flux, and receives as the closest. A sample's form factor is that of a "disc" as large as
    `disc_share` of the texels that it stands for, but at least one (Eq. 4 where it is all), of the disc of its own
    "texel", or of a "point" (Eq. 3), times what of them is not in the disc.
    """

    PRINCIPAL = "downsample"

    downsample: Downsample = setting("resampled", "downsampling from level to level")
    form_factor: FormFactor = setting("disc", "form factor of a sample: Eq. 4 for what it stands for (disc) or "
                                      "its texel (texel), or Eq. 3 (point)", study=True)
    disc_share: float = setting(0.25, "share of what a sample stands for that its disc covers, at least one texel; "
                                "1: all, as Eq. 4", least=0.0, most=1.0, study=True)
    only_level: int | None = setting(None, "the one level that sends light, 0: the first; none: all", least=0,
                                     most=MOST_LEVELS - 1, study=True)


@dataclasses.dataclass(frozen=True)
class GeometryBlur(Settings):
    """Geometry-aware blur of each level's light before upsampling: the mean over texels of the same surface.

    With interleaved samples a window of the tile's size holds all of the tile's samples. Texels count that lie on the
    tangent plane of the texel and face as it does.
    """

    PRINCIPAL = "size"

    size: int = setting(4, "texels along a side of the window", least=1, most=LARGEST_WINDOW, study=True)
    plane_tolerance: float = setting(0.02, "largest distance from the tangent plane, a share of the depth", least=0.0,
                                     most=1e6, study=True)
    cosine: float = setting(0.9, "least cosine between normals", least=-1.0, most=1.0, study=True)


@dataclasses.dataclass(frozen=True)
class Bilateral(Settings):
    """Joint bilateral upsampling of 3 x 3 texels (Sec. 3.2)."""

    depth_sigma: float = setting(0.02, "standard deviation of depths, a share of the depth", least=1e-6, most=1e6,
                                 study=True)
    normal_power: float = setting(8.0, "exponent of the cosine between normals", least=0.0, most=1e4, study=True)


@dataclasses.dataclass(frozen=True)
class Bilinear(Settings):
    """Bilinear upsampling of 4 texels, which bleeds across edges."""


@dataclasses.dataclass(frozen=True)
class Nearest(Settings):
    """Upsampling by the nearest texel."""


@dataclasses.dataclass(frozen=True)
class Bitmask(Settings):
    """Visibility of samples by a bitmask of the depth map in slices (after Therrien et al. 2023)."""

    thickness: float = setting(0.01, "thickness of surfaces, a share of the scene's diagonal", least=0.0, most=100.0)
    slices: int | None = setting(None, "directions that are marched; none: the root of the number of samples", least=1,
                                 most=MOST_SLICES, study=True)

    def count(self, samples: int) -> int:
        """Return the number of slices: as many as samples along each by default."""
        return max(1, round(math.sqrt(samples))) if self.slices is None else self.slices


@dataclasses.dataclass(frozen=True)
class Rays(Settings):
    """Visibility of samples by shadow rays."""


@dataclasses.dataclass(frozen=True)
class CameraSettings(Settings):
    """Further cameras, joined by the maximum where depth and normal agree (Sec. 5)."""

    PRINCIPAL = "views"

    views: tuple[Camera, ...] = setting((), "further cameras of the user")
    depth_tolerance: float = setting(0.02, "largest difference of depths, a share of the depth", least=0.0, most=1.0,
                                     study=True)
    normal_cosine: float = setting(0.95, "least cosine between normals", least=-1.0, most=1.0, study=True)

    def check(self) -> None:
        """Check that `views` are cameras; a list becomes a tuple."""
        listed = isinstance(self.views, list | tuple) and all(isinstance(view, Camera) for view in self.views)
        expect(listed, "views", "cameras", self.views)
        object.__setattr__(self, "views", tuple(self.views))


@dataclasses.dataclass(frozen=True)
class HssilSettings(Settings):
    """Settings of `hssil`; docs/methods/hssil tells which defaults are the paper's.

    Switches use a form as printed: "hss_tan_f" the tangents of Eq. 3, "hss_disc_pi" Eq. 4 without its pi,
    "hss_level_factor" areas scaled by 4^k a second time.
    """

    sampling: SamplingSettings = setting(SamplingSettings(), "crown sampling over mip levels")
    senders: SenderSettings = setting(SenderSettings(), "texels as senders")
    blur: GeometryBlur | None = setting(GeometryBlur(), "geometry-aware blur of each level's light", study=True)
    upsampling: Bilateral | Bilinear | Nearest = setting(Bilateral(), "upsampling from level to level")
    visibility: Bitmask | Rays | None = setting(None, "visibility of samples; none: ignored, as published")
    cameras: CameraSettings = setting(CameraSettings(), "further cameras")
    as_published: frozenset[str] = setting(frozenset(), "forms to use as printed", study=True)

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"hss_tan_f", "hss_disc_pi", "hss_level_factor"})

    def check(self) -> None:
        """Check that `only_level` exists, and that the pattern has slices where a bitmask needs them."""
        only, levels = self.senders.only_level, self.sampling.levels
        expect(only is None or only < levels, "senders.only_level", f"none or a level, 0 to {levels - 1}", only)
        expect(not isinstance(self.visibility, Bitmask) or self.sampling.pattern != "all", "sampling.pattern",
               "any but 'all' with the visibility 'bitmask'", self.sampling.pattern)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return isinstance(self.visibility, Rays)


PRESETS: Mapping[str, HssilSettings] = {
    # Fig. 6: half resolution, 4 levels, 64 samples, r = 20; Sec. 4: the closest of four texels; Eq. 4; v = 1
    "paper": HssilSettings(
        SamplingSettings(samples=64, radius=20.0, levels=4, start="half", pattern="row", density="uniform"),
        SenderSettings(downsample="closest", form_factor="disc", disc_share=1.0), None, Bilateral(), None),
}


@dataclasses.dataclass(frozen=True)
class TemporalSettings(Settings):
    """Settings of temporal coherence (Sec. 3.3, which gives no numbers).

    Of a pixel's light the share `weight`, a, comes from the frame before where that frame shows the same surface, by
    depth and normal. A disoccluded pixel takes its new light alone. The "recursive" form blends with the frame before
    as filtered, the "printed" one as computed. By `warm_up` the recursive form gives a surface found in n frames before
    the share n / (n + 1) at most: the mean of all frames until a is less. Where a surface moved of itself by v pixels
    since, a falls to a exp(-v / `speed`); a moving camera alone leaves a as it is. A pixel whose point lay outside the
    earlier picture has a exp(-v / `entering_speed`) of the light at its edge, v pixels from there.
    `clamp` bounds earlier light to so many standard deviations about the mean of the new light within `clamp_radius`.
    The earlier light is fetched from the four texels around a point ("bilinear") or from the "nearest".
    """

    PRINCIPAL = "weight"

    weight: float = setting(0.9, "share of the frame before, a", least=0.0, most=0.9999)
    form: Form = setting("recursive", "blend with the frame before as filtered or, as printed, as computed", study=True)
    warm_up: bool = setting(True, "share of n / (n + 1) at most where a surface was found in n frames before")
    depth_tolerance: float = setting(0.02, "largest difference of depths, a share of the depth", least=0.0, most=1.0)
    normal_cosine: float = setting(0.95, "least cosine between normals", least=-1.0, most=1.0)
    speed: float = setting(16.0, "speed at which a falls to a / e", least=1e-3, most=1e6, unit="pixels a frame")
    entering_speed: float | None = setting(
        None, "speed at which a of points that enter the picture falls to a / e; none: they take their new light alone",
        least=1e-3, most=1e6, unit="pixels a frame")
    clamp: float | None = setting(
        None, "standard deviations about the mean of new light that earlier light is clamped to; none: it is not",
        least=0.0, most=1e6)
    clamp_radius: int = setting(4, "pixels either way that this mean is of", least=1, most=MOST_CLAMP_RADIUS,
                                study=True)
    fetch: Fetch = setting("bilinear", "texels that earlier light is fetched from", study=True)

    @property
    def counts_frames(self) -> bool:
        """Whether the number of frames in which a surface was found is stored."""
        return self.warm_up and self.form == "recursive"

    @property
    def variance(self) -> float:
        """Share of the variance of independent frames that remains where nothing moves, after many frames."""
        if self.form == "printed":
            return self.weight**2 + (1 - self.weight) ** 2
        return (1 - self.weight) / (1 + self.weight)


TEMPORAL_PRESETS: Mapping[str, TemporalSettings] = {
    # Sec. 3.3: new pixels have an a by the camera's speed, of which it gives no number; first frames are as all others
    "paper": TemporalSettings(warm_up=False, entering_speed=16.0),
}
