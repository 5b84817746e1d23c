"""Vertex colours in stages of buffers: a factor of what the diffuse part reflects, where a scene has them."""

import dataclasses

import numpy as np

from refgi.literal.colours import tint
from refgi.scene import Geometry
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Run, Spec

COLOURS = "scene.colours"


def give_colours(recipe: Recipe, geometry: Geometry) -> None:
    """Give the colours of a scene that has some."""
    if geometry.colours is not None:
        recipe.give(COLOURS, geometry.colours, Spec(
            "triangle, corner, rgb", "1", "factors of the diffuse reflectance, linear between corners", "linear RGB"))


def colours_read(recipe: Recipe, *others: str) -> tuple[str, ...]:
    """Return what a stage reads of vertex colours, and with them, if there are any."""
    return (COLOURS, *others) if COLOURS in recipe.specs else ()


class Tinted:
    """A stage whose array `target` vertex colours multiply: as a port does it, and as it gets it wrong.

    `run`: the stage. `name`: the view, whose points are among what the stage reads or writes.
    """

    def __init__(self, run: Run, name: str, target: str) -> None:
        self._run, self._point, self._target = run, f"{name}.position", target
        self._form = Form(tint, {"triangle_id": f"{name}.triangle_id", "position": self._point,
                                 "vertices": "scene.vertices", "faces": "scene.faces", "colours": COLOURS}, (target,))

    def variant(self) -> Run:
        """Return the stage with the literal colours in place of refgi's."""
        return self._times(self._form)

    def bugs(self) -> tuple[Bug, ...]:
        """Return likely bugs of the colours; those of the rest are told by cases without any."""
        white = reading(self._run, materials__diffuse=np.ones_like)
        return (*(dataclasses.replace(bug, run=self._times(bug.run)) for bug in self._form.bugs("tint")),
                Bug("vertex colours replace the material's reflectance", white, "reflectance times vertex colour"))

    def specular_bug(self, lobe: str) -> Bug:
        """Return the bug of colours that multiply an array of lobes too."""
        def altered(arrays: Arrays, real: object) -> Arrays:
            made = dict(self._run(arrays, real))
            return made | {lobe: made[lobe] * self._form(arrays, real)[self._target]}

        return Bug("vertex colours multiply the specular part too", altered, "a factor of the diffuse part alone")

    def _times(self, factor: Run) -> Run:
        def altered(arrays: Arrays, real: object) -> Arrays:
            made = dict(self._run({name: one for name, one in arrays.items() if name != COLOURS}, real))
            colour = factor({**made, **arrays}, real)[self._target]
            return made | {self._target: made[self._target] * colour}

        return altered
