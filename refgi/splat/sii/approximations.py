"""What `sii` approximates, in the order of its pipeline."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from refgi.lights.approximations import CLAMP, LIGHT_SAMPLING, OPENNESS, RSM_RESOLUTION, VISIBILITY, every_light
from refgi.method import Approximation
from refgi.splat.sii.settings import SiiSettings


def _sampled(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    reach = settings.reach if settings.reach.cut else dataclasses.replace(settings.reach, seed=0)  # draws none
    return dataclasses.replace(settings, lights=every_light(settings.lights), reach=reach)


def _uncut(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    if settings.reach.cut is None:
        return settings
    return dataclasses.replace(settings, reach=dataclasses.replace(settings.reach, cut=None, seed=0))


def _full_resolution(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    return dataclasses.replace(settings, half_resolution=False)


def _every_pair(settings: SiiSettings, _: Mapping[str, Any]) -> SiiSettings:
    return dataclasses.replace(settings, lightcuts=None)


APPROXIMATIONS = (
    VISIBILITY, RSM_RESOLUTION, LIGHT_SAMPLING._replace(off=_sampled), OPENNESS, CLAMP,
    Approximation("cut", "pairs whose irradiance is below a threshold are left out", _uncut),
    Approximation("lightcuts", "clusters stand for their lights where the sum's error is bounded", _every_pair),
    Approximation("upsampling", "one pixel of 2 x 2 is evaluated, the others are upsampled", _full_resolution))
