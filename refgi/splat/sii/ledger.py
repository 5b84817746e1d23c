r"""Energy ledger of `sii`: an account in watts whose lines sum to what the lights emit (REF-04).

Light, exact (`light_terms`):

    emitted = missed + absorbed + glass + reflected + refracted

Pixel lights. N draws estimate what is handed on (without T/N, `sii_no_tn`, they lose most of it), later bounces of a
walk and openness change it:

    reflected + refracted - sampling - bounced - scaled = sum of Phi_i

What they send. A light sends Phi_i above its surface, but for norms that are not calibrated (K, P as in SII Eq. 3):
with `sii_no_pi` pi Phi_i, with `lobe_norm` "full_lobe" K Phi_i and (1 - K) Phi_i into its own surface, with "none"
2 pi / (P + 1) of both:

    sum of Phi_i = sent + into its own surface + printed

What meets the visible surface, as a sum over pixels: irradiance times A, the area that the pixel sees. With no limit on
range and no clamp that is `full`, and `full` with all receivers turned round is what meets their other terms, because
there is no visibility. What is left of `sent` meets no visible pixel:

    sent = full + (behind - into its own surface) + off_screen

    full = arrived + interpolated + cut + clamped

`arrived` is of the picture itself. `cut` is summed over the pairs that the range leaves out by a kernel of its own,
`full` by another, so the last equation is no definition but a check, as is the first; `Ledger.difference` is what both
are off by. `off_screen` is negative where light is counted on several surfaces one behind the other, and where a pixel
light lies nearer to a surface than a pixel is wide: a sum over pixel centres is no integral there.

All lines say where power went; `sampling`, `bounced`, `scaled`, `printed`, `interpolated`, `clamped` and, with the
stochastic range, `cut` are signed, below 0 where power was added. The cut of the stochastic range has the mean 0.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.lights.selection import choose_lights, light_maps
from refgi.lights.settings import MapLights, PathLights
from refgi.radiometry import lobe_fraction
from refgi.settings import replaced
from refgi.splat.sii.ledger_terms import LightTerms, light_terms, screen_terms
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.splat.sii.settings import SiiSettings

Array = npt.NDArray[Any]


MEANING = {
    "emitted": "by all lights", "missed": "met no surface", "absorbed": "by the first surface",
    "glass": "met glass that did not hand it on", "reflected": "handed on by the first surface",
    "refracted": "handed on by glass", "sampling": "lost by drawing pixel lights",
    "bounced": "sent again by later bounces", "scaled": "removed by openness", "lights": "flux of the pixel lights",
    "printed": "left out by norms as printed", "arrived": "on visible surfaces", "interpolated": "lost between pixels",
    "cut": "out of range", "clamped": "removed by the clamp", "behind": "behind a light's or a visible surface",
    "off_screen": "met no visible surface, less what met several",
}
SUBTOTALS = ("reflected", "refracted", "lights")


class Row(NamedTuple):
    """One row of a ledger as it is shown."""

    name: str
    watts: Array  # (3,)
    meaning: str
    is_part: bool  # of the sum; else the whole, or a subtotal on the way


@dataclasses.dataclass(frozen=True)
class Ledger:
    """The account: (3,) float64 each, W, in the order in which light takes its way; `MEANING` says what each is.

    `emitted` is the whole; `reflected`, `refracted` and `lights` are subtotals on the way; all others are its parts.
    """

    emitted: Array
    missed: Array
    absorbed: Array
    glass: Array
    reflected: Array
    refracted: Array
    sampling: Array
    bounced: Array
    scaled: Array
    lights: Array
    printed: Array
    arrived: Array
    interpolated: Array
    cut: Array
    clamped: Array
    behind: Array
    off_screen: Array

    @property
    def rows(self) -> list[Row]:
        """All rows, in order."""
        return [Row(name, getattr(self, name), meaning, name not in ("emitted", *SUBTOTALS))
                for name, meaning in MEANING.items()]

    @property
    def difference(self) -> Array:
        """`emitted` less the sum of its parts: what the account is off by, (3,) W."""
        return np.asarray(self.emitted - sum(row.watts for row in self.rows if row.is_part))


@stage("sii.ledger")
def energy_ledger(frame: "Frame", settings: "SiiSettings") -> Ledger:
    """Account for the power of the lights under `sii`.

    Parameters
    ----------
    frame : Frame
        The scene and its buffers.
    settings : SiiSettings
        Those of `sii`.

    Returns
    -------
    Ledger
        Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    Takes three to six times as long as the picture. Lines after `sampling` are as good as the sum over pixels is as an
    integral over the visible surface.
    """
    terms = _light_terms(frame, settings)
    first, drawn, lights = _pixel_lights(frame, settings)
    flux = _flux(lights)
    sent, inwards, printed = _sent(lights, settings)
    screen = screen_terms(frame, lights, settings)
    return Ledger(
        *terms[:4], reflected=terms.reflected, refracted=terms.refracted,
        sampling=terms.reflected + terms.refracted - first, bounced=first - drawn, scaled=drawn - flux, lights=flux,
        printed=printed + screen.printed, arrived=screen.arrived, interpolated=screen.interpolated, cut=screen.cut,
        clamped=screen.clamped, behind=inwards + screen.behind, off_screen=sent - screen.full - screen.behind,
    )


def _light_terms(frame: "Frame", settings: "SiiSettings") -> LightTerms:
    """Return the account of all lights together."""
    source = settings.lights.source
    maps = light_maps(frame, source) if isinstance(source, MapLights) else frame.rsms
    terms = [light_terms(rsm, frame.scene.geometry, frame.materials) for rsm in maps]
    return LightTerms(*(sum(line, np.zeros(3)) for line in zip(*terms, strict=True)))


def _pixel_lights(frame: "Frame", settings: "SiiSettings") -> "tuple[Array, Array, PixelLights]":
    """Return the flux of the first bounce and of all bounces before openness, W, and the lights as `sii` has them."""
    lights = choose_lights(frame, settings.lights)
    drawn, whole = _flux(lights), replaced(settings.lights, {"openness.flux": "none"})
    if settings.lights.openness.flux != "none":
        drawn = _flux(choose_lights(frame, whole))
    if not isinstance(settings.lights.source, PathLights) or settings.lights.source.bounces == 1:
        return drawn, drawn, lights
    once = replaced(whole, {"source.bounces": 1})
    return _flux(choose_lights(frame, once)), drawn, lights


def _flux(lights: "PixelLights") -> Array:
    parts = (part for part in (lights.flux, lights.lobe_flux) if part is not None)
    return sum((part.sum(axis=1, dtype=np.float64) for part in parts), np.zeros(3))


def _sent(lights: "PixelLights", settings: "SiiSettings") -> tuple[Array, Array, Array]:
    """Return what lights send above their surface and into it, and what printed norms leave out, W."""
    diffuse = lights.flux.sum(axis=1, dtype=np.float64)
    scale = math.pi if "sii_no_pi" in settings.pairs.as_published else 1.0
    sent, inwards, printed = scale * diffuse, np.zeros(3), (1.0 - scale) * diffuse
    if lights.lobe_flux is not None:
        lobe, whole, above = np.asarray(lights.lobe_flux, np.float64), *_lobe_shares(lights, settings)
        sent += lobe @ above
        inwards += lobe @ (whole - above)
        printed += lobe @ (1.0 - whole)
    return sent, inwards, printed


def _lobe_shares(lights: "PixelLights", settings: "SiiSettings") -> tuple[Array, Array]:
    """Return the integral of each lobe of unit flux over all directions and over those above the surface, (N,)."""
    count = lights.flux.shape[1]
    if settings.pairs.lobe.norm == "clamped" or lights.lobe_axis is None or lights.lobe_exponent is None:
        return np.ones(count), np.ones(count)  # what lies below the surface is never sent
    cosine = np.asarray((lights.normal * lights.lobe_axis).sum(axis=0), np.float64)
    exponent = np.asarray(lights.lobe_exponent, np.float64)
    above = np.array([lobe_fraction(c, p) for c, p in zip(cosine, exponent, strict=True)])
    whole = np.ones(count) if settings.pairs.lobe.norm == "full_lobe" else 2.0 * math.pi / (exponent + 1.0)
    return whole, above * whole
