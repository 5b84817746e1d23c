"""What `multires` approximates, in the order of its pipeline, and where the light goes that it loses."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from refgi.cluster.settings import ClusteredShadows
from refgi.error_target.grid import MOST_CELLS
from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights
from refgi.lights.settings import (
    AMBIENT_OCCLUSION,
    CLAMP,
    LIGHT_SAMPLING,
    OPENNESS,
    RSM_RESOLUTION,
    VISIBILITY,
    changed,
    most_lights,
    without_clamp,
)
from refgi.method import Approximation
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.multires import light_areas, multires
from refgi.splat.multires.settings import ByError, ByGeometry, MultiresSettings, Rays
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame


def _ignores_visibility(settings: MultiresSettings) -> Mapping[str, Any]:
    return {} if settings.visibility is not None else {"visibility": False}


def _by_rays(settings: MultiresSettings, _: Mapping[str, Any]) -> MultiresSettings:
    if not isinstance(settings.visibility, ClusteredShadows):
        return settings
    assert isinstance(settings.subsplats, ByGeometry | ByError)
    subsplats = dataclasses.replace(settings.subsplats, visibility=Rays())
    return dataclasses.replace(settings, subsplats=subsplats, pairs=PairSettings())


def _unclamped(settings: MultiresSettings, options: Mapping[str, Any]) -> MultiresSettings:
    printed = settings.as_published - {"ams_disc"}  # a form of the clamp
    unclamped: MultiresSettings = without_clamp(dataclasses.replace(settings, as_published=frozenset()), options)
    return dataclasses.replace(unclamped, as_published=printed)


def _every_pixel(settings: MultiresSettings, _: Mapping[str, Any]) -> MultiresSettings:
    """Return settings whose coarsest level is that of pixels, which are not filtered."""
    subsplats = ByGeometry(coarsest=MOST_CELLS, visibility=settings.visibility)
    return dataclasses.replace(settings, subsplats=subsplats)


def _every_pair(settings: MultiresSettings, options: Mapping[str, Any]) -> MultiresSettings:
    many = settings.may_cluster(most_lights(settings.lights, 1, options["rsm_resolution"] ** 2))
    return dataclasses.replace(settings, lightcuts=None) if many else settings


APPROXIMATIONS = (
    VISIBILITY._replace(about="nothing blocks indirect light, or shadows of clusters for a ray to each light",
                        off=_by_rays, limit=_ignores_visibility),
    RSM_RESOLUTION,
    LIGHT_SAMPLING._replace(from_truth=lambda settings: settings.visibility is not None),
    OPENNESS, CLAMP._replace(off=_unclamped), AMBIENT_OCCLUSION,
    Approximation("subsplats", "cells of many pixels are evaluated at one and upsampled", _every_pixel),
    Approximation("lightcuts", "clusters stand for their lights where the sum's error is bounded", _every_pair),
    Approximation("detail", "surfaces that turn away from the camera are darkened (Eq. 3)", changed(detail=0.0)),
    Approximation("supersampling", "a pixel is the mean of four, not its centre", changed(supersampled=False)))


@stage("multires.ledger")
def multires_ledger(frame: "Frame", settings: MultiresSettings) -> Ledger:
    """Account for the power of the lights under `multires`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Lights are summed in full, without lightcuts.
    `interpolated` is every pixel's sum less the picture before Eq. 3, and so holds twice the size and the printed
    forms of subsplats as well. It sums all lights at every pixel three times or more: on the Cornell box at 512 x 512
    it takes 17 times as long as the picture.
    """
    settings = dataclasses.replace(settings, lightcuts=None)
    lights, pairs = choose_lights(frame, settings.lights), settings.effective_pairs
    footprint = light_areas(frame, lights, settings)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    unblocked = every = irradiance(receivers, lights, pairs, footprint)
    if settings.visibility is not None:
        finest = ByGeometry(coarsest=MOST_CELLS, visibility=settings.visibility)
        every = multires(frame, MultiresSettings(settings.lights, settings.pairs, finest))
    picture = plain = unoccluded = multires(frame, settings)
    if settings.ambient_occlusion is not None:
        settings = dataclasses.replace(settings, ambient_occlusion=None)
        plain = unoccluded = multires(frame, settings)
    if settings.detail > 0:
        plain = multires(frame, dataclasses.replace(settings, detail=0.0))
    return account(frame, settings.lights, pairs, footprint, picture,
                   {"shadowed": unblocked - every + unoccluded - picture, "interpolated": every - plain,
                    "darkened": plain - unoccluded})
