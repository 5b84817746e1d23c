"""What clustered visibility can be set to."""

import dataclasses
from typing import ClassVar, Literal

import numpy as np

from refgi.errors import expect
from refgi.lights.settings import MOST_LIGHTS, LightSettings, MapLights, expect_footprints
from refgi.pairs.settings import PairSettings
from refgi.scene.values import is_count, is_number
from refgi.settings import Settings, setting

Distance = Literal["raw", "normalised", "squared"]
Axes = Literal["fixed", "pca", "min_area"]
Extent = Literal["root", "longer", "shorter"]
Visibility = Literal["hard", "pcf", "pcss", "csm", "back_projection", "rays_rectangle", "rays_vpls", "none"]
Prefilter = Literal["mip", "brute"]
Rescale = Literal["none", "scale2", "plateau"]
Behind = Literal["visible", "dual_paraboloid", "raytrace"]
NearGeometry = Literal["keep", "planes", "ball"]
Assignment = Literal["index", "cluster"]
Blur = Literal["none", "box", "geometry"]
Depths = Literal["log_map", "map", "scene"]

PUBLISHED_AREA_LIGHTS = 30
MOST_TERMS = 64
MOST_BLOCK = 64  # pixels
LARGEST_MAP = 4096  # texels
# least and most of each number
COUNTS = (("area_lights", 1, MOST_LIGHTS), ("rounds", 1, 1000), ("map_resolution", 1, LARGEST_MAP), ("texels", 1, 255),
          ("terms", 1, MOST_TERMS))
FLAGS = ("unbiased_area", "foreshortened", "occluders_alone", "receiver_plane", "cone")
# least and most of each number that may have a fraction, and what it is; the least target is about what rays for a
# thousand pixels can tell
CONSTANTS = {
    "position_weight": (0.0, 1e6, "a weight"), "normal_weight": (0.0, 1e6, "a weight"),
    "target_error": (1e-4, 1e6, "a share of the mean"),
    "near_distance": (0.0, 100.0, "a share of the cluster's radius"), "bias": (0.0, 0.25, "a share of the depth range"),
    "attenuation": (0.0, 100.0, "a factor"),
    "blur_extent": (0.0, 10.0, "a share of the diagonal"), "blur_cosine": (-1.0, 1.0, "a cosine")}
MAY_BE_NONE = frozenset({"target_error", "bias"})


@dataclasses.dataclass(frozen=True)
class ValSettings(Settings):
    """What `val` can be set to; the defaults are the paper's, those of docs/methods/val where it is silent.

    Clustering: `area_lights` clusters by a `distance` ("raw" as printed, "normalised" by the scene's diagonal and pi,
    or "squared") of weights `position_weight` and `normal_weight`, for at most `rounds` rounds. `target_error` (share
    of the mean, RMSE) adds area lights until the error of visibility is estimated to be below it.

    Area lights: rectangles along `axes`; one `extent` of it is the paper's Delta. `unbiased_area` enlarges it by what
    a sample of n lights misses, `foreshortened` narrows it towards the receiver, `single_light` is what a cluster of
    one light is. Maps of `map_resolution` texels a side from `maps` ("raster" or "rays") leave out what is near the
    centre, `near_geometry` (a "ball", or "planes" that pass there) within a share `near_distance` of the cluster's
    radius, and with `occluders_alone` what nothing lies behind. `behind` says what receivers behind an area light see
    of it.

    Visibility: convolution shadow maps ("csm") of `terms` terms with the filter `prefilter`; percentage closer soft
    shadows ("pcss"); percentage closer filtering ("pcf") of `texels` x `texels` depth tests; one "hard" test; by
    reference, the map projected back ("back_projection"), "rays_rectangle" or "rays_vpls"; or "none". CSM compares
    depths on a `depth_scale` from the nearest to the farthest of what a map holds, by their logarithm ("log_map") or in
    metres ("map"), or from 0 to the far end of the scene's extent ("scene"). A receiver is moved by `bias` (share of
    the depth range; none: where the series is 1 for the first time); `attenuation` is that of the series' terms and
    `rescale` what becomes of it; `quantisation` is that of the published textures. PCSS counts what lies before the
    `receiver_plane` and within the `cone`.

    `interleaving` n sums one light of n^2 at each pixel of n x n (8 as published; 1: all; none: all where that is no
    more than 2^30 pairs, else 8), and `blur` joins them, within `blur_extent` of the scene's diagonal and above
    `blur_cosine` between normals.
    """

    lights: LightSettings = setting(LightSettings(count=1024), "pixel lights")
    pairs: PairSettings = setting(PairSettings(), "how one light lights one receiver")
    area_lights: int = PUBLISHED_AREA_LIGHTS
    target_error: float | None = None
    distance: Distance = "normalised"
    position_weight: float = 0.7
    normal_weight: float = 0.3
    rounds: int = 50
    axes: Axes = "fixed"
    extent: Extent = "root"
    unbiased_area: bool = False
    foreshortened: bool = False
    single_light: Literal["point", "footprint"] = "point"
    map_resolution: int = 256
    maps: Literal["raster", "rays"] = "raster"
    near_geometry: NearGeometry = "ball"
    near_distance: float = 0.6
    occluders_alone: bool = True
    behind: Behind = "visible"
    visibility: Visibility = "csm"
    texels: int = 5
    terms: int = 4
    depth_scale: Depths = "log_map"
    prefilter: Prefilter = "mip"
    bias: float | None = None
    attenuation: float = 0.0
    rescale: Rescale = "none"
    quantisation: Literal["none", "published"] = "none"
    receiver_plane: bool = True
    cone: bool = True
    interleaving: int | None = None
    assignment: Assignment = "index"
    blur: Blur = "geometry"
    blur_extent: float = 0.1
    blur_cosine: float = 0.8
    as_published: frozenset[str] = setting(frozenset(), "forms to use as printed", study=True)

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"val_alpha", "val_alpha_over_pi", "val_search_solid_angle"})

    def check(self) -> None:
        """Check ranges, and what fields ask of each other."""
        for key, least, most in COUNTS:
            count = getattr(self, key)
            expect(is_count(count) and least <= count <= most, key, f"a whole number, {least} to {most:,}", count)
        expect_footprints(self.lights, self.pairs)
        for key in FLAGS:
            expect(isinstance(getattr(self, key), bool | np.bool_), key, "true or false", getattr(self, key))
        for key, (low, high, what) in CONSTANTS.items():
            value = getattr(self, key)
            expect((value is None and key in MAY_BE_NONE) or (is_number(value) and low <= value <= high), key,
                   f"{'none or ' if key in MAY_BE_NONE else ''}{what}, {low:g} to {high:g}", value)
        expect(self.position_weight + self.normal_weight > 0, "position_weight",
               "more than 0 beside a normal_weight of 0", self.position_weight)
        expect(self.interleaving is None or (is_count(self.interleaving) and 1 <= self.interleaving <= MOST_BLOCK),
               "interleaving", f"none or 1 to {MOST_BLOCK} pixels", self.interleaving)
        expect(self.texels % 2 == 1, "texels", "an odd number", self.texels)
        expect(self.single_light == "point" or isinstance(self.lights.source, MapLights), "single_light",
               "'point' with the source 'walk'", self.single_light)
        self._expect_heeded()

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return self.lights.traces_rays or self.maps == "rays" or self.behind == "raytrace" or self.visibility in (
            "rays_rectangle", "rays_vpls")

    def _expect_heeded(self) -> None:
        """Refuse what a target for the error would not heed."""
        if self.target_error is not None:
            expect(self.area_lights == PUBLISHED_AREA_LIGHTS, "area_lights",
                   "no number beside target_error, which finds it", self.area_lights)
            expect(self.visibility != "none", "visibility", "another one with target_error", self.visibility)
