"""What the figures of one run share: sizes, frames that stay warm, errors, and pictures of light."""

import colorsys
import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from benchmarks.papers.records import Picture
from refgi.compare import pictures as maps
from refgi.compare.metrics import mae, rmse
from refgi.compare.pages import number
from refgi.compare.pictures import linear_planes, rgb_planes
from refgi.frame import Frame
from refgi.image import tone_map
from refgi.scene import Scene, load_scene
from refgi.stages import Memory
from refgi.truth import TruthResult, TruthSettings, trace_truth
from refgi.types import Array

T = TypeVar("T")

SMALLEST = 8  # pixels along a side, however small a run is
GOLDEN = 0.6180339887498949  # turns between neighbouring colours


@dataclasses.dataclass(frozen=True)
class Scale:
    """How large and how often."""

    name: str
    size: int  # pixels along a side of every picture
    rsm_resolution: int  # texels along a side of every shadow map
    repeats: int  # timed rounds
    truth_samples: int  # of path tracing, a pixel
    photons: int  # of caustics, a pass


FULL = Scale("full", 512, 256, 7, 192, 1 << 20)
QUICK = Scale("quick", 256, 128, 3, 48, 1 << 18)


class Workbench:
    """Gives every figure the same frames, so that buffers are computed once and never timed."""

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self._made: dict[Any, Any] = {}

    @property
    def few(self) -> int:
        """Rounds of work that takes long."""
        return max(1, self.scale.repeats // 2)

    def frame(self, name: str, **options: Any) -> Frame:
        """Return a frame of a built-in scene with this run's sizes; its buffers stay once they are computed."""
        return Subjects({}).frame_of(self, name, **options)

    def once(self, key: Any, make: Callable[[], T]) -> T:
        """Return what was made under this key before, or make it."""
        if key not in self._made:
            self._made[key] = make()
        found: T = self._made[key]
        return found

    def traced(self, frame: Frame, **changes: Any) -> TruthResult:
        """Return one bounce by path tracing; `changes` are settings of truth."""
        settings = TruthSettings(**({"samples": self.scale.truth_samples} | changes))
        return self.once(("traced", frame, settings), lambda: trace_truth(frame, settings))


class Subjects(NamedTuple):
    """The stand-ins of one paper; a name that is not theirs is one that `load_scene` takes."""

    builders: Mapping[str, Callable[[], Scene]]

    def scene_of(self, bench: Workbench, name: str) -> Scene:
        """Return a stand-in or a built-in scene."""
        build = self.builders.get(name, lambda: load_scene(name))
        return bench.once(("scene", self.builders.get(name, name)), build)

    def frame_of(self, bench: Workbench, name: str, factor: float = 1, **options: Any) -> Frame:
        """Return a frame of a scene, as `seen_by` makes it; its buffers stay once they are computed."""
        scene = self.scene_of(bench, name)
        return bench.once(("frame", name, factor, *sorted(options.items())),
                          lambda: seen_by(bench, scene, factor, **options))


def seen_by(bench: Workbench, scene: Scene, factor: float = 1, *, wide: float = 1, **options: Any) -> Frame:
    """Return a fresh frame, `factor` times as high as the run's pictures and `wide` times as wide as high."""
    height = factor * bench.scale.size
    usual = {"width": max(SMALLEST, round(wide * height)), "height": max(SMALLEST, round(height)),
             "rsm_resolution": bench.scale.rsm_resolution}
    return Frame(scene, **(usual | options))


def whole_frame(bench: Workbench, method: Callable[[Frame, Any], Array], scene: Scene, settings: Any,
                factor: float = 1, **options: Any) -> Array:
    """Draw a frame from the scene on, shadow map, buffers, direct and indirect light; nothing is kept between calls."""
    frame = seen_by(bench, scene, factor, **options)
    return frame.radiance(method(frame, settings))


class Redrawing(Memory):
    """Keeps what the papers keep in textures between frames, and draws splats in every frame."""

    def recall(self, name: str, inputs: tuple[Any, ...]) -> tuple[bool, Any]:
        """Return whether a result for these inputs is kept, and the result; of splats none is."""
        return (False, None) if name.startswith(("sii.", "multires.", "pairs.")) else super().recall(name, inputs)


class Errors(NamedTuple):
    """How far a picture is off, in per cent of the reference's mean irradiance."""

    rmse: float
    mae: float
    lost: float  # how much darker it is in all; negative: brighter


def errors_of(image: Array, reference: Array, covered: Array) -> Errors:
    """Judge irradiance (3, h, w) over the pixels of `covered`; all nan where the reference is black."""
    mean = mean_of(reference, covered)
    if mean <= 0:
        return Errors(np.nan, np.nan, np.nan)
    lost = 1 - mean_of(image, covered) / mean
    return Errors(100 * rmse(image, reference, covered) / mean, 100 * mae(image, reference, covered) / mean, 100 * lost)


def mean_of(light: Array, covered: Array) -> float:
    """Return the mean over all channels of the pixels with a surface; 0 where nothing is seen."""
    return float(light[:, covered].mean(dtype=np.float64)) if covered.any() else 0.0


def changes(pictures: list[Array], covered: list[Array], mean: float) -> float:
    """Return how far pictures change from frame to frame.

    Mean magnitude over pixels with a surface in both frames and over frames, % of `mean`.
    """
    jumps = [np.abs(after - before)[:, here & there].mean(dtype=np.float64)
             for before, after, here, there in zip(pictures, pictures[1:], covered, covered[1:], strict=False)]
    return 100 * float(np.mean(jumps)) / mean if jumps and mean > 0 else 0.0


class Gallery:
    """Gathers pictures of one frame; those of irradiance alone have one exposure, at which `bright` just fits.

    Of a figure with several frames, each with a gallery of its own, the pictures go into one list, `shown`.
    """

    def __init__(self, frame: Frame, bright: Array | None = None, shown: list[Picture] | None = None) -> None:
        self.frame, self.covered = frame, frame.gbuffer.covered
        self.exposure = 1.0 if bright is None else maps.indirect_exposure(bright, self.covered)
        self.pictures: list[Picture] = [] if shown is None else shown

    def camera(self, name: str, title: str, said: str, irradiance: Array, settings: Any = None) -> None:
        """Add what the camera receives: direct light and this indirect light."""
        radiance = self.frame.radiance(np.asarray(irradiance, self.frame.dtype))
        pixels = tone_map(np.moveaxis(radiance, 0, -1), self.frame.scene.exposure)
        self.pictures.append(Picture(name, title, said, pixels, linear_planes(radiance, irradiance), settings))

    def indirect(self, name: str, title: str, said: str, irradiance: Array, settings: Any = None) -> None:
        """Add irradiance as on white surfaces."""
        pixels = tone_map(np.moveaxis(irradiance, 0, -1), self.exposure)
        self.pictures.append(Picture(name, title, said, pixels, rgb_planes("irradiance.", irradiance), settings))

    def mapped(self, name: str, title: str, said: str, values: Array, scale: maps.Scale) -> None:
        """Add one number a pixel in a scale's colours; the picture's one plane, Y, holds the numbers."""
        self.pictures.append(mapped(name, title, said, values, self.covered, scale))

    def errors(self, titled: Mapping[str, tuple[str, Array]], reference: Array) -> None:
        """Add signed luminance errors against one reference, all on one scale, of titles and irradiance by name."""
        right = maps.luminance(reference)
        signed = {name: maps.luminance(irradiance) - right for name, (_, irradiance) in titled.items()}
        scale = maps.error_scale(list(signed.values()), self.covered)
        said = f"red too bright, blue too dark, full colour at {number(scale.high)} W/m²"
        for name, values in signed.items():
            self.mapped(f"{name}_error", f"error of {titled[name][0]}", said, values, scale)


def mapped(name: str, title: str, said: str, values: Array, covered: Array, scale: maps.Scale) -> Picture:
    """Return one number a pixel in a scale's colours; the picture's one plane, Y, holds the numbers."""
    return Picture(name, title, said, maps.paint(values, covered, scale), {"Y": values})


def palette(count: int) -> Array:
    """Return display colours (count, 3), 0 to 1, that neighbours in number do not share."""
    return np.array([colorsys.hsv_to_rgb(k * GOLDEN % 1, (0.9, 0.6)[k % 2], (1.0, 0.8)[k // 2 % 2])
                     for k in range(count)]).reshape(-1, 3)
