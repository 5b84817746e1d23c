"""The table of built-in scenes, and names with parameters such as ``"atrium:faces=1000000,seed=3"``."""

import dataclasses
import inspect
import math
from collections.abc import Callable, Mapping
from functools import cached_property

from refgi.errors import InputError, expect
from refgi.scene.builtin.atrium import atrium, textured_atrium
from refgi.scene.builtin.cornell import cornell_box, cornell_sphere, integrating_sphere, parallel_plates, wedge
from refgi.scene.builtin.stage import glass_ball, leaf_grid, ring, stage
from refgi.scene.builtin.surfaces import metaballs
from refgi.scene.files import did_you_mean
from refgi.scene.model import Scene

Value = int | float


@dataclasses.dataclass(frozen=True)
class BuiltinScene:
    """One row of the table: what the scene shows, its default number of triangles, and the function that builds it."""

    name: str
    summary: str
    faces: int
    builder: Callable[..., Scene]

    @cached_property
    def parameters(self) -> Mapping[str, Value]:
        """Names of the parameters and their defaults."""
        return {name: given.default for name, given in inspect.signature(self.builder).parameters.items()}

    def build(self, **parameters: Value) -> Scene:
        """Return the scene, with some parameters other than their defaults.

        Raises InputError if a parameter is unknown, of the wrong type or out of its range.
        """
        checked = {name: self._checked(name, value) for name, value in parameters.items()}
        try:
            return self.builder(**checked)
        except MemoryError as error:
            raise InputError(f"{self.name}: {dict(checked)} does not fit in memory") from error
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error

    def _checked(self, name: str, value: Value) -> Value:
        known = ", ".join(self.parameters) or "none"
        if name not in self.parameters:
            raise InputError(f"{self.name}: expected a parameter among {known}; got {name!r}"
                             f"{did_you_mean(name, self.parameters)}")
        label, wants_integer = f"{self.name}: {name}", isinstance(self.parameters[name], int)
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        expect(is_number and (not wants_integer or value == int(value)), label,
               "an integer" if wants_integer else "a finite number", value)
        return int(value) if wants_integer else float(value)


SCENES: dict[str, BuiltinScene] = {
    row.name: row
    for row in (
        BuiltinScene("cornell_box", "The measured Cornell box, a spot under the ceiling tilted at the red wall",
                     30, cornell_box),
        BuiltinScene("cornell_sphere", "A tessellated sphere in the Cornell box", 16_990, cornell_sphere),
        BuiltinScene("atrium", "A colonnade of two storeys with curtains, a spot from above into its courtyard",
                     250_000, atrium),
        BuiltinScene("textured_atrium", "The atrium with masonry, plaster, tiles and cloth as textures made in code",
                     250_000, textured_atrium),
        BuiltinScene("leaf_grid", "Leaves cut out of quads by alpha in a room, lit from above", 728, leaf_grid),
        BuiltinScene("integrating_sphere", "Inside a diffuse sphere: one bounce is the same everywhere, in closed form",
                     20_000, integrating_sphere),
        BuiltinScene("wedge", "Two plates that meet in an edge, one evenly lit: closed form", 4, wedge),
        BuiltinScene("parallel_plates", "A plate over a floor lit by a spot: closed form on the axis", 4,
                     parallel_plates),
        BuiltinScene("ring", "A polished metal ring whose caustic falls inside it", 20_482, ring),
        BuiltinScene("glass_ball", "A clear glass ball whose caustic falls into its shadow", 20_488, glass_ball),
        BuiltinScene("metaballs", "A blob whose pieces join and part with time t, over the stage", 6_160, metaballs),
        BuiltinScene("stage", "A slightly glossy vase on a stage with three coloured walls", 6_328, stage),
    )
}


def builtin_scenes() -> dict[str, BuiltinScene]:
    """Return the table of built-in scenes by name.

    Returns
    -------
    dict of str to BuiltinScene
        A fresh dict; no scene is built.
    """
    return dict(SCENES)


def build_named(text: str) -> Scene:
    """Build a scene from its name and parameters, ``name`` or ``name:key=value,key=value``.

    Parameters
    ----------
    text : str
        The name and what differs from its defaults.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If the name, a parameter or a value cannot be understood.
    """
    name, _, listed = text.partition(":")
    if name not in SCENES:
        raise InputError(f"scene: expected one of {', '.join(SCENES)}; got {name!r}{did_you_mean(name, SCENES)}")
    parameters: dict[str, Value] = {}
    for item in listed.split(",") if listed.strip() else []:
        key, equals, value = (part.strip() for part in item.partition("="))
        expect(bool(key and equals and value), name, "parameters as key=value, separated by commas", item)
        expect(key not in parameters, f"{name}: {key}", "each parameter once", text)
        parameters[key] = _number(value, f"{name}: {key}")
    return SCENES[name].build(**parameters)


def _number(text: str, label: str) -> Value:
    for read in (int, float):
        try:
            return read(text)
        except ValueError:
            continue
    raise InputError(f"{label}: expected a number, got {text!r}")
