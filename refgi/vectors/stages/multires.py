"""Adaptive multiresolution splatting (Nichols and Wyman 2009) as stages, from the G-buffer and pixel lights on.

`multires_ranges` finds discontinuous cells, `multires_list` the subsplats, `multires_light` their light and
`multires_upsample` the picture.
"""

import dataclasses

from refgi.frame import Frame
from refgi.scene import Scene
from refgi.splat.multires.refinement.grid import top_level
from refgi.splat.multires.settings import ByGeometry, ByIrradiance, MultiresSettings
from refgi.vectors.recipe import Recipe
from refgi.vectors.stages.multires_light import add_detail, add_irradiance, add_points
from refgi.vectors.stages.multires_lights import add_lists
from refgi.vectors.stages.multires_list import add_states, add_subsplats
from refgi.vectors.stages.multires_ranges import add_curvatures, add_discontinuities, add_ranges, add_slopes
from refgi.vectors.stages.multires_shadowed import add_halved, add_shadowed_irradiance
from refgi.vectors.stages.multires_upsample import add_upsampling


def add_multires(recipe: Recipe, settings: MultiresSettings, scene: Scene, size: tuple[int, int]) -> None:
    """Add all stages after the G-buffer, which has `size` columns and rows, and the pixel lights.

    Subsplats are refined by geometry or by each light. Where the picture is half as large, the last stage halves it.
    """
    subsplats, (width, height) = settings.subsplats, size
    printed = "ams_filter_all" in settings.as_published, "ams_all_corners" not in settings.as_published
    if isinstance(subsplats, ByIrradiance):
        if (subsplats.criteria, subsplats.representative) != (None, "pixel") or subsplats.form == "brightest":
            raise ValueError(f"{recipe.id}: lists of each light begin with the coarsest cells, at one pixel each")
        add_lists(recipe, subsplats, settings.effective_pairs, size, *printed)
        return
    assert isinstance(subsplats, ByGeometry)
    top = add_refinement(recipe, subsplats, width, height)
    add_points(recipe, subsplats.representative, top)
    if settings.shadow_rays is None:
        add_irradiance(recipe, settings.effective_pairs)
    else:
        add_shadowed_irradiance(recipe, scene)
    add_upsampling(recipe, subsplats.upsampling, top, *printed)
    if settings.detail > 0:
        add_detail(recipe, settings.detail)
    if settings.supersampled:
        frame = Frame(scene, width=width // 2, height=height // 2)
        add_halved(recipe, frame.gbuffer.covered, recipe.stages[-1].writes[0])


def add_refinement(recipe: Recipe, settings: ByGeometry, width: int, height: int) -> int:
    """Add what leads from the G-buffer to the list of subsplats; returns the coarsest level."""
    top, criteria = top_level(height, width, settings.coarsest), settings.criteria
    _give_facts(recipe, settings, top)
    if criteria.depth is not None:
        add_ranges(recipe, "depth", top, criteria.rim, 1)
    if criteria.normal is not None:
        add_ranges(recipe, "normal", top, criteria.rim, len(criteria.normal.components))
    if criteria.derivative is not None:
        add_slopes(recipe, top, criteria.derivative.measure != "absolute")
    if criteria.curvature is not None:
        add_curvatures(recipe, top, criteria.curvature.name() == "rate")
    add_discontinuities(recipe, criteria, top, settings.finest, (height, width))
    add_states(recipe, criteria.diagonal, top)
    add_subsplats(recipe, top)
    return top


def _give_facts(recipe: Recipe, settings: ByGeometry, top: int) -> None:
    criteria = settings.criteria
    recipe.facts["multires"] = {
        "coarsest_level": top, "finest_level": settings.finest, "diagonal": criteria.diagonal, "rim": criteria.rim,
        "representative": settings.representative, "upsampling": settings.upsampling,
        **{name: None if one is None else {"kind": one.name(), **dataclasses.asdict(one)} for name, one in (
            ("depth", criteria.depth), ("derivative", criteria.derivative), ("normal", criteria.normal),
            ("curvature", criteria.curvature))}}
