"""Cases as plans: what a method's cases differ in, and how they are recorded."""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from refgi.frame import Shadows
from refgi.scene import Scene
from refgi.vectors.recorded import recorded_case
from refgi.vectors.spec import Case


class Plan(NamedTuple):
    """A case in the making."""

    what: str
    scene: Scene
    size: tuple[int, int]  # columns and rows of the picture
    maps: int  # texels along the side of a map
    lights: int = 0  # pixel lights of each map
    choices: Mapping[str, Any] = MappingProxyType({})  # settings by their keys
    shadows: Shadows | None = None  # of direct light; None: as a frame has them by default


Plans = Mapping[str, Callable[[], Plan]]


def cases_of(plans: Plans, make: Callable[[str, Plan], Case]) -> dict[str, Callable[[], Case]]:
    """Return what makes the planned cases, by id; a scene is built when its case is."""
    def made(id: str) -> Case:
        return make(id, plans[id]())

    return {id: partial(made, id) for id in plans}


def recorded_plan(id: str, plan: Plan, method: str, settings: Any) -> Case:
    """Return what a method does as planned, from the scene to the indirect irradiance."""
    return recorded_case(id, plan.scene, method, settings, what=plan.what, indirect=True, width=plan.size[0],
                         height=plan.size[1], rsm_resolution=plan.maps,
                         shadows=plan.shadows)
