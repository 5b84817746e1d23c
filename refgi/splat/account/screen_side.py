"""What pixel lights send to the visible surface: sums over pixels of irradiance times the area that a pixel sees."""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.lights.selection import footprints
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.splat.account.pixel_area import pixel_areas
from refgi.splat.sii import sii
from refgi.splat.splat import cut_irradiance

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.splat.sii import SiiSettings

Array = npt.NDArray[Any]

PRINTED_WIDENINGS = frozenset({"sii_widening", "sii_widening_unnorm"})


class ScreenSide(NamedTuple):
    """Flux at the visible surface, (3,) float64 each, W."""

    full: Array  # from the front, within any range, without clamp and with the calibrated widening
    behind: Array  # the same on the other side of every visible surface
    arrived: Array  # in the picture
    interpolated: Array  # lost between pixels that are lit and those that are interpolated
    cut: Array  # of pairs that the range leaves out
    clamped: Array  # taken by the clamp
    printed: Array  # taken by a widening as printed


def screen_side(frame: "Frame", lights: "PixelLights", settings: "SiiSettings") -> ScreenSide:
    """Sum what arrives on the visible surface, and by each thing that keeps light from it.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    lights : PixelLights
        As `sii` has them.
    settings : SiiSettings
        As given to `sii`.

    Returns
    -------
    ScreenSide
        Each line from sums of its own; what a setting has no part in is 0 and costs no sum.
    """
    screen = _Screen(frame, lights, settings)
    full, none = screen.pairs(), np.zeros(3)
    printed, clamped, interpolated = none, none, none
    if settings.widening > 0 and settings.as_published & PRINTED_WIDENINGS:
        printed = full - screen.pairs(widening=True)
    if settings.effective_clamp != "none":
        clamped = screen.pairs(widening=True) - screen.pairs(widening=True, clamp=True)
    arrived = screen.picture()
    if settings.half_resolution:
        interpolated = screen.picture(half_resolution=False) - arrived
    cut = screen.cut() if settings.cuts else none
    return ScreenSide(full, screen.pairs(turned=True), arrived, interpolated, cut, clamped, printed)


class _Screen:
    """The pixels of one picture, and sums over them."""

    def __init__(self, frame: "Frame", lights: "PixelLights", settings: "SiiSettings") -> None:
        self.frame, self.lights, self.settings = frame, lights, settings
        self.receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        self.area = pixel_areas(frame.gbuffer, frame.scene.geometry)
        self.footprint = footprints(frame, settings)

    def pairs(self, *, turned: bool = False, clamp: bool = False, widening: bool = False) -> Array:
        """Sum all pairs within any range: with receivers turned round, with the clamp, with widenings as printed."""
        settings = dataclasses.replace(
            self.settings, clamp=self.settings.clamp if clamp else "none",
            as_published=self.settings.as_published - (frozenset() if widening else PRINTED_WIDENINGS))
        receivers = self.receivers._replace(normal=-self.receivers.normal) if turned else self.receivers
        return self._flux(irradiance(receivers, self.lights, settings, self.footprint))

    def picture(self, **changes: Any) -> Array:
        """Sum the picture, or what it would be with other settings."""
        return self._flux(sii(self.frame, dataclasses.replace(self.settings, **changes)))

    def cut(self) -> Array:
        """Sum what the range leaves out, and what a mesh that does not enclose it leaves out besides."""
        cut = self._flux(cut_irradiance(self.receivers, self.lights, self.settings, self.footprint))
        if self.settings.bound == "mesh" and not self.settings.inflate:
            cut += self.picture(inflate=True) - self.picture()
        return cut

    def _flux(self, values: Array) -> Array:
        return np.asarray(np.einsum("chw,hw->c", values, self.area, dtype=np.float64))
