"""Pixel lights with ray-traced visibility: what every method of pixel lights converges to.

E(x) = sum_i Phi_i / pi <n_i.w> <n_x.-w> / r^2 V(x, x_i), and the same with a lobe (papers' Eq. 2 and 3, calibrated).
"""

import dataclasses
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.method import Method
from refgi.pairs.shadow_rays import BATCH, receivers, shadowed_sum

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]

MOST_LIGHTS = 1 << 24  # a map: every texel of one of 4096 x 4096
Pattern = Literal["grid", "halton", "all", "random"]


@dataclasses.dataclass(frozen=True)
class VplSettings:
    """Which pixel lights `vpl` uses, as for `sii`, and whether they are shadowed.

    `lights` a shadow map are taken from a `pattern` ("all": every texel, `lights` is not used) with `seed`;
    `filtered` averages the flux over each light's cell. `visibility=False` leaves out the rays. `batch` pairs are
    held at a time, which changes no bit of the result.
    """

    lights: int = 768
    pattern: Pattern = "halton"
    seed: int = 0
    filtered: bool = False
    visibility: bool = True
    batch: int = BATCH

    def __post_init__(self) -> None:
        expect(1 <= self.lights <= MOST_LIGHTS, "lights", f"1 to {MOST_LIGHTS:,} pixel lights", self.lights)
        expect(self.pattern in ("grid", "halton", "all", "random"), "pattern",
               "'grid', 'halton', 'all' or 'random'", self.pattern)
        expect(self.seed >= 0, "seed", "a whole number >= 0", self.seed)
        expect(1 <= self.batch <= 2**30, "batch", f"1 to {2**30:,} pairs", self.batch)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays: without visibility it takes from their tracer how far receivers are moved."""
        return True


def vpl(frame: "Frame", settings: VplSettings | None = None) -> Array:
    """Light every pixel by pixel lights with a shadow ray each.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : VplSettings, optional
        Which lights; the defaults where absent.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance in the frame's dtype, W/m^2, linear RGB. Excludes the receiver's albedo/pi.
    """
    from refgi.lights import choose_pixel_lights

    settings = settings or VplSettings()
    lights = choose_pixel_lights(frame.rsms, count=None if settings.pattern == "all" else settings.lights,
                                 pattern=settings.pattern, seed=settings.seed, filtered=settings.filtered)
    buffer = frame.gbuffer
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, frame.tracer.grain)
    irradiance = np.zeros((3, frame.height, frame.width), frame.dtype)
    irradiance.reshape(3, -1)[:, to.pixel] = shadowed_sum(frame.tracer, to, lights, visibility=settings.visibility,
                                                           batch=settings.batch)
    return irradiance


METHOD = Method("vpl", "the same pixel lights with ray-traced visibility", vpl, VplSettings, visibility=True)
