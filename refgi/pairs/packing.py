"""Packing of pixel lights into the arrays that kernels read: offset, normals reversed, constants folded into flux.

Everything is computed in float64 and rounded once, to the dtype of the receivers.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.pairs.lightcuts.tree import LightTree, light_tree
from refgi.pairs.pair_sum import Clamp
from refgi.pairs.pixel_lights import CLAMPED, CORRECTED, FULL_LOBE, LITERAL, NO_NORM, Widening, lobe_norm_factor
from refgi.pairs.settings import DiscClamp, DistanceClamp, GeometryClamp, PairSettings, SphereClamp
from refgi.skips import left_out
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

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
    spheres: Array | None  # (M,), of `pack_spheres`
    lobes: PackedLobes | None  # None: no light is glossy
    shines: Array  # (N,) bool: which lights are among the M
    glossy: Array  # (N,) bool: which are among the K
    tree: LightTree | None = None  # of the diffuse lights, where they may be summed by clusters

    @property
    def terms(self) -> int:
        """What a receiver sums: diffuse lights and lobes."""
        return int(np.count_nonzero(self.shines) + np.count_nonzero(self.glossy))


def pack(lights: "PixelLights", settings: PairSettings, footprint: Array | None, dtype: npt.DTypeLike) -> Packed:
    """Pack the lights that have flux, each part for its kernel; `footprint` (N,) is the area each stands for, m^2."""
    shines: Array = (lights.flux != 0).any(axis=0)
    glossy = np.zeros_like(shines) if lights.lobe_flux is None else (lights.lobe_flux != 0).any(axis=0)
    diffuse = pack_diffuse(lights, settings, dtype, shines)
    clamp, spheres = None, None
    if settings.clamps:
        clamp = pack_clamp(settings, footprint, shines, diffuse.shape[1], dtype)
    if isinstance(settings.clamp, SphereClamp) and footprint is not None:
        spheres = pack_spheres(settings.clamp.value, footprint, shines, dtype)
    lobes = None
    if not glossy.any() and not left_out("pairs.lobes", lambda: (len(glossy), len(glossy))):
        lights, glossy = with_dark_lobes(lights), np.ones_like(glossy)
    if glossy.any():
        packed = pack_lobes(lights, settings, dtype, glossy)
        lobe_clamp = pack_clamp(settings, footprint, glossy, packed.shape[1], dtype)
        lobes = PackedLobes(packed, lobe_clamp, pack_widening(lights, settings, dtype, glossy))
    return Packed(diffuse, clamp, spheres, lobes, shines, glossy)


@stage("pairs.light_tree")
def clustered(
    lights: "PixelLights", settings: PairSettings, footprint: Array | None, dtype: npt.DTypeLike, error: float
) -> Packed:
    """Pack lights and build the light tree over the diffuse ones, if there are any.

    error: Largest error of a receiver's sum over channels, as a share of it.
    -> Packed: The lights and their tree, of as many levels as leave at most FAN nodes on the highest.

    Raises
    ------
    InputError
        If a light has a flux below 0, or lights are spheres.
    """
    packed = pack(lights, settings, footprint, dtype)
    expect(packed.spheres is None, "clamp", "another one with lightcuts, which bound no spheres", "sphere")
    expect(bool((packed.diffuse[6:] >= 0).all()), "lights.flux", "numbers >= 0 with lightcuts",
           packed.diffuse[6:].min(initial=0.0))
    if packed.diffuse.shape[1] == 1:
        return packed
    return packed._replace(tree=light_tree(packed.diffuse, packed.clamp, error))


def with_dark_lobes(lights: "PixelLights") -> "PixelLights":
    """Return diffuse lights as glossy ones whose lobes have no flux: what a sum over lobes adds nothing for."""
    return lights._replace(lobe_flux=np.zeros_like(lights.flux), lobe_axis=lights.normal,
                           lobe_exponent=np.ones_like(lights.flux[0]))


def pack_diffuse(lights: "PixelLights", settings: PairSettings, dtype: npt.DTypeLike, chosen: Array) -> Array:
    """Pack the M chosen lights for `sum_pairs`, (9, M + 1): offset position, reversed normal, flux / pi.

    The last one is black. Computed in float64.
    """
    # Eq. (1), over pi unless as printed
    scale = 1.0 if "sii_no_pi" in settings.as_published else 1.0 / math.pi
    packed = np.concatenate([*_place(lights, settings, chosen), np.asarray(lights.flux[:, chosen], np.float64) * scale])
    packed = np.concatenate([packed, np.zeros((9, 1))], axis=1)
    return packed.astype(dtype, order="C")  # one layout: kernels are compiled once


def _place(lights: "PixelLights", settings: PairSettings, chosen: Array) -> tuple[Array, Array]:
    normal = np.asarray(lights.normal[:, chosen], np.float64)
    return lights.position[:, chosen] - settings.offset * normal, -normal


def pack_lobes(lights: "PixelLights", settings: PairSettings, dtype: npt.DTypeLike, chosen: Array) -> Array:
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


def _lobes(lights: "PixelLights", chosen: Array) -> tuple[Array, Array, Array]:
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


def pack_spheres(scale: float, footprint: Array, chosen: Array, dtype: Any) -> Array:
    """Return r^2 (M,), m^2, of the chosen virtual spherical lights: pi r^2 is `scale` times the footprint (N,), m^2."""
    square: Array = footprint[chosen] * (scale / math.pi)
    return _finite(square, dtype).astype(dtype)


def _finite(values: Array, dtype: npt.DTypeLike) -> Array:
    """Return values that stay finite in a dtype: a lobe's peak grows with its exponent beyond any flux."""
    return np.minimum(values, float(np.finfo(dtype).max) / HEADROOM)


def pack_widening(lights: "PixelLights", settings: PairSettings, dtype: Any, chosen: Array) -> Widening | None:
    """Pack the widening of exponents near the chosen lights (SII Sec. 3.3); None where exponents stay."""
    if settings.lobe.widening == 0:
        return None
    _, axis, _ = _lobes(lights, chosen)
    literal = "sii_widening" in settings.as_published
    keeps_norm = literal or "sii_widening_unnorm" in settings.as_published
    return Widening(np.dtype(dtype).type(settings.lobe.widening), LITERAL if literal else CORRECTED,
                    -1 if keeps_norm else NORMS[settings.lobe.norm],
                    (lights.normal[:, chosen] * axis).sum(axis=0).astype(dtype))
