"""Gathering from the reflective shadow map (Dachsbacher and Stamminger 2005), the baseline of SII Fig. 12.

Each pixel looks at texels in a disc around its own place in the map. With `grid` the sum runs at a coarse grid of
pixels first; a pixel whose coarse neighbours agree with it in place and normal takes their interpolated light, every
other pixel runs the sum itself.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_loss
from refgi.scene.values import LARGEST
from refgi.splat.gather.gather_sum import GatherMap, centers, disc_loss, disc_pattern, gather_discs
from refgi.splat.gather.interpolation import Agreement, coarse_pixels, interpolate
from refgi.stages import skip, stage

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.rsm import Rsm

Array = npt.NDArray[Any]

WIDEST = 1000.0  # map widths; any disc past sqrt 2 covers the whole map


@dataclasses.dataclass(frozen=True)
class GatherSettings:
    """What `gather` can be set to; the defaults are the papers' (308 samples, 64^2 sub-sampling, SII Fig. 12).

    `samples` texels in a disc of `radius` map widths (over sqrt 2: the whole map), the same for all pixels, shifted
    by `seed` (0: not). `grid` coarse pixels along each side (0: every pixel runs the sum). Coarse pixels agree with
    a pixel up to `least_cosine` between normals and a distance of `reach` times the scene's diagonal. `offset` moves
    texels back along their normals (m). `as_published={"rsm_weight_squared"}` weighs samples by xi_1^2.
    """

    samples: int = 308
    radius: float = 0.3
    seed: int = 0
    grid: int = 64
    least_cosine: float = 0.9
    reach: float = 0.05
    offset: float = 0.0
    as_published: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        expect(1 <= self.samples <= 1 << 28, "samples", f"1 to {1 << 28:,}", self.samples)
        expect(0 < self.radius <= WIDEST, "radius", f"a share of the map above 0, up to {WIDEST}", self.radius)
        expect(self.seed >= 0, "seed", "a whole number >= 0", self.seed)
        expect(self.grid >= 0, "grid", "coarse pixels along a side, or 0", self.grid)
        expect(-1 <= self.least_cosine <= 1, "least_cosine", "-1 to 1", self.least_cosine)
        expect(self.reach >= 0, "reach", "a share of the scene's diagonal >= 0", self.reach)
        expect(abs(self.offset) <= LARGEST, "offset", f"a length up to {LARGEST:g} m", self.offset)
        object.__setattr__(self, "as_published", frozenset(self.as_published))
        expect(self.as_published <= {"rsm_weight_squared"}, "as_published", "names out of ['rsm_weight_squared']",
               sorted(self.as_published))


class Gathered(NamedTuple):
    """Light by gathering, and what it took."""

    irradiance: Array  # (3, h, w) W/m^2
    evaluated: int  # pixels that ran the sum
    covered: int  # pixels with a surface


def gather(frame: "Frame", settings: GatherSettings) -> Array:
    """Light every pixel by texels around its place in the reflective shadow maps.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : GatherSettings
        Disc, samples and interpolation.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility.
    """
    light = gather_counted(frame, settings).irradiance
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    warn_of_loss(disc_loss(receivers, frame.rsms, settings.radius, settings.offset),
                 f"gather: radius {settings.radius:g} of a map's width")
    return light


def gather_counted(frame: "Frame", settings: GatherSettings) -> Gathered:
    """Light every pixel as `gather` does and count the pixels that ran the sum.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : GatherSettings
        Disc, samples and interpolation.

    Returns
    -------
    Gathered
        Irradiance and counts.
    """
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    covered = int(np.count_nonzero(buffer.covered))
    if settings.grid == 0 or settings.grid >= max(frame.height, frame.width):
        skip("gather.interpolate", "every pixel runs the sum")
        return Gathered(gather_irradiance(receivers, frame.rsms, settings), covered, covered)
    coarse = coarse_pixels(frame.height, frame.width, settings.grid)
    first = np.zeros_like(buffer.covered)
    first[np.ix_(*coarse)] = True
    known = gather_irradiance(receivers._replace(covered=buffer.covered & first), frame.rsms, settings)
    agreement = Agreement(settings.least_cosine, settings.reach * frame.seen_extent.diagonal)
    smooth, done = interpolate(receivers, known, coarse, agreement)
    rest = receivers._replace(covered=buffer.covered & ~done)
    total = smooth + gather_irradiance(rest, frame.rsms, settings)
    evaluated = np.count_nonzero(buffer.covered & first) + np.count_nonzero(rest.covered & ~first)
    return Gathered(total, int(evaluated), covered)


@stage("gather.irradiance")
def gather_irradiance(receivers: Receivers, rsms: "Sequence[Rsm]", settings: GatherSettings) -> Array:
    """Sum the irradiance of the texels in each receiver's disc.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit.
    rsms : sequence of Rsm
        Reflective shadow maps, one a light; of glossy materials only the diffuse part is gathered.
    settings : GatherSettings
        Disc and samples.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB; 0 where there is no surface. Excludes the receiver's albedo/pi.

    Notes
    -----
    E = (2 pi r_max^2 T / S) sum xi_1 E_t with T the texels of one map and E_t the light of one texel (Eq. 2), which
    has the mean of the full sum over the disc. The papers scale by hand. A receiver outside the map looks from the
    nearest place on its border. Maps of several faces are one sheet: a disc runs on into the next face's rows.
    """
    position, normal, covered = receivers
    result = np.zeros_like(position)
    places = np.flatnonzero(covered)
    points, normals = (np.take(part.reshape(3, -1), places, axis=1) for part in (position, normal))
    total = np.zeros_like(points)
    for rsm in rsms:
        _gather_one(points, normals, rsm, settings, total)
    result.reshape(3, -1)[:, places] = total
    return result


def _gather_one(points: Array, normals: Array, rsm: "Rsm", settings: GatherSettings, total: Array) -> None:
    if rsm.lobe_flux is not None:
        skip("gather.lobes", "gathering takes the diffuse part alone")
    dtype = points.dtype
    height, width = rsm.projection.height, rsm.projection.width  # of one map
    pattern = disc_pattern(settings.samples, settings.seed, "rsm_weight_squared" in settings.as_published)
    scale = settings.radius**2 * height * width / (math.pi * settings.samples)
    pattern *= (settings.radius * height, settings.radius * width, 1.0)
    texels = (rsm.position - settings.offset * rsm.normal, rsm.normal, rsm.flux)
    source = GatherMap(*(np.ascontiguousarray(part, dtype) for part in texels))
    gather_discs(points, normals, centers(rsm, points), source, pattern, dtype.type(scale), total)
