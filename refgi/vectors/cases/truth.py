"""The ground truth of small pictures."""

from typing import Any

from refgi.scene import Scene
from refgi.settings import of
from refgi.truth.settings import TruthSettings
from refgi.vectors.cases.scenes import BULB, SPOT, SUN, Plan, recorded_plan, room
from refgi.vectors.spec import Case

SIZE = (20, 14)  # columns, rows
PLAIN = {"estimator": "hemisphere", "directions": 64, "samples": 2048, "seed": 1}  # as a port would first write it
VIEWS: dict[str, tuple[Scene, TruthSettings]] = {
    "truth-one-bounce": (room(SPOT, BULB, SUN), of(TruthSettings, **PLAIN)),
    "truth-matte": (room(SPOT, matte=True), of(TruthSettings, **PLAIN)),
    "truth-visible": (room(SPOT, BULB, matte=True), of(TruthSettings, **PLAIN, emitters="visible", visibility=False)),
    "truth-two-bounces": (room(SPOT, BULB), of(TruthSettings, **PLAIN, bounces=2)),
    "truth-smooth": (room(SPOT, BULB, smooth=True), of(TruthSettings, **PLAIN)),
}


def traced(id: str, what: str) -> Case:
    """Return path-traced light of a scene."""
    scene, settings = VIEWS[id]
    return recorded_plan(id, Plan(what, scene, SIZE, 1, shadows="exact"), "truth", settings)


QUICK = {
    "truth-one-bounce": lambda: traced("truth-one-bounce", "light of three lamps after one bounce, glossy and purely "
                                       "glossy surfaces"),
    "truth-matte": lambda: traced("truth-matte", "diffuse surfaces alone, one lamp"),
    "truth-visible": lambda: traced("truth-visible", "only what the camera sees emits and nothing blocks: what a "
                                    "screen-space method can find"),
}
FULL: dict[str, Any] = {
    "truth-two-bounces": lambda: traced("truth-two-bounces", "light after one and two bounces"),
    "truth-smooth": lambda: traced("truth-smooth", "a ball with interpolated normals"),
}
