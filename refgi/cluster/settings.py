"""Settings of clustered visibility (`val`), composed of small classes; a choice is one class of several."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar, Literal

from refgi.error_target.grid import ErrorTarget
from refgi.errors import expect
from refgi.lights.settings import MOST_LIGHTS, LightSettings, clamped_pairs, expect_footprints
from refgi.pairs.settings import PairSettings
from refgi.settings import Settings, setting

Distance = Literal["raw", "normalised", "squared"]
Axes = Literal["fixed", "pca", "min_area"]
Extent = Literal["root", "longer", "shorter"]
DepthScaleName = Literal["log_map", "map", "scene"]
Assignment = Literal["index", "cluster"]

MOST_TERMS = 64
MOST_BLOCK = 64  # pixels
LARGEST_MAP = 4096  # texels
WIDEST_KERNEL = 255  # texels
LARGEST_WEIGHT = 1e6
LARGEST_BIAS = 0.25
# best near_distance of each kind of shadow over four scenes (docs/methods/val_visibility.md)
NEAR_DISTANCE: Mapping[str, float] = {
    "csm": 0.4, "pcss": 0.7, "pcf": 0.6, "hard": 0.6, "back_projection": 0.25, "rays_rectangle": 0.7}
PRINTED = frozenset({"val_alpha", "val_alpha_over_pi", "val_search_solid_angle"})


@dataclasses.dataclass(frozen=True)
class Clusters(Settings):
    """K-means over position and normal (Sec. 5.1): d = w_x dx + w_a dalpha."""

    PRINCIPAL = "count"

    count: int = setting(30, "area lights", least=1, most=MOST_LIGHTS)
    distance: Distance = setting(
        "normalised", "distance in shares of the scene's diagonal and of pi, as printed (raw), or squared", study=True)
    position_weight: float = setting(0.7, "w_x", least=0.0, most=LARGEST_WEIGHT, study=True)
    normal_weight: float = setting(0.3, "w_a", least=0.0, most=LARGEST_WEIGHT, study=True)
    rounds: int = setting(50, "most rounds; fewer where no light changes its cluster", least=1, most=1000, study=True)

    def check(self) -> None:
        """Check that something is weighed."""
        expect(self.position_weight + self.normal_weight > 0, "position_weight",
               "more than 0 beside a normal_weight of 0", self.position_weight)


@dataclasses.dataclass(frozen=True)
class AreaLightSettings(Settings):
    """The rectangle of a cluster, whose extent is the paper's Delta (Sec. 6)."""

    axes: Axes = setting("fixed", "axes of the rectangle in its plane: of the map, of the lights, or of least area",
                         study=True)
    extent: Extent = setting("root", "Delta: root of the area, longer or shorter side", study=True)
    unbiased_area: bool = setting(False, "the rectangle grows by what a sample of n lights misses", study=True)
    foreshortened: bool = setting(False, "Delta shrinks with the cosine towards the receiver", study=True)


@dataclasses.dataclass(frozen=True)
class ShadowMapSettings(Settings):
    """The paraboloid map of each area light (Sec. 4.2, 6)."""

    PRINCIPAL = "resolution"

    resolution: int = setting(256, "texels a side", least=1, most=LARGEST_MAP)
    renderer: Literal["raster", "rays"] = setting("raster", "what finds the depths", study=True)
    near_geometry: Literal["keep", "planes", "ball"] = setting(
        "ball", "left out near the centre: nothing, planes that pass there, or hits within a ball", study=True)
    near_distance: float | None = setting(
        None, "how near, as a share of the cluster's radius; none: what is best for the kind of shadow", least=0.0,
        most=100.0, study=True)
    occluders_alone: bool = setting(True, "leave out triangles that nothing lies behind", study=True)
    behind: Literal["visible", "dual_paraboloid", "raytrace"] = setting(
        "visible", "what receivers behind an area light see of it: all, or by a second map, or by rays")

    @property
    def near_share(self) -> float:
        """How near, as a share of the cluster's radius; that of convolution shadow maps where it is not given."""
        return NEAR_DISTANCE["csm"] if self.near_distance is None else self.near_distance


@dataclasses.dataclass(frozen=True)
class Csm(Settings):
    """Convolution shadow maps: a Fourier series of the depth test, prefiltered (Sec. 4.1)."""

    terms: int = setting(4, "M, terms of the series", least=1, most=MOST_TERMS)
    depth_scale: DepthScaleName = setting(
        "log_map", "depths between what a map holds, by logarithm or in metres, or up to the scene's end",
        study=True)
    prefilter: Literal["mip", "brute"] = setting("mip", "mean over a disc: mip map, or every texel", study=True)
    bias: float | None = setting(None, "share of the depth range; none: where the series is 1 for the first time",
                                 least=0.0, most=LARGEST_BIAS, study=True)
    attenuation: float = setting(0.0, "A of the terms' attenuation", least=0.0, most=100.0, study=True)
    rescale: Literal["none", "scale2", "plateau"] = setting("none", "what undoes the attenuation", study=True)
    quantisation: Literal["none", "published"] = setting("none", "8 and 16 bits of the published textures", study=True)


@dataclasses.dataclass(frozen=True)
class ConstantBias(Settings):
    """Receivers are moved towards the light by a share of the depth range."""

    value: float = setting(0.0, "share of the depth range", least=0.0, most=LARGEST_BIAS)
    scale: DepthScaleName = setting("log_map", "scale of depths that the share is of")


@dataclasses.dataclass(frozen=True)
class Pcss(Settings):
    """Percentage closer soft shadows: blocker search, then percentage closer filtering, texel by texel."""

    cone: bool = setting(True, "blockers lie within the cone from the receiver to the light", study=True)
    blocker_depth: Literal["distance", "axial"] = setting(
        "distance", "depth of blockers that sizes filters: distance from the centre, or along the axis to the receiver",
        study=True)
    constant_bias: ConstantBias | None = setting(
        None, "compare with the receiver's biased distance; none: with its tangent plane", study=True)


@dataclasses.dataclass(frozen=True)
class Pcf(Settings):
    """Percentage closer filtering: a fixed kernel of binary depth tests around the receiver's texel."""

    texels: int = setting(5, "side of the kernel, odd", least=1, most=WIDEST_KERNEL, unit="texels")

    def check(self) -> None:
        """Check that the kernel has a middle."""
        expect(self.texels % 2 == 1, "texels", "an odd number", self.texels)


@dataclasses.dataclass(frozen=True)
class Hard(Settings):
    """One depth test towards the centre of the area light."""


@dataclasses.dataclass(frozen=True)
class BackProjection(Settings):
    """The texels of the map, projected back onto the rectangle."""


@dataclasses.dataclass(frozen=True)
class RaysRectangle(Settings):
    """Rays to points of the rectangle."""


@dataclasses.dataclass(frozen=True)
class RaysVpls(Settings):
    """A ray to each pixel light of the cluster."""


Visibility = Csm | Pcss | Pcf | Hard | BackProjection | RaysRectangle | RaysVpls
BY_MAPS = (Csm, Pcss, Pcf, Hard)  # kinds that kernels find by one map
WITHOUT_MAPS = (RaysRectangle, RaysVpls)


@dataclasses.dataclass(frozen=True)
class InterleavingSettings(Settings):
    """Each pixel of a block of n x n sums one light of n^2 (Sec. 6)."""

    PRINCIPAL = "block"

    block: int | None = setting(None, "n; 1: every pixel sums all lights; none: subsplats do, to an error",
                                least=1, most=MOST_BLOCK, unit="pixels")
    assignment: Assignment = setting("index", "lights of a pixel: every n^2-th, or runs of a cluster", study=True)


@dataclasses.dataclass(frozen=True)
class BoxBlur(Settings):
    """The mean of all n x n pixels."""

    NAME = "box"


@dataclasses.dataclass(frozen=True)
class GeometryBlur(Settings):
    """The mean of those of n x n pixels that lie on the same surface (Sec. 6)."""

    NAME = "geometry"

    extent: float = setting(0.1, "how far apart, as a share of the scene's diagonal", least=0.0, most=10.0)
    cosine: float = setting(0.8, "least cosine between normals", least=-1.0, most=1.0)
    every_subset: bool = setting(True, "lights that the window misses count by the nearest pixels of the surface that "
                                       "sum them, up to n away")


@dataclasses.dataclass(frozen=True)
class ValSettings(Settings):
    """What `val` can be set to; the defaults are the paper's, those of docs/methods/val where it is silent.

    By default subsplats are lit until `subsplats.target` is met, in place of blocks of pixels: every pixel of pictures
    of up to 2^16 of them, unless visibility is by rays, and without a clamp. The clamp "auto" is "disc" where lights
    have footprints.
    """

    lights: LightSettings = setting(LightSettings(count=1024), "pixel lights")
    pairs: PairSettings = setting(PairSettings(), "how one light lights one receiver")
    clusters: Clusters = setting(Clusters(), "how many area lights")
    area: AreaLightSettings = setting(AreaLightSettings(), "the rectangle of an area light")
    maps: ShadowMapSettings = setting(ShadowMapSettings(), "shadow maps")
    visibility: Visibility | None = setting(Csm(), "soft shadow of an area light; none: no shadows")
    subsplats: ErrorTarget = setting(ErrorTarget(coarsest=32), "what is evaluated, without interleaving.block")
    interleaving: InterleavingSettings = setting(InterleavingSettings(), "interleaved sampling")
    blur: BoxBlur | GeometryBlur | None = setting(GeometryBlur(), "what joins interleaved pixels")
    as_published: frozenset[str] = setting(frozenset(), "forms to use as printed", study=True)

    SWITCHES: ClassVar[frozenset[str]] = PRINTED

    def check(self) -> None:
        """Check what parts ask of each other."""
        expect_footprints(self.lights, self.pairs)

    @property
    def drawn_maps(self) -> ShadowMapSettings:
        """The settings of maps with the `near_distance` of the kind of shadow where none is given."""
        if self.maps.near_distance is not None or self.visibility is None:
            return self.maps
        near = NEAR_DISTANCE.get(self.visibility.name(), self.maps.near_share)
        return dataclasses.replace(self.maps, near_distance=near)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return (self.lights.traces_rays or self.maps.renderer == "rays" or self.maps.behind == "raytrace"
                or isinstance(self.visibility, RaysRectangle | RaysVpls))

    @property
    def effective_pairs(self) -> PairSettings:
        """The pairs in use: the clamp "auto" is "disc", and none where lights have no footprints."""
        return clamped_pairs(self.lights, self.pairs)


@dataclasses.dataclass(frozen=True)
class ClusteredShadows(Settings):
    """Shadows of clusters of pixel lights, for methods that sum the lights in their own way."""

    NAME = "val"

    clusters: Clusters = setting(Clusters(), "how many area lights")
    area: AreaLightSettings = setting(AreaLightSettings(), "the rectangle of an area light", study=True)
    maps: ShadowMapSettings = setting(ShadowMapSettings(), "shadow maps")
    shadow: Visibility = setting(Csm(), "soft shadow of an area light, the `visibility` of val")
    as_published: frozenset[str] = setting(frozenset(), "forms to use as printed", study=True)

    SWITCHES: ClassVar[frozenset[str]] = PRINTED

    def of_lights(self, lights: LightSettings, pairs: PairSettings) -> ValSettings:
        """Return the settings of `val` that sum some lights under these shadows, every light at every receiver."""
        return ValSettings(lights, pairs, self.clusters, self.area, self.maps, self.shadow,
                           interleaving=InterleavingSettings(1), blur=None, as_published=self.as_published)


# Sec. 5.1, 6 and 7: d in metres and radians, basis of 8 and 16 bits, blocks of 8 x 8 pixels, angles as printed
PRESETS: Mapping[str, ValSettings] = {
    "paper": ValSettings(
        pairs=PairSettings(clamp=None), clusters=Clusters(distance="raw"),
        visibility=Csm(terms=4, quantisation="published"), interleaving=InterleavingSettings(8),
        blur=GeometryBlur(every_subset=False), as_published=PRINTED),
}
