"""Cases as plans: what a method's cases differ in."""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from refgi.scene import Scene
from refgi.vectors.spec import Case


class Plan(NamedTuple):
    """A case in the making."""

    what: str
    scene: Scene
    size: tuple[int, int]  # columns and rows of the picture
    maps: int  # texels along the side of a map
    lights: int = 0  # pixel lights of each map
    choices: Mapping[str, Any] = MappingProxyType({})  # settings by their keys


Plans = Mapping[str, Callable[[], Plan]]


def cases_of(plans: Plans, make: Callable[[str, Plan], Case]) -> dict[str, Callable[[], Case]]:
    """Return what makes the planned cases, by id; a scene is built when its case is."""
    def made(id: str) -> Case:
        return make(id, plans[id]())

    return {id: partial(made, id) for id in plans}
