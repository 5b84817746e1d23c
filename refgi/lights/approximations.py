"""Approximations that methods with pixel lights share: texels of a map, few of them, clamped, without visibility."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from refgi.lights.settings import LightSettings, MapLights, OpennessSettings
from refgi.method import Approximation

PATHS = 1 << 16  # light paths that stand for all
FINER = 2  # texels along a side for each one


def every_light(lights: LightSettings) -> LightSettings:
    """Return settings by which every texel of the maps is a pixel light, or many ends of light paths are."""
    if not isinstance(lights.source, MapLights):
        return dataclasses.replace(lights, count=max(lights.count, PATHS), seed=0)
    source = dataclasses.replace(lights.source, pattern="all", filtered=False, warp=None,
                                 as_published=lights.source.as_published - {"sii_peak"})
    return dataclasses.replace(lights, count=1, seed=0, source=source)


def without_clamp(settings: Any, _: Mapping[str, Any]) -> Any:
    """Return settings of a method whose near pairs are not clamped."""
    return dataclasses.replace(settings, pairs=dataclasses.replace(settings.pairs, clamp=None))


def _finer_map(options: Mapping[str, Any]) -> Mapping[str, Any]:
    return {**options, "rsm_resolution": FINER * options["rsm_resolution"]}


def _unscaled(settings: Any, _: Mapping[str, Any]) -> Any:
    return dataclasses.replace(settings, lights=dataclasses.replace(settings.lights, openness=OpennessSettings()))


def _sampled(settings: Any, _: Mapping[str, Any]) -> Any:
    return dataclasses.replace(settings, lights=every_light(settings.lights))


VISIBILITY = Approximation("visibility", "nothing blocks indirect light", limit=lambda _: {"visibility": False})
RSM_RESOLUTION = Approximation(
    "RSM resolution", f"texels of the reflective shadow map; off: {FINER} along a side for each", frame=_finer_map)
LIGHT_SAMPLING = Approximation(
    "light sampling", "N pixel lights for all texels of the reflective shadow map", _sampled)
OPENNESS = Approximation("openness", "flux of lights in the open is scaled down or left to chance", _unscaled)
CLAMP = Approximation("clamp", "what bounds the light of near pairs", without_clamp)
