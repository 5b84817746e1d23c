"""What `val` approximates, in the order of its pipeline, and where the light goes that it loses.

Kinds of visibility stand on each other: without the series there is none to filter, without a map none to search. What
switches one off switches off those that follow from it.
"""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from refgi.cluster.settings import (
    BY_MAPS,
    LARGEST_MAP,
    BackProjection,
    Clusters,
    Csm,
    InterleavingSettings,
    Pcss,
    RaysRectangle,
    RaysVpls,
    ValSettings,
    Visibility,
)
from refgi.cluster.val import val
from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import (
    CLAMP,
    FINER,
    LIGHT_SAMPLING,
    MOST_LIGHTS,
    OPENNESS,
    RSM_RESOLUTION,
    VISIBILITY,
    with_clamp,
)
from refgi.method import Approximation
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame


def _seen_by(settings: ValSettings, visibility: Visibility) -> ValSettings:
    """Return settings with another kind of visibility and the same maps, whatever is best for that kind."""
    return dataclasses.replace(settings, maps=settings.drawn_maps, visibility=visibility)


def _each_light(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    if settings.visibility is None:
        return settings
    return dataclasses.replace(_seen_by(settings, RaysVpls()), clusters=Clusters(count=MOST_LIGHTS))


def _lights_of_clusters(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.visibility in (None, RaysVpls()) else _seen_by(settings, RaysVpls())


def _rectangle(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    by_maps = isinstance(settings.visibility, (*BY_MAPS, BackProjection))
    return _seen_by(settings, RaysRectangle()) if by_maps else settings


def _finer_maps(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    """Return settings with finer maps where kernels read them: to project all of their texels back takes too long."""
    if not isinstance(settings.visibility, BY_MAPS):
        return settings
    resolution = min(LARGEST_MAP, FINER * settings.maps.resolution)
    return dataclasses.replace(settings, maps=dataclasses.replace(settings.maps, resolution=resolution))


def _all_blockers(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return _seen_by(settings, BackProjection()) if isinstance(settings.visibility, BY_MAPS) else settings


def _tests_of_depth(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return _seen_by(settings, Pcss()) if isinstance(settings.visibility, Csm) else settings


def _every_texel(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    if not isinstance(settings.visibility, Csm):
        return settings
    return dataclasses.replace(settings, visibility=dataclasses.replace(settings.visibility, prefilter="brute"))


def _every_pixel(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.interleaving.block is not None else _all_at_each_pixel(settings)


def _without_blocks(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.interleaving.block is None else _all_at_each_pixel(settings)


def _all_at_each_pixel(settings: ValSettings) -> ValSettings:
    return dataclasses.replace(settings, interleaving=InterleavingSettings(1), blur=None)


APPROXIMATIONS = (
    VISIBILITY._replace(limit=lambda settings: {} if settings.visibility is not None else {"visibility": False}),
    RSM_RESOLUTION,
    LIGHT_SAMPLING._replace(from_truth=lambda settings: settings.visibility is not None),
    OPENNESS, CLAMP,
    Approximation("clustering", "lights of a cluster share one visibility, by rays to all of them", _each_light),
    Approximation("rectangle", "the rectangle around a cluster for its lights, by rays", _lights_of_clusters),
    Approximation("single view", "what blocks is what the rectangle's centre sees: texels of one depth map",
                  _rectangle),
    Approximation("kernel", "tests of depth in one region of the map for all blockers that it holds", _all_blockers),
    Approximation("shadow map resolution", f"texels that such tests read; off: {FINER} along a side for each",
                  _finer_maps),
    Approximation("CSM series", "M terms and their bias for the test of depth", _tests_of_depth),
    Approximation("filter", "levels of a mip map for each texel of the region", _every_texel),
    Approximation("subsplats", "cells of many pixels are evaluated at one, to an error", _every_pixel),
    Approximation("interleaving", "a pixel sums one light of n x n, and the blur", _without_blocks))


@stage("cluster.ledger")
def val_ledger(frame: "Frame", settings: ValSettings) -> Ledger:
    """Account for the power of the lights under `val`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    `shadowed` is what the method's own soft shadows take. On the Cornell box at 512 x 512 it takes 2.6 times as long as
    the picture.
    """
    settings = with_clamp(settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    unblocked = irradiance(receivers, choose_lights(frame, settings.lights), settings.pairs, footprint)
    whole = dataclasses.replace(settings, interleaving=InterleavingSettings(block=1))
    picture = val(frame, settings)
    every = val(frame, whole) if whole != settings else picture
    return account(frame, settings.lights, settings.pairs, footprint, picture,
                   {"shadowed": unblocked - every, "interpolated": every - picture})
