"""What `multires` approximates, in the order of its pipeline."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from refgi.cluster.settings import ClusteredShadows
from refgi.lights.approximations import CLAMP, LIGHT_SAMPLING, OPENNESS, RSM_RESOLUTION, VISIBILITY, without_clamp
from refgi.method import Approximation
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.settings import MOST_CELLS, ByError, ByGeometry, MultiresSettings, Rays


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


def _every_pair(settings: MultiresSettings, _: Mapping[str, Any]) -> MultiresSettings:
    return dataclasses.replace(settings, lightcuts=None) if settings.bounded is not None else settings


def _undarkened(settings: MultiresSettings, _: Mapping[str, Any]) -> MultiresSettings:
    return dataclasses.replace(settings, detail=0.0)


def _at_pixels(settings: MultiresSettings, _: Mapping[str, Any]) -> MultiresSettings:
    return dataclasses.replace(settings, supersampled=False)


APPROXIMATIONS = (
    VISIBILITY._replace(about="nothing blocks indirect light, or shadows of clusters for a ray to each light",
                        off=_by_rays, limit=_ignores_visibility),
    RSM_RESOLUTION,
    LIGHT_SAMPLING._replace(from_truth=lambda settings: settings.visibility is not None),
    OPENNESS, CLAMP._replace(off=_unclamped),
    Approximation("subsplats", "cells of many pixels are evaluated at one and upsampled", _every_pixel),
    Approximation("lightcuts", "clusters stand for their lights where the sum's error is bounded", _every_pair),
    Approximation("detail", "surfaces that turn away from the camera are darkened (Eq. 3)", _undarkened),
    Approximation("supersampling", "a pixel is the mean of four, not its centre", _at_pixels))
