"""`SiiSettings` as arguments of refgi.literal.sii, over the n covered pixels, in two parts where there are lobes.

What the literal text has no word for: random shares of the threshold, and meshes that are drawn (tests/naive).
"""

import copy

import numpy as np

from refgi.literal import sii as literal
from refgi.literal.hssil_levels import first_level
from refgi.literal.upsampling import joint_bilateral
from refgi.settings import replaced
from tests.literal.whole.pairs import irradiance_of, occluded_of, sent
from tests.naive.bounds import drawn
from tests.naive.draws import draw

STREAMS = 3, 3 + 256  # of the random shares of both parts


def sii(frame, settings, lights, footprint=None):
    """Return the irradiance (3, h, w) of a frame by its pixel lights; `footprint` is the area (N,) of each."""
    return occluded_of(frame, settings, picture(frame, settings, lights, footprint, lambda weight: weight))


def stored(frame, lights):
    """Return a frame with the G-buffer that textures keep, and the lights that they do."""
    buffer, seen = frame.gbuffer, copy.copy(frame)
    position, normal = literal.stored_surface(buffer.position, buffer.normal)
    vars(seen)["gbuffer"] = buffer.with_channels(
        {**buffer.recorded(), "position": position, "normal": normal}, np.float64)
    names = "position", "normal", "flux", *(("lobe_flux", "lobe_axis") if lights.lobe_flux is not None else ())
    kept = literal.stored_lights(*(getattr(lights, name) for name in names))
    return seen, lights._replace(**dict(zip(names, kept, strict=True)))


def cut_irradiance(frame, settings, lights, footprint=None):
    """Return the pairs out of range, at full resolution, (3, h, w), whatever the bound."""
    whole = replaced(settings, {"reach.bound": "full", "half_resolution": False})
    return picture(frame, whole, lights, footprint, lambda weight: 1 - weight)


def picture(frame, settings, lights, footprint, share):
    """Return the sum of pairs, each times the share that its weight asks for."""
    buffer, result = frame.gbuffer, np.zeros((3, *frame.gbuffer.covered.shape))
    parts = irradiance_of(*covered_points(frame), lights, settings.pairs, footprint)
    result[:, buffer.covered] = sum(
        (part * share(weight)).sum(axis=1)
        for part, weight in zip(parts, weights(frame, settings, lights), strict=False))
    surfaces = buffer.position, buffer.normal, buffer.covered
    return joint_bilateral(*surfaces, result) if settings.half_resolution else result


def compensation(frame, bound):
    """Return the sum (3, h, w) of L ds max(0, G - b) over all pixels: literal senders, pair by pair."""
    view, shown = frame.gbuffer.projection, frame.gbuffer.covered
    _, _, n, radiance, area, *_ = first_level(*frame.gbuffer.resolve("depth", "normal", "albedo"), frame.direct,
                                              view.frame, view.half, 0)
    x, result = frame.gbuffer.position[:, shown], np.zeros(frame.direct.shape)
    d = x[:, None] - x[..., None]
    square = (d**2).sum(axis=0)
    cx, cl = (n[:, shown][..., None] * d).sum(axis=0), -(n[:, shown][:, None] * d).sum(axis=0)
    term = np.divide(np.maximum(cx, 0) * np.maximum(cl, 0), square**2, out=np.zeros_like(square), where=square > 0)
    result[:, shown] = (radiance * area)[:, shown] @ np.maximum(term - bound, 0).T
    return result


def fragments(frame, settings, lights):
    """Return how many parts count at each pixel (h, w), and at how many pixels the parts of each light do (N,)."""
    counts = [(weight > 0) & (flux.max(axis=0) > 0)[:, None] for weight, flux in zip(
        weights(frame, settings, lights), (lights.flux, lights.lobe_flux), strict=False)]
    overdraw = np.zeros(frame.gbuffer.covered.shape, int)
    overdraw[frame.gbuffer.covered] = sum(one.sum(axis=0) for one in counts)
    return overdraw, sum(one.sum(axis=1) for one in counts)


def covered_points(frame):
    """Return place and normal (3, n) of what the covered pixels see."""
    return (plane[:, frame.gbuffer.covered] for plane in (frame.gbuffer.position, frame.gbuffer.normal))


def weights(frame, settings, lights):
    """Return by how much the pairs (N, n) of each part count: 0 out of range, else 1 or more."""
    reach, (x, up) = settings.reach, covered_points(frame)
    strength = [part.max(axis=0) for part in irradiance_of(x, up, lights, settings.pairs, facing=True)]
    if reach.cut is None:
        return [np.ones_like(b) for b in strength]
    found, (p, *source) = [], sent(lights, settings.pairs)
    peaks = literal.peaks(*source)
    peaks = peaks if isinstance(peaks, tuple) else (peaks,)
    for part, (b, peak, flux) in enumerate(zip(strength, peaks, (lights.flux, lights.lobe_flux), strict=False)):
        low = thresholds(reach.cut, peak, peaks, (x[:, None], up[:, None], np.zeros((1, x.shape[1]), int), p, *source),
                         settings.pairs, lights.drawn)
        xi = np.ones(len(peak))
        if reach.stochastic:
            shining = np.flatnonzero(flux.any(axis=0))
            xi[shining] = [1 - draw(reach.seed, STREAMS[part], k) for k in range(len(shining))]
        least = (xi * low)[:, None]
        inside = literal.kept([least], b)
        weight = np.where(inside, np.maximum(1, low[:, None] / np.where(inside, np.maximum(b, least), 1)), 0.0)
        spherical = settings.pairs.clamp is not None and settings.pairs.clamp.name() == "sphere"  # tested everywhere
        if reach.bound.name() == "mesh" and not reach.bound.inflate and not spherical:
            weight *= drawn(frame, settings, lights, part, peak / np.maximum(xi * low, 1e-300))
        found.append(weight)
    return found


def thresholds(cut, peak, peaks, seen, pairs, count):
    """Return I_low of each light's part (N,): one for all, unless each has its own as published."""
    if cut.name() == "absolute":
        return np.full(len(peak), cut.irradiance)
    length = np.array([cut.reference_length]) if cut.reference_length else None
    if length is None:
        assert not pairs.lobe.widening  # the literal text knows no strength of lobes whose exponents fall
        length = literal.reference_length(*seen, drawn=count)
    if "per_light_ilow" in cut.as_published:
        return peak / np.where(peak > 0, literal.squares(None, length, peak, share=cut.share, per_light=True), 1)
    return np.full(len(peak), literal.low_irradiance(length, *peaks, share=cut.share))
