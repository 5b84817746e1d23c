"""Hierarchical screen-space light, from the buffers to the picture, and its temporal filter."""

from typing import Any

from refgi.scene import Scene
from refgi.settings import of, replaced
from refgi.sssil.settings import PRESETS, HssilSettings
from refgi.vectors.cases.scenes import BULB, DOWN, POLE, SPOT, room
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.buffers import add_gbuffer, give_scene
from refgi.vectors.stages.direct import Shadows, add_direct
from refgi.vectors.stages.hssil import add_hssil

SETTINGS = {
    "hssil-default": of(HssilSettings, samples=12, radius=2.0, seed=3),
    "hssil-paper": replaced(PRESETS["paper"], {"sampling.samples": 12, "sampling.radius": 2.0}),
    "hssil-odd": of(HssilSettings, samples=9, radius=None, levels=5, start="full", seed=1),
}


def screen_space(
    id: str, what: str, scene: Scene, size: tuple[int, int], settings: HssilSettings, shadows: Shadows = "map",
) -> Case:
    """Return hssil on a scene: `size` (columns, rows) of the picture."""
    recipe = Recipe(id, "hssil", what, id)
    give_scene(recipe, scene)
    add_gbuffer(recipe, scene, *size)
    add_direct(recipe, scene, size, shadows)
    add_hssil(recipe, scene, size, settings)
    return recipe.case()


def _of(id: str, what: str, scene: Scene, size: tuple[int, int], **options: Any) -> Any:
    return lambda: screen_space(id, what, scene, size, SETTINGS[id], **options)


QUICK = {
    "hssil-default": _of("hssil-default", "interleaved samples, two lamps, 4 levels from half resolution, void beyond",
                         room(SPOT, BULB), (40, 28)),
    "hssil-paper": _of("hssil-paper", "the paper's settings: rows share samples, uniform density, no blur", room(SPOT),
                       (40, 28)),
    "hssil-odd": _of("hssil-odd", "13 x 11 pixels from full resolution down to one texel, a camera that looks straight "
                     "down, a purely glossy shelf below a lamp", room(DOWN, camera=POLE), (13, 11), shadows="exact"),
}
FULL: dict[str, Any] = {}
