"""Error of each approximation: pictures from exact shadows to the published method, one step apart (Sec. 7, Fig. 10).

Each picture takes one approximation more than the one before it, all with the same pixel lights and clusters:

- lights: as many pixel lights as asked for, a ray each, for all the light there is; what sampling costs,
- rays_vpls: V of an area light is the share of its lights that rays reach; clustering,
- rays_rectangle: rays to the bounding rectangle instead, past what lies too near; the shape of the light,
- back_projection: one paraboloid map from the centre instead of rays; what one view and its texels miss,
- pcss: one mean depth of blockers and one disc of the map around the receiver; single blocker and kernel,
- csm: M terms for the step, over the same discs; the series,
- mip: levels of a pyramid for discs; prefilter,
- interleaved: one light of n^2 at each pixel, and the blur.

The whole error is the sum of the steps. Were they independent, its root mean square would be the root of the sum of
their squares. The last step is not: the blur removes much of what the first one adds, peaks beside pixel lights.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights, map_frames
from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.reference.vpls import vpl_visibility
from refgi.cluster.settings import (
    BackProjection,
    Csm,
    GeometryBlur,
    Pcss,
    RaysRectangle,
    RaysVpls,
    ValSettings,
    Visibility,
)
from refgi.cluster.val import PUBLISHED_BLOCK, cluster_lights, face_normals, light_pixels, receivers_of
from refgi.errors import expect
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

STEPS = ("rays_vpls", "rays_rectangle", "back_projection", "pcss", "csm", "mip")


class Step(NamedTuple):
    """What one approximation changes, as shares of the mean of the first picture."""

    name: str
    rmse: float  # against the picture before
    shift: float  # of the mean
    so_far: float  # rmse against the first picture


class ErrorSplit(NamedTuple):
    """The steps of one scene, and the pictures between them."""

    steps: tuple[Step, ...]
    pictures: dict[str, Array]  # (3, h, w) W/m^2; those of the steps, after the one that they start from
    covered: Array  # (h, w) bool: pixels that count

    def together(self, first: str, last: str) -> tuple[float, float]:
        """Return the error of several steps, and what it would be if they were independent.

        Parameters
        ----------
        first, last : str
            Names of the first and the last of them.

        Returns
        -------
        rmse, root_of_squares : float
            As shares of the mean of the first picture of all.
        """
        names = list(self.pictures)
        begin, end = names.index(first) - 1, names.index(last)
        covered = self.covered
        change = (self.pictures[last] - self.pictures[names[begin]])[:, covered].astype(np.float64)
        mean = float(self.pictures[names[0]][:, covered].astype(np.float64).mean())
        return _rms(change) / mean, math.sqrt(sum(step.rmse**2 for step in self.steps[begin:end]))

    @property
    def whole(self) -> float:
        """Rmse of the last picture against the first."""
        return self.steps[-1].so_far

    @property
    def root_of_squares(self) -> float:
        """What `whole` would be if the steps were independent."""
        return math.sqrt(sum(step.rmse**2 for step in self.steps))


def split_error(
    frame: "Frame", settings: ValSettings, truth: Array | None = None, block: int = PUBLISHED_BLOCK
) -> ErrorSplit:
    """Render a scene with one approximation after the other and measure each.

    Parameters
    ----------
    frame : Frame
        The scene with its buffers.
    settings : ValSettings
        The method's; `visibility` and `interleaving` are the steps', with the series of `Csm` where it is chosen.
    truth : (3, h, w) ndarray, optional
        One-bounce irradiance, W/m^2, from which the first step starts; without, steps start from exact shadows.
    block : int
        Side of the blocks of the interleaved picture, pixels.

    Returns
    -------
    ErrorSplit
        At pixels with a surface, over the three channels.

    Raises
    ------
    InputError
        If the first picture has no light to be a share of.
    """
    settings = with_clamp(settings)
    lights = choose_lights(frame, settings.lights)
    csm = dataclasses.replace(settings.visibility, prefilter="mip") if isinstance(settings.visibility, Csm) else Csm()
    base = dataclasses.replace(settings, visibility=csm)
    base = dataclasses.replace(base, maps=base.drawn_maps)  # one for all kinds: a step changes nothing else
    areas, maps = cluster_lights(frame, lights, base)
    pictures = {} if truth is None else {"truth": truth}
    kinds: dict[str, Visibility] = {
        "rays_vpls": RaysVpls(), "rays_rectangle": RaysRectangle(), "back_projection": BackProjection(),
        "pcss": Pcss(), "csm": dataclasses.replace(csm, prefilter="brute"), "mip": csm}
    pictures["lights"] = exact_shadows(frame, lights, base)
    for name in STEPS:
        pictures[name] = light_pixels(frame, lights, areas, maps, dataclasses.replace(base, visibility=kinds[name]), 1)
    interleaved, receivers = light_pixels(frame, lights, areas, maps, base, block), receivers_of(frame)
    pictures["interleaved"] = blur(interleaved, receivers, block, base.blur or GeometryBlur(),
                                   frame.visible_extent.diagonal)
    covered = np.asarray(receivers.covered, np.bool_)
    return ErrorSplit(steps_between(pictures, covered), pictures, covered)


def steps_between(pictures: dict[str, Array], covered: Array) -> tuple[Step, ...]:
    """Measure a sequence of pictures.

    Parameters
    ----------
    pictures : dict of str to (3, h, w) ndarray
        Names of the steps after the first and what they lead to.
    covered : (h, w) ndarray of bool
        Pixels that count.

    Returns
    -------
    tuple of Step
        One for each picture but the first.

    Raises
    ------
    InputError
        If the first picture is black.
    """
    names = list(pictures)
    values = [pictures[name][:, covered].astype(np.float64) for name in names]
    mean = float(values[0].mean()) if values[0].size else 0.0
    expect(mean > 0, names[0], "a picture with light", "black")
    return tuple(
        Step(name, _rms(value - before) / mean, float((value - before).mean()) / mean, _rms(value - values[0]) / mean)
        for name, before, value in zip(names[1:], values[:-1], values[1:], strict=True))


def exact_shadows(frame: "Frame", lights: "PixelLights", settings: ValSettings) -> Array:
    """Light every pixel by all lights with a shadow ray each: an area light for each of them, of one member.

    Parameters
    ----------
    frame : Frame
        The scene, receivers.
    lights : PixelLights
        N lights.
    settings : ValSettings
        How one light lights one receiver.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2: that of the method `vpl` for the same lights, where nothing is clamped.
    """
    count = lights.flux.shape[1]
    position, normal = (np.asarray(part, np.float64) for part in (lights.position, lights.normal))
    frames, none = map_frames(normal), np.zeros((2, count))
    single = AreaLights(position, normal, frames, none, frames[:, :2], none, none[0], none[0], np.ones(count, np.int64),
                        np.arange(count, dtype=np.int32))
    return clustered_irradiance(receivers_of(frame), face_normals(frame), lights, single, None, settings,
                                footprint=footprints(frame, settings.lights, settings.pairs),
                                visibility_of=vpl_visibility(frame, lights, single))


def _rms(values: Array) -> float:
    return math.sqrt(float((values**2).mean()))
