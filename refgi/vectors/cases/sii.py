"""Splatting indirect illumination, from the buffers to the sum."""

from typing import Any

import numpy as np

from refgi.frame import Frame
from refgi.lights.shares import Pattern, map_shares
from refgi.lights.warp import Warp
from refgi.pairs.settings import PairSettings
from refgi.scene import Scene
from refgi.settings import of
from refgi.vectors.cases.scenes import BULB, DOWN, POLE, RAMP, SPOT, SUN, coloured, far_away, room
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.buffers import add_gbuffer, add_rsm, give_scene
from refgi.vectors.stages.lights import add_lights
from refgi.vectors.stages.pairs import add_footprints, add_sum


def splatting(
    id: str, what: str, scene: Scene, size: tuple[int, int], maps: int, counts: tuple[int, ...], *,
    clamp: str = "none", **options: Any,
) -> Case:
    """Return SII on a scene: buffers, lights, sum; `options` of `add_lights`."""
    recipe = Recipe(id, "sii", what)
    add_lit(recipe, scene, size, maps, counts, **options)
    pairs = of(PairSettings, clamp=clamp)
    if pairs.needs_footprints:
        add_footprints(recipe, len(counts))
    add_sum(recipe, pairs)
    return recipe.case()


def add_lit(
    recipe: Recipe, scene: Scene, size: tuple[int, int], maps: int, counts: tuple[int, ...], **options: Any
) -> None:
    """Add buffers and pixel lights: `size` (columns, rows) of the picture, texels of a map's side, lights a map."""
    give_scene(recipe, scene)
    add_gbuffer(recipe, scene, *size)
    for index in range(len(scene.lights)):
        add_rsm(recipe, scene, index, maps)
    add_lights(recipe, scene, maps, counts, **options)


def drawn(scene: Scene, maps: int, total: int, pattern: Pattern = "halton", seed: int = 0) -> tuple[int, ...]:
    """Return how many lights each lamp has of a total, as the methods share them out; `maps` texels along a side."""
    rsms = Frame(scene, width=1, height=1, dtype=np.float64, rsm_resolution=maps).rsms
    return tuple(share.drawn for share in map_shares(rsms, total, pattern, seed))


A3 = Warp("A", 3)
QUICK = {
    "sii-halton": lambda: splatting("sii-halton", "one spot, Halton points, no warp, no lobes", room(SPOT, matte=True),
                                    (24, 18), 13, (40,)),
    "sii-three-lamps": lambda: splatting(
        "sii-three-lamps", "spot, cube and directional maps of unequal strength; glossy and purely glossy surfaces",
        room(SPOT, BULB, SUN), (24, 18), 16, (24, 12, 12), shifts=((0.1, 0.2), (0.3, 0.45), (0.55, 0.7))),
    "sii-warp-a": lambda: splatting("sii-warp-a", "points warped by method A over 3 levels; clamped by discs",
                                    room(SPOT, BULB), (24, 18), 16, (40, 20), clamp="disc", warp=A3,
                                    shifts=((0.1, 0.2), (0.3, 0.45))),
    "sii-warp-b": lambda: splatting("sii-warp-b", "random points, given, warped by method B over 5 levels", room(SPOT),
                                    (17, 11), 13, (30,), pattern="given", warp=Warp("B", 5)),
    "sii-grid": lambda: splatting("sii-grid", "6 x 6 cells of a map; a light that shines straight down, a camera "
                                  "that looks straight down", room(DOWN, camera=POLE), (15, 21), 17, (36,),
                                  pattern="grid"),
    "sii-one-texel": lambda: splatting("sii-one-texel", "maps of one texel, two lights", room(SPOT, DOWN), (8, 6), 1,
                                       (1, 1), pattern="grid"),
    "sii-ramp": lambda: splatting("sii-ramp", "a spot of a squared ramp beside one of the smoothstep",
                                  room(RAMP, SPOT, matte=True), (12, 9), 11, (12, 8), shifts=((0.1, 0.2), (0.3, 0.45))),
}
FULL = {
    "sii-smooth": lambda: splatting("sii-smooth", "interpolated normals on a ball", room(SPOT, BULB, smooth=True),
                                    (32, 24), 24, (48, 24), shifts=((0.1, 0.2), (0.3, 0.45))),
    "sii-far-away": lambda: splatting("sii-far-away", "a scene at 100 km, in float32 to 8 mm",
                                      far_away(room(SPOT, matte=True), 1e5), (24, 18), 13, (40,)),
    "sii-colours": lambda: splatting("sii-colours", "vertex colours multiply the diffuse part, of glossy surfaces too",
                                     coloured(room(SPOT, BULB)), (24, 18), 13, (24, 12),
                                     shifts=((0.1, 0.2), (0.3, 0.45))),
    "sii-large": lambda: splatting("sii-large", "64 x 48 pixels, 256 lights of two lamps", room(SPOT, BULB), (64, 48),
                                   48, (128, 128), warp=A3, shifts=((0.1, 0.2), (0.3, 0.45))),
}
