"""Clustered visibility, from the buffers to the blurred sum."""

import math
from typing import Any

from refgi.cluster.settings import ValSettings
from refgi.draws import PIXEL_LIGHTS, draws
from refgi.scene import Camera, Scene, SpotLight
from refgi.settings import of
from refgi.vectors.cases.scenes import BULB, SPOT, far_away, kerbs, room, stacked
from refgi.vectors.cases.sii import add_lit, drawn
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.pairs import add_footprints
from refgi.vectors.stages.val import add_val

SEED = 1  # of the lights' shifts: without one, points lie on the borders of texels


class Setup:
    """What a case is made of, for the case and for the same picture by the method itself."""

    def __init__(
        self, id: str, what: str, scene: Scene, size: tuple[int, int], maps: int, lights: int,
        **settings: Any,
    ) -> None:
        self.id, self.what, self.scene, self.size, self.maps = id, what, scene, size, maps
        self.counts = list(drawn(scene, maps, lights, seed=SEED))
        plain = {"lights": lights, "seed": SEED, "clamp": "none", "maps_resolution": 15}
        self.settings = of(ValSettings, **plain | settings)

    def case(self) -> Case:
        """Return the case."""
        recipe = Recipe(self.id, "val", self.what)
        pairs = [draws(SEED, PIXEL_LIGHTS, 2, k).tolist() for k in range(len(self.counts))]
        shifts = tuple((u, v) for u, v in pairs)
        add_lit(recipe, self.scene, self.size, self.maps, tuple(self.counts), shifts=shifts)
        if self.settings.pairs.needs_footprints:
            add_footprints(recipe, len(self.counts))
        add_val(recipe, self.scene, self.settings)
        return recipe.case()


CLOSE = Camera((1.0, 1.05, 0.95), (-0.4, 0.35, -0.5), (0.1, 1.0, 0.0), math.radians(65))  # rolled, fills the picture
ABOVE = Camera((0.2, 2.5, 0.1), (0.15, 0.0, 0.1), (0.0, 0.0, -1.0), math.radians(34))  # sees no wall
BESIDE = Camera((1.5, 0.8, 1.6), (-0.1, 0.3, -0.3), (0.1, 1.0, 0.0), math.radians(50))  # sees what is below the table
FLOOR_LAMP = SpotLight((0.3, 1.6, 0.35), (-0.2, -1.0, -0.25), 0.2, 0.42, (4.0, 2.6, 1.3))

SETUPS = {setup.id: setup for setup in (
    Setup("val-csm", "convolution shadow maps by the defaults, maps of an odd side; two lamps, a cluster of one light, "
          "an area light that nothing occludes", room(SPOT, BULB, matte=True, camera=CLOSE), (17, 13), 16, 64,
          clusters=8, interleaving=1, clamp="disc"),
    Setup("val-pcss", "blockers texel by texel, interpolated normals, glossy lights",
          room(SPOT, smooth=True, camera=CLOSE), (17, 13), 13, 30, clusters=4, interleaving=1, visibility="pcss"),
    Setup("val-single", "more clusters asked for than lights, coincident lights: hard shadows",
          room(SPOT, matte=True, camera=CLOSE), (17, 13), 5, 16, clusters=30, interleaving=1),
    Setup("val-empty", "coincident lights at which clusters begin, so that some stay empty; depths in metres",
          room(SPOT, matte=True, smooth=True, camera=ABOVE), (15, 11), 3, 24, clusters=9, interleaving=1,
          depth_scale="map"),
    Setup("val-interleaved", "blocks of 3 x 3 pixels in a picture of odd size, PCF, blur with every subset; 4 m from "
          "the origin, pixels without surface, a ball", far_away(room(SPOT, BULB, matte=True, smooth=True), 4.0),
          (20, 14), 16, 36, clusters=5, interleaving=3, visibility="pcf", blur_extent=0.3),
    Setup("val-rim", "kerbs beside the lights, down to their plane: maps with geometry at the rim of the disc",
          kerbs(FLOOR_LAMP, camera=CLOSE), (15, 11), 9, 12, clusters=3, interleaving=1),
)}
FULL_SETUPS = {setup.id: setup for setup in (
    Setup("val-published", "the printed forms: raw distances, squares of alpha / pi, the search by solid angle; blocks "
          "of 4 x 4 pixels, lights by cluster, blur without missing subsets", room(SPOT, BULB, camera=CLOSE), (18, 14),
          16, 64, clusters=6, interleaving=4, assignment="cluster", every_subset=False, distance="raw",
          prefilter="brute", as_published=("val_alpha", "val_alpha_over_pi", "val_search_solid_angle")),
    Setup("val-options", "rectangles along the spread of lights, Delta the longer side, unbiased and foreshortened; 6 "
          "damped terms, V doubled and cut, depths up to the scene's end", room(SPOT, smooth=True), (17, 13),
          13, 40, clusters=4, interleaving=1, axes="pca", area_extent="longer", unbiased_area=True, foreshortened=True,
          terms=6, attenuation=1.0, rescale="scale2", depth_scale="scene", distance="squared"),
    Setup("val-bytes", "basis in 8 bits and half floats, as in the published textures",
          room(SPOT, matte=True, camera=CLOSE), (17, 13), 13, 24, clusters=4, interleaving=1,
          quantisation="published"),
    Setup("val-dual", "a second map behind each area light, PCF of 3 x 3 texels; a slab below the table that is lit",
          stacked(SPOT, BULB, camera=BESIDE), (20, 14), 13, 36, clusters=4, interleaving=1, visibility="pcf", texels=3,
          behind="dual_paraboloid"),
    Setup("val-projected", "texels of the map projected back onto the rectangle", kerbs(FLOOR_LAMP, camera=CLOSE),
          (15, 11), 13, 18, clusters=3, interleaving=1, visibility="back_projection"),
)}
QUICK = {id: setup.case for id, setup in SETUPS.items()}
FULL = {id: setup.case for id, setup in FULL_SETUPS.items()}
