"""Clustered visibility, from the buffers to the blurred sum."""

from typing import Any

from refgi.cluster.settings import ValSettings
from refgi.scene import Scene
from refgi.settings import of
from refgi.vectors.cases.scenes import BULB, SPOT, room
from refgi.vectors.cases.sii import add_lit
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.pairs import add_footprints
from refgi.vectors.stages.val import add_val


class Setup:
    """What a case is made of, for the case and for the same picture by the method itself."""

    def __init__(
        self, id: str, what: str, scene: Scene, size: tuple[int, int], maps: int, lights: int,  # noqa: A002
        **settings: Any,
    ) -> None:
        self.id, self.what, self.scene, self.size, self.maps = id, what, scene, size, maps
        self.counts = [lights // len(scene.lights)] * len(scene.lights)
        self.settings = of(ValSettings, **{"lights": lights, "clamp": "none", "maps_resolution": 15} | settings)

    def case(self) -> Case:
        """Return the case."""
        recipe = Recipe(self.id, "val", self.what, self.id)
        add_lit(recipe, self.scene, self.size, self.maps, tuple(self.counts))
        if self.settings.pairs.needs_footprints:
            add_footprints(recipe, len(self.counts))
        add_val(recipe, self.scene, self.settings)
        return recipe.case()


SETUPS = {setup.id: setup for setup in (
    Setup("val-csm", "convolution shadow maps, log depth, mip map of an odd side; two lamps, all lights at each pixel",
          room(SPOT, BULB, matte=True), (17, 13), 13, 48, clusters=6, interleaving=1),
    Setup("val-pcss", "blockers texel by texel, interpolated normals, glossy lights", room(SPOT, smooth=True), (17, 13),
          13, 30, clusters=4, interleaving=1, visibility="pcss"),
    Setup("val-single", "more clusters asked for than lights, coincident lights: hard shadows", room(SPOT, matte=True),
          (17, 13), 4, 12, clusters=30, interleaving=1),
    Setup("val-interleaved", "blocks of 3 x 3 pixels in a picture of odd size, PCF, blur with every subset",
          room(SPOT, BULB, matte=True), (20, 14), 13, 36, clusters=5, interleaving=3, visibility="pcf"),
)}
QUICK = {id: setup.case for id, setup in SETUPS.items()}
FULL: dict[str, Any] = {}
