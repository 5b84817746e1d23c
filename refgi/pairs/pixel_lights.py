"""Pixel lights (VPLs) as arrays, and packed as kernels read them; ranges and the shape of lobes (SII Eq. 3, Sec. 3.3).

A pair counts where B >= xi I_low (SII Sec. 3.4, appendix): B = I(w) / r^2 is the irradiance that the light causes at
most, I_low one irradiance, xi is 1, or drawn for each light by the stochastic range. Packing reverses normals and folds
constants into flux, in float64, rounded once to the dtype of the receivers. Symbols: P exponent, P' the widened one, th
angle between lobe axis and surface normal, a the distance from which on the exponent is whole.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.pairs.lightcuts.tree import LightTree, light_tree
from refgi.pairs.pair_sum import Clamp
from refgi.pairs.settings import DiscClamp, DistanceClamp, GeometryClamp, PairSettings, SphereClamp
from refgi.radiometry import lobe_norm
from refgi.skips import left_out
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    pass


class PixelLights(NamedTuple):
    """N' <= N point lights with a surface normal, in the order they were drawn."""

    position: Array  # (3, N') m, world space
    normal: Array  # (3, N') unit vectors
    flux: Array  # (3, N') W, reflected by the diffuse part, T/N included
    lobe_flux: Array | None  # (3, N') W, reflected by the lobe, T/N included; None: no lobes
    lobe_axis: Array | None  # (3, N') unit vectors
    lobe_exponent: Array | None  # (N',)
    drawn: int  # N: those without flux included
    texel: Array | None = None  # (N',) int32: row * W + column on the stacked maps; None: not from a map
    map_index: Array | None = None  # (N',) int32: which of the maps
    half: Array | None = None  # (N',) bool: of the second half of the draw, a sample like the first; None: no draw

    def recorded(self) -> dict[str, Array | None]:
        """Return what sums read of a light, by name, as logs keep it."""
        return {name: getattr(self, name) for name in self._fields[:6]}

    def selected(self, chosen: Array | slice | list[int]) -> "PixelLights":
        """Return some of the lights, as many drawn."""
        place = np.arange(self.flux.shape[1])[chosen]
        parts: dict[str, Any] = {name: np.take(values, place, axis=-1) for name, values in self._asdict().items()
                                 if isinstance(values, np.ndarray)}
        return self._replace(**parts)

    def with_channels(self, channels: Mapping[str, Any], _: np.dtype[Any]) -> "PixelLights":
        """Return lights with other arrays, by name."""
        return self._replace(**channels)


class Range(NamedTuple):
    """The threshold as kernels read it, for each packed light.

    With s(w) = I(w) / I_0 <= 1 the shape of the light's intensity, B / I_low = square s(w) / r^2.
    """

    square: Array  # (N,) R_0^2 = I_0 / I_low, m^2, of the largest channel; a lobe's I_0 is its flux times norm
    scale: Array  # (N,) xi in (0, 1]: pairs are kept where B >= xi I_low, times max(1, I_low / B); 1 is the plain cut
    outside: bool  # sum what the cut removes instead: each term times 1 less its factor


NO_NORM, FULL_LOBE, CLAMPED = 0, 1, 2  # lobe_norm as a kernel sees it
CORRECTED, LITERAL = 0, 1  # slope of the widened exponent: P min(1, r / a), or min(P, P / (r a)) as printed


class Widening(NamedTuple):
    """How exponents fall near the light."""

    distance: Any  # a, m
    slope: int  # CORRECTED or LITERAL
    norm: int  # the lobe_norm that follows P', or -1: the one of P stays
    cos_theta: Array  # (N,) n . r of each light


@kernel
def lobe_norm_factor(cos_theta: Any, exponent: Any, norm: int) -> Any:
    """Return c(P), the peak intensity of a lobe of unit flux, 1/sr; 0 for a lobe of which nothing leaves the surface.

    NO_NORM: 1 as printed in Eq. 3; FULL_LOBE: (P + 1) / 2 pi; CLAMPED: (P + 1) / (2 pi K(th, P)).
    """
    real = type(cos_theta)
    # Eq. (3), normalised
    if norm == NO_NORM:
        return real(1.0)
    if norm == FULL_LOBE:
        return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi))
    return lobe_norm(cos_theta, exponent)


@kernel
def widened(square: Any, exponent: Any, whole: Any, widening: Widening, k: int, reached: bool) -> tuple[Any, Any]:
    """Return P' and c(P') / c(P) at a receiver of light k, r^2 = `square` (m^2) away, with c(P) = `whole` (Sec. 3.3).

    The ratio is 1 where the light does not reach the receiver, which does not need it.
    """
    real = type(square)
    one = real(1.0)
    r = math.sqrt(square)
    share = r / widening.distance if widening.slope == CORRECTED else one / (r * widening.distance)
    fallen = exponent * (share if share < one else one)
    if widening.norm >= 0 and share < one and reached and whole > real(0.0):
        return fallen, lobe_norm_factor(widening.cos_theta[k], fallen, widening.norm) / whole
    return fallen, one


NORMS = {"none": NO_NORM, "full_lobe": FULL_LOBE, "clamped": CLAMPED}
HEADROOM = 1e8  # of the largest number to the largest that is packed: what kernels multiply it by comes on top


class PackedLobes(NamedTuple):
    """What `add_lobes` reads of the lights."""

    lights: Array  # (13, K), of `pack_lobes`
    clamp: Clamp
    widening: Widening | None


class Packed(NamedTuple):
    """Everything the kernels read of the lights."""

    diffuse: Array  # (9, M + 1), of `pack_diffuse`
    clamp: Clamp | None  # of the diffuse lights
    spheres: Array | None  # (M,) r^2 of virtual spherical lights, m^2
    lobes: PackedLobes | None  # None: no light is glossy
    shines: Array  # (N,) bool: which lights are among the M
    glossy: Array  # (N,) bool: which are among the K
    tree: LightTree | None = None  # of the diffuse lights, where they may be summed by clusters

    @property
    def terms(self) -> int:
        """What a receiver sums: diffuse lights and lobes."""
        return int(np.count_nonzero(self.shines) + np.count_nonzero(self.glossy))

    def part(self, chosen: Array) -> "Packed":
        """Return the lights that are chosen, (N,) bool, without a tree."""
        shines, glossy = chosen[self.shines], chosen[self.glossy]
        some = np.append(shines, True)  # the last one is black
        lobes = self.lobes if glossy.any() else None
        if lobes is not None:
            widening = lobes.widening
            lobes = PackedLobes(
                np.compress(glossy, lobes.lights, axis=1),
                lobes.clamp._replace(softness=lobes.clamp.softness[glossy]),
                widening if widening is None else widening._replace(cos_theta=widening.cos_theta[glossy]))
        return Packed(np.compress(some, self.diffuse, axis=1),
                      self.clamp and self.clamp._replace(softness=self.clamp.softness[some]),
                      None if self.spheres is None else self.spheres[shines], lobes, self.shines & chosen,
                      self.glossy & chosen)


def pack(lights: PixelLights, settings: PairSettings, footprint: Array | None, dtype: npt.DTypeLike) -> Packed:
    """Pack the lights that have flux, each part for its kernel; `footprint` (N,) is the area each stands for, m^2."""
    shines: Array = (lights.flux != 0).any(axis=0)
    glossy = np.zeros_like(shines) if lights.lobe_flux is None else (lights.lobe_flux != 0).any(axis=0)
    diffuse = pack_diffuse(lights, settings, dtype, shines)
    clamp, spheres = None, None
    if settings.clamps:
        clamp = pack_clamp(settings, footprint, shines, diffuse.shape[1], dtype)
    if isinstance(settings.clamp, SphereClamp) and footprint is not None:
        # pi r^2 is the clamp's value times the footprint
        spheres = _finite(footprint[shines] * (settings.clamp.value / math.pi), dtype).astype(dtype)
    lobes = None
    if not glossy.any() and not left_out("pairs.lobes", lambda: (len(glossy), len(glossy))):
        lights, glossy = with_dark_lobes(lights), np.ones_like(glossy)
    if glossy.any():
        packed = pack_lobes(lights, settings, dtype, glossy)
        lobe_clamp = pack_clamp(settings, footprint, glossy, packed.shape[1], dtype)
        lobes = PackedLobes(packed, lobe_clamp, pack_widening(lights, settings, dtype, glossy))
    return Packed(diffuse, clamp, spheres, lobes, shines, glossy)


@dataclasses.dataclass(frozen=True)
class Unpacked:
    """Lights that are packed once, where anything asks for it."""

    lights: PixelLights
    settings: PairSettings
    footprint: Array | None
    dtype: npt.DTypeLike

    @functools.cached_property
    def packed(self) -> Packed:
        """The packed lights."""
        return pack(self.lights, self.settings, self.footprint, self.dtype)


@stage("pairs.light_tree")
def clustered(unpacked: Unpacked, error: float) -> Packed:
    """Pack lights and build the light tree over the diffuse ones, if there are any.

    unpacked: The lights, their pairs and areas.
    error: Largest error of a receiver's sum over channels, as a share of it.
    -> Packed: The lights and their tree, of as many levels as leave at most FAN nodes on the highest.

    Raises `InputError` if a light has a flux below 0, or lights are spheres.
    """
    packed = unpacked.packed
    expect(packed.spheres is None, "clamp", "another one with lightcuts, which bound no spheres", "sphere")
    expect(bool((packed.diffuse[6:] >= 0).all()), "lights.flux", "numbers >= 0 with lightcuts",
           packed.diffuse[6:].min(initial=0.0))
    if packed.diffuse.shape[1] == 1:
        return packed
    return packed._replace(tree=light_tree(*joined_at_texels(packed, unpacked.lights), error))


def joined_at_texels(packed: Packed, lights: PixelLights) -> tuple[Array, Clamp | None]:
    """Return diffuse lights and their clamp, those of one texel joined to one, where there are more than texels.

    They must differ in flux alone, as draws from maps do: where any differs in place, normal or area all stay apart.
    """
    diffuse, clamp = packed.diffuse, packed.clamp
    if lights.texel is None or lights.map_index is None:
        return diffuse, clamp
    texel = lights.texel[packed.shines].astype(np.int64)
    texel += lights.map_index[packed.shines] * (texel.max() + 1)
    places = int(texel.max()) + 1
    if len(texel) <= places:
        return diffuse, clamp
    first = np.full(places, -1)
    first[texel[::-1]] = np.arange(len(texel))[::-1]
    of_first = first[texel]
    shared = [*diffuse[:6], *([] if clamp is None else [clamp.softness])]
    if any(not np.array_equal(values[of_first], values[:-1]) for values in shared):
        return diffuse, clamp
    some = np.append(first[first >= 0], len(texel))
    joined = np.take(diffuse, some, axis=1)
    for row in range(6, 9):
        joined[row, :-1] = np.bincount(texel, diffuse[row, :-1], places)[first >= 0]
    return joined, clamp if clamp is None else clamp._replace(softness=clamp.softness[some])


def with_dark_lobes(lights: PixelLights) -> PixelLights:
    """Return diffuse lights as glossy ones whose lobes have no flux: what a sum over lobes adds nothing for."""
    return lights._replace(lobe_flux=np.zeros_like(lights.flux), lobe_axis=lights.normal,
                           lobe_exponent=np.ones_like(lights.flux[0]))


def pack_diffuse(lights: PixelLights, settings: PairSettings, dtype: npt.DTypeLike, chosen: Array) -> Array:
    """Pack the M chosen lights for `sum_pairs`, (9, M + 1): offset position, reversed normal, flux / pi.

    The last one is black. Computed in float64.
    """
    # Eq. (1), over pi unless as printed
    scale = 1.0 if "sii_no_pi" in settings.as_published else 1.0 / math.pi
    packed = np.zeros((9, np.count_nonzero(chosen) + 1), dtype)
    packed[:3, :-1], packed[3:6, :-1] = _place(lights, settings, chosen)
    packed[6:, :-1] = np.asarray(_taken(lights.flux, chosen), np.float64) * scale
    return packed


def _taken(values: Array, chosen: Array) -> Array:
    """Return what chosen lights have of values (..., N)."""
    return values if chosen.all() else np.take(values, np.flatnonzero(chosen), axis=-1)


def _place(lights: PixelLights, settings: PairSettings, chosen: Array) -> tuple[Array, Array]:
    normal = np.asarray(_taken(lights.normal, chosen), np.float64)
    return _taken(lights.position, chosen) - settings.offset * normal, -normal


def pack_lobes(lights: PixelLights, settings: PairSettings, dtype: npt.DTypeLike, chosen: Array) -> Array:
    """Pack the K chosen lights for `add_lobes`, (13, K): offset position, reversed normal and axis, P, flux times norm.

    Computed in float64.
    """
    flux, axis, exponent = _lobes(lights, chosen)
    cos_theta = (np.asarray(lights.normal[:, chosen], np.float64) * axis).sum(axis=0)
    norm = np.empty_like(exponent)
    _fill_norms(cos_theta, exponent, NORMS[settings.lobe.norm], norm)
    # Eq. (3), the norm in the flux
    packed = np.concatenate([*_place(lights, settings, chosen), -axis, exponent[None], _finite(flux * norm, dtype)])
    return packed.astype(dtype, order="C")


@kernel
def _fill_norms(cos_theta: Array, exponent: Array, norm: int, factor: Array) -> None:
    for k in range(len(factor)):
        factor[k] = lobe_norm_factor(cos_theta[k], exponent[k], norm)


def _lobes(lights: PixelLights, chosen: Array) -> tuple[Array, Array, Array]:
    parts = []
    for key in ("lobe_flux", "lobe_axis", "lobe_exponent"):
        values = getattr(lights, key)
        expect(values is not None, f"lights.{key}", "flux, axis and exponent of every lobe", None)
        parts.append(np.asarray(values[..., chosen], np.float64))
    flux, axis, exponent = parts
    expect(bool((np.isfinite(exponent) & (exponent >= 0)).all()), "lights.lobe_exponent", "finite numbers >= 0",
           exponent.min(initial=0.0))
    return flux, axis, exponent


def pack_clamp(settings: PairSettings, footprint: Array | None, chosen: Array, count: int, dtype: Any) -> Clamp:
    """Pack the clamp of `count` packed lights, with neutral values for the modes not in use."""
    softness = np.zeros(count, dtype)
    mode = settings.clamp
    if isinstance(mode, DiscClamp) and footprint is not None:
        softness[: np.count_nonzero(chosen)] = footprint[chosen] / math.pi
    least = mode.value**2 if isinstance(mode, DistanceClamp) and mode.value is not None else 0.0
    bound = mode.value if isinstance(mode, GeometryClamp) and mode.value is not None else math.inf
    return Clamp(np.dtype(dtype).type(least), softness, np.dtype(dtype).type(bound))


def _finite(values: Array, dtype: npt.DTypeLike) -> Array:
    """Return values that stay finite in a dtype: a lobe's peak grows with its exponent beyond any flux."""
    return np.minimum(values, float(np.finfo(dtype).max) / HEADROOM)


def pack_widening(lights: PixelLights, settings: PairSettings, dtype: Any, chosen: Array) -> Widening | None:
    """Pack the widening of exponents near the chosen lights (SII Sec. 3.3); None where exponents stay."""
    if settings.lobe.widening == 0:
        return None
    _, axis, _ = _lobes(lights, chosen)
    literal = "sii_widening" in settings.as_published
    keeps_norm = literal or "sii_widening_unnorm" in settings.as_published
    return Widening(np.dtype(dtype).type(settings.lobe.widening), LITERAL if literal else CORRECTED,
                    -1 if keeps_norm else NORMS[settings.lobe.norm],
                    (lights.normal[:, chosen] * axis).sum(axis=0).astype(dtype))
