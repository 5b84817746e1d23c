"""Two pictures of one scene, how far apart they are, and the most that one bounce can bring."""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.scene import DirectionalLight, Scene
from refgi.settings import Settings
from refgi.stress.changes import Changed
from refgi.types import Array


def largest_bounce(frame: Frame) -> Array | None:
    """Return what irradiance of one bounce exceeds nowhere, (3,), W/m^2.

    Largest radiosity at texels of all lamps' maps, the lamps added; None where a lobe or glass sends light, as it may
    send all of it one way. A hemisphere filled with the radiance B / pi gives the irradiance B. A texel of solid angle
    w, seen at distance r and cosine c, has the area w r^2 / c, so B = flux c / (w r^2).
    """
    if frame.materials.specular.any() or frame.materials.ior.any():
        return None
    bound = np.zeros(3)
    for light, rsm in zip(frame.scene.lights, frame.rsms, strict=True):
        lit = rsm.covered & (rsm.solid_angle > 0)
        flux, angle = rsm.flux[:, lit].astype(np.float64), rsm.solid_angle[lit].astype(np.float64)
        normal = rsm.normal[:, lit].astype(np.float64)
        if isinstance(light, DirectionalLight):
            towards = -np.array(light.direction)[:, None] / np.linalg.norm(light.direction)
            square = np.ones_like(angle)
        else:
            towards = np.array(light.position)[:, None] - rsm.position[:, lit]
            square = (towards**2).sum(axis=0)
            towards /= np.sqrt(square)
        cosine = np.abs((normal * towards).sum(axis=0))
        bound += (flux * (cosine / (angle * square))).max(axis=1, initial=0.0)
    return bound


NEAR = 1e-4  # share of the depth within which two pixels show the same place
ALIKE = 1e-5  # difference of albedo


class Seen(NamedTuple):
    """A picture with what its judges need."""

    light: Array  # (3, h, w) indirect irradiance, W/m^2, of the frame's type
    depth: Array  # (h, w) m; inf without surface
    albedo: Array  # (3, h, w)
    estimate: Any  # of a method that states its own error
    warned: tuple[str, ...]  # warnings that are not refgi's own, as text


def see(scene: Scene, method: str, settings: Settings, options: dict[str, Any]) -> Seen:
    """Render a scene by a method and keep what comparisons need; warnings of refgi are left out."""
    from refgi.methods import render

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        picture = render(scene, method, settings, **options)
        buffer = picture.frame.gbuffer
        seen = Seen(picture.irradiance, buffer.depth, buffer.albedo, picture.estimate, ())
    other = tuple(f"{one.category.__name__}: {one.message}" for one in caught
                  if not issubclass(one.category, RefgiWarning))
    return seen._replace(warned=other)


def unsound(light: Array) -> int:
    """Return how many pixels of irradiance, (3, h, w), hold NaN, an infinity or a negative number."""
    return int(np.count_nonzero(~(np.isfinite(light) & (light >= 0)).all(axis=0)))


def same_surface(before: Seen, after: Seen, changed: Changed) -> Array:
    """Return which pixels of the part show the same place in both pictures, (h, w).

    Depths within 1e-4 of each other, and the same albedo.
    """
    depth, albedo = before.depth[changed.part], before.albedo[:, *changed.part]
    other = changed.back(after.depth, light=False) / changed.length
    colour = changed.back(after.albedo, light=False)
    with np.errstate(invalid="ignore"):
        near = (depth == other) | (np.abs(depth - other) <= NEAR * np.minimum(depth, other))
    return np.asarray(near & (np.abs(albedo - colour).max(axis=0) <= ALIKE))


def bits_apart(before: Seen, after: Seen, changed: Changed) -> int:
    """Return how many pixels of the part differ by a bit, of those whose light has all its digits in both pictures.

    Light below the smallest normal number of float32, 1.2e-38, keeps fewer bits and is not asked for any.
    """
    was, now = before.light[:, *changed.part], changed.back(after.light)
    too_dark = np.maximum(was, now) * min(1.0, changed.flux) < np.finfo(np.float32).tiny
    return int(np.count_nonzero(((was != now) & ~too_dark).any(axis=0)))


def rmse_apart(before: Seen, after: Seen, changed: Changed) -> float:
    """Return the RMSE over all pixels that show the same place, over the mean of the picture before.

    Infinity where the picture before is black and that after is not, and where no pixel shows the same place.
    """
    first = before.light[:, *changed.part].astype(np.float64)
    apart = changed.back(after.light.astype(np.float64)) - first
    kept = same_surface(before, after, changed)
    mean = float(first.mean())
    if not kept.any():
        return math.inf
    if not apart[:, kept].any():
        return 0.0
    return math.sqrt(float((apart[:, kept] ** 2).mean())) / mean if mean > 0 else math.inf


def means_apart(before: Seen, after: Seen, changed: Changed) -> float:
    """Return how far the means over pixels with a surface are apart, over that before; pictures of any size.

    Infinity where only one of the two is black.
    """
    first, second = (seen.light[:, np.isfinite(seen.depth)].astype(np.float64) for seen in (before, after))
    if not first.any() and not second.any():
        return 0.0
    mean = float(first.mean()) if first.size else 0.0
    return abs(float(second.mean()) / changed.flux / mean - 1) if mean > 0 and second.size else math.inf


def estimates_apart(before: Seen, after: Seen, changed: Changed) -> tuple[float, float]:
    """Return the largest |t| of the picture means of two estimates over channels, and its degrees of freedom."""
    first, second = before.estimate, after.estimate
    apart = np.abs(first.picture_mean - second.picture_mean / changed.flux)
    variance = first.picture_variance + second.picture_variance / changed.flux**2
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(apart == 0, 0.0, apart / np.sqrt(variance))  # NaN stays
    return float(t.max()), float(first.degrees_of_freedom + second.degrees_of_freedom)
