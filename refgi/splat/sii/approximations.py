"""What `sii` approximates, in the order of its pipeline, and where the light goes that it loses."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import (
    AMBIENT_OCCLUSION,
    CLAMP,
    LIGHT_SAMPLING,
    OPENNESS,
    RSM_RESOLUTION,
    VISIBILITY,
    changed,
    every_light,
    most_lights,
    with_clamp,
)
from refgi.method import Approximation
from refgi.pairs.irradiance import Receivers
from refgi.settings import replaced
from refgi.splat.sii.settings import MeshBound, SiiSettings, may_cluster
from refgi.splat.sii.sii import cut_irradiance, sii
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


def _sampled(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    reach = settings.reach if settings.reach.cut else dataclasses.replace(settings.reach, seed=0)  # draws none
    return dataclasses.replace(settings, lights=every_light(settings.lights), reach=reach)


def _uncut(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    if settings.reach.cut is None:
        return settings
    return dataclasses.replace(settings, reach=dataclasses.replace(settings.reach, cut=None, seed=0))


def _unclamped(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    return replaced(settings, {"pairs.clamp": "none", "compensation": "none"})


def _every_pair(settings: SiiSettings, options: Mapping[str, Any]) -> SiiSettings:
    texels = options["rsm_resolution"] ** 2
    many = may_cluster(settings, most_lights(settings.lights, 1, texels))
    return dataclasses.replace(settings, lightcuts=None) if many else settings


APPROXIMATIONS = (
    VISIBILITY, RSM_RESOLUTION, LIGHT_SAMPLING._replace(off=_sampled), OPENNESS, CLAMP._replace(off=_unclamped),
    AMBIENT_OCCLUSION,
    Approximation("cut", "pairs whose irradiance is below a threshold are left out", _uncut),
    Approximation("lightcuts", "clusters stand for their lights where the sum's error is bounded", _every_pair),
    Approximation("storage", "half floats and 8 bits for the buffers of lights and receivers",
                  changed(quantisation="none")),
    Approximation("upsampling", "one pixel of 2 x 2 is evaluated, the others are upsampled",
                  changed(half_resolution=False)))


@stage("sii.ledger")
def sii_ledger(frame: "Frame", settings: SiiSettings) -> Ledger:
    """Account for the power of the lights under `sii`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Lights are summed in full, without lightcuts.
    On the Cornell box at 512 x 512 it takes six times as long as the picture.
    """
    given = dataclasses.replace(with_clamp(settings), lightcuts=None)
    settings = dataclasses.replace(given, ambient_occlusion=None)
    footprint = footprints(frame, settings.lights, settings.pairs)
    picture = sii(frame, settings)
    whole = replaced(settings, {"half_resolution": False, "quantisation": "none", "compensation": "none"})
    between = None if settings == whole else sii(frame, whole) - picture
    losses = {"cut": _cut(frame, settings, footprint), "interpolated": between}
    if given.ambient_occlusion is not None:
        kept = sii(frame, given)
        losses["shadowed"], picture = picture - kept, kept
    return account(frame, settings.lights, settings.pairs, footprint, picture, losses)


def _cut(frame: "Frame", settings: SiiSettings, footprint: Array | None) -> Array | None:
    """Return what the range leaves out, and what a mesh that does not enclose it leaves out besides."""
    if settings.reach.cut is None:
        return None
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    cut = cut_irradiance(receivers, choose_lights(frame, settings.lights), settings, footprint)
    bound = settings.reach.bound
    if isinstance(bound, MeshBound) and not bound.inflate:
        cut = cut + sii(frame, replaced(settings, {"bound_inflate": True})) - sii(frame, settings)
    return cut
