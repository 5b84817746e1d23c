"""`PairSettings` as arguments of the literal pair: clamps as surfaces of lights, norms and printed forms as flux."""

import math

import numpy as np

from refgi.literal.pairs import lobe_norm, occluded, pair
from refgi.settings import replaced
from tests.naive.lights import open_shares_of
from tests.naive.sphere import spherical_pair


def with_clamp(settings, *, bare=False):
    """Return settings whose clamp "auto" is the disc, and none where lights have no footprints or that is `bare`."""
    if settings.pairs.clamp is None or settings.pairs.clamp.name() != "auto":
        return settings
    pathless = settings.lights.source.name() == "walk" or settings.lights.openness.flux == "roulette"
    return replaced(settings, {"pairs.clamp": "none" if pathless or bare else "disc"})


def sent(lights, pairs, exponent=None):
    """Return position, normal, flux, lobe flux, axis and exponent of lights, whose norms settings may change.

    `exponent` (N, n): those that lobes fall to at n receivers, and the lobes' flux is (3, N, n) then.
    """
    position, normal, flux = lights.position - pairs.offset * lights.normal, lights.normal, lights.flux
    flux = flux * math.pi if "sii_no_pi" in pairs.as_published else flux
    if lights.lobe_flux is None:
        return position, normal, flux
    cosine, whole = (normal * lights.lobe_axis).sum(axis=0), lights.lobe_exponent.astype(float)
    glossy = lights.lobe_flux
    if exponent is not None:
        cosine, whole, glossy = cosine[:, None], whole[:, None], glossy[..., None]
    here = whole if exponent is None else exponent
    of_norm = whole if {"sii_widening", "sii_widening_unnorm"} & pairs.as_published else here
    wanted = {"none": np.ones_like(of_norm), "full_lobe": (of_norm + 1) / (2 * np.pi)}.get(pairs.lobe.norm)
    wanted, own = lobe_norm(cosine, of_norm) if wanted is None else wanted, lobe_norm(cosine, here)
    factor = np.divide(wanted, own, out=np.zeros(np.broadcast(wanted, own).shape), where=own > 0)
    return position, normal, flux, glossy * factor, lights.lobe_axis, here


def widened(lights, pairs, r):
    """Return the exponents (N, n) that lobes have at distances r (Sec. 3.3), or None where they do not fall."""
    if not pairs.lobe.widening or lights.lobe_flux is None:
        return None
    whole, a = lights.lobe_exponent[:, None], pairs.lobe.widening
    if "sii_widening" in pairs.as_published:
        return np.minimum(whole, whole / (r * a))
    return whole * np.minimum(1, r / a)


def irradiance_of(x, normal, lights, pairs, areas=None, *, facing=False):
    """Return E (3, N, n) of the diffuse parts of lights at receivers (3, n), and where there are any of their lobes.

    `facing`: what they cause at most, on receivers that look at them, without a clamp.
    """
    d = x[:, None] - (lights.position - pairs.offset * lights.normal)[..., None]
    r = np.sqrt((d**2).sum(axis=0))
    w = np.divide(d, r, out=np.zeros_like(d), where=r > 0)
    up = -w if facing else normal[:, None]
    clamp = "none" if pairs.clamp is None or facing else pairs.clamp.name()
    if clamp == "sphere":
        return [in_spheres(x, normal, lights, pairs, areas)]
    exponents = widened(lights, pairs, np.maximum(r, 1e-300))
    p, m, flux, *lobe = sent(lights, pairs, exponents)
    arriving, leaving = np.maximum(0, -(up * w).sum(axis=0)), np.maximum(0, (m[..., None] * w).sum(axis=0))

    def area(cosines):
        if clamp == "distance":
            return np.pi * (np.maximum(r, pairs.clamp.value) ** 2 - r**2)
        if clamp == "geometry":
            return np.pi * np.maximum(0, cosines / pairs.clamp.value - r**2)
        return areas[:, None] if clamp == "disc" else 0.0

    light = x[:, None], up, p[..., None], m[..., None]
    parts = [pair(*light, flux[..., None], None, area(leaving * arriving))]
    if lobe:
        glossy, axis, exponent = lobe if exponents is not None else (one[..., None] for one in lobe)
        axis = axis[..., None] if axis.ndim == 2 else axis
        parts.append(pair(*light, 0 * flux[..., None], (glossy, axis, exponent), area(arriving)))
    return parts


def occluded_of(frame, settings, light):
    """Return a picture's light (3, h, w), under ambient occlusion where the settings of its method have it."""
    how, buffer = settings.ambient_occlusion, frame.gbuffer
    if how is None:
        return light
    share, shown = np.ones(buffer.covered.shape), buffer.covered
    share[shown] = open_shares_of(buffer.position[:, shown].T, buffer.normal[:, shown].T, np.flatnonzero(shown), frame,
                                  how, settings.lights.seed)
    return occluded(light, share)


def contributions(position, normal, lights, pairs, areas=None):
    """Return E (N, n, 3) of N lights at receivers (n, 3); `areas` (N,) are what lights stand for, m^2."""
    return np.moveaxis(sum(irradiance_of(position.T, normal.T, lights, pairs, areas)), 0, 2)


def in_spheres(x, normal, lights, pairs, areas):
    """Return E (3, N, n) of virtual spherical lights of pi r^2 = value A, diffuse ones."""
    p, m, flux, *_ = sent(lights, pairs)
    radius = np.sqrt(pairs.clamp.value * areas / math.pi)
    form = [[spherical_pair(here, up, p[:, k], m[:, k], 1.0, radius=radius[k])
             for here, up in zip(x.T, normal.T, strict=True)] for k in range(p.shape[1])]
    return flux[..., None] * np.reshape(form, (p.shape[1], -1))
