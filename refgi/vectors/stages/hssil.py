"""Hierarchical screen-space light as a chain of stages: levels, samples, sums, blur, upsampling (Soler et al. 2009)."""

from refgi.rsm.raster.projection import camera_projection
from refgi.scene import Scene
from refgi.settings import flat
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.pyramid.levels import level_shape, useful_levels
from refgi.sssil.settings import HssilSettings
from refgi.vectors.recipe import Recipe
from refgi.vectors.stages.crown import add_gather, add_samples
from refgi.vectors.stages.levels import add_levels
from refgi.vectors.stages.upsampling import add_blur, add_light

SHARED_BY_ALL = ("fixed", "all")  # patterns that leave nothing to blur


def add_hssil(recipe: Recipe, scene: Scene, size: tuple[int, int], settings: HssilSettings) -> str:
    """Add all stages from G-buffer and direct light to the picture's irradiance; return its name.

    `settings`: senders are the receivers, whole discs, no visibility, one camera.
    """
    sampling, shape = settings.sampling, (size[1], size[0])
    first, count = sampling.first_level, useful_levels(shape, sampling)
    radius = chosen_radius(level_shape(shape, first), sampling)
    add_levels(recipe, camera_projection(scene.camera, *size), first, count, settings.senders.downsample)
    light = ""
    for index in reversed(range(count)):
        add_samples(recipe, sampling, index, level_shape(shape, first + index), radius)
        add_gather(recipe, settings, index)
        own = f"gather{index}.irradiance"
        if settings.blur is not None and sampling.pattern not in SHARED_BY_ALL:
            add_blur(recipe, settings.blur, index, first + index)
            own = f"blur{index}.irradiance"
        light = add_light(recipe, settings, index, own, light) if light else own
    recipe.facts["hssil"] = {"first level": first, "levels": count, "radius": radius,
                             "settings": {key: value for key, value in flat(settings).items()
                                          if isinstance(value, bool | int | float | str)}}
    return add_light(recipe, settings, -1, "", light) if first else light
