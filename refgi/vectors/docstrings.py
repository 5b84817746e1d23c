"""What arrays are: axes, unit, text, source, from the docstrings of stages and the comments beside fields.

Of a scene, its lamps and views, which no stage makes, `INPUTS` says it.
"""

import ast
import functools
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

from refgi import stages
from refgi.rsm.raster.projection import ORTHOGRAPHIC
from refgi.types import Array
from refgi.vectors.spec import Spec

UNIT = re.compile(r"(?<![\w^/])(W/m\^2/sr|W/m\^2|W/sr|W|m\^2|m|sr|rad)(?![\w^/])")
SHAPE = re.compile(r"^\(([^()]*)\)")
SOURCE = re.compile(r" \(((?:SII|VAL|AMS|HSS|RSM|E-|docs/)[^()]*)\)\.?$")  # ends a stage's first line: section, erratum
MANY = "sequence|tuple|list|mapping|dict"
TAKEN = re.compile(rf"(\w+(?:, \w+)*)(?: ((?:[({{A-Z]|{MANY}).*?))?: (.*)")
RETURNED = re.compile(rf"-> (?:(?!(?:{MANY}) )([a-z]\w*(?:, [a-z]\w*)*) )?(\S.*?): (.*)")
AXES = {"h": "row", "w": "column", "H": "row", "W": "column", "h_l": "row", "w_l": "column", "h x w": "row, column"}
COLOURED = re.compile(r"reflectance|linear RGB")  # has channels, whatever its unit
COLOUR = ("W", "W/m^2", "W/m^2/sr", "W/sr")


def summary(function: Callable[..., Any]) -> tuple[str, str]:
    """Return what a stage does and where that is said: its docstring's first line, and the source in brackets there."""
    line = (inspect.getdoc(function) or function.__name__).splitlines()[0]
    source = SOURCE.search(line)
    return line[:source.start()] if source else line.rstrip("."), source[1] if source else ""


class Told(NamedTuple):
    """What is said of an array or another argument."""

    kind: str  # shape and type; "" where a comment or an annotation says it
    text: str


def taken(function: Callable[..., Any]) -> dict[str, Told]:
    """Return what a stage's docstring says of its parameters, else its module's, else that of `refgi.stages`."""
    return {name: told for place in (stages, sys.modules[function.__module__], function)
            for name, told in entries(place, TAKEN).items()}


def returned(function: Callable[..., Any]) -> dict[str, Told]:
    """Return what a stage's docstring says of what it returns, by name in order; "" where it has none."""
    return entries(function, RETURNED)


@functools.cache
def entries(thing: Any, form: re.Pattern[str]) -> dict[str, Told]:
    """Return what the lines of one form in a stage's docstring, or the list in a module's, say below its first line."""
    text = re.split(r"\n\w+\n--", (inspect.getdoc(thing) or "").partition("\n")[2])[0]
    mark = "- " if inspect.ismodule(thing) else ""
    lines = (" ".join(one.split()).removeprefix(mark) for one in re.split(r"\n(?=\S|\n)", text) if mark in one[:2])
    return {name: Told(one[2] or "", one[3]) for one in map(form.fullmatch, lines) if one
            for name in (one[1] or "").split(", ")}


def documented(function: Callable[..., Any]) -> tuple[dict[str, Told], dict[str, Told]]:
    """Return type and text of all that a stage takes and returns; "" where there is no text."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    told, made = taken(function), {}
    for one in (*tree.args.args, *tree.args.kwonlyargs):
        annotation = ast.unparse(one.annotation).strip("'") if one.annotation else ""
        kind, text = told.get(one.arg) or Told("", _of_class(annotation, sys.modules[function.__module__]))
        made[one.arg] = Told(kind + ", optional" * ("None" in annotation) if kind else annotation, text)
    return made, returned(function)


def _of_class(annotation: str, module: Any) -> str:
    """Return the first line of the first class of refgi that an annotation names."""
    modules = (module, *(sys.modules[key] for key in sorted(sys.modules) if key.startswith("refgi.")))
    classes = (vars(one).get(name) for name in re.findall(r"\b[A-Z]\w*", annotation) for one in modules)
    return next(((one.__doc__ or "").splitlines()[0] for one in classes if isinstance(one, type)
                 and one.__module__.startswith("refgi.")), "")


def field_description(value: Any, leaf: str) -> Told | None:
    """Return the comment or docstring of a field of a value, of the last one that a dotted name goes through."""
    said = ""
    for field in leaf.split(".") if leaf else []:
        of = type(value)
        prop = getattr(of, field, None)
        if isinstance(prop, property):
            said = inspect.cleandoc(prop.__doc__ or "")
        elif hasattr(of, "__annotations__") and field in of.__annotations__:
            found = re.search(rf"^    {field}: .*?  # (.*)$", inspect.getsource(of), re.MULTILINE)
            said = found[1] if found else said
        value = value[int(field)] if isinstance(value, list | tuple) and field.isdigit() else (
            value.get(field) if isinstance(value, Mapping) else getattr(value, field, None))
    return Told("", said) if said else None


def spec_of(told: Told | None, array: Array, name: str) -> Spec:
    """Return what an array is, as far as a line says: its axes by the shape written there, its unit, the text."""
    about = " ".join(told).strip() if told else ""
    shape = SHAPE.search(about) or re.search(r"\((?:\d+|[A-Za-z]\w*'?)(?:, (?:\d+|[A-Za-z]\w*'?))*,?\)", about)
    names = [one.strip() for one in (shape[1] if shape and shape.re is SHAPE else shape[0].strip("()") if shape else
                                     "").split(",") if one.strip()]
    unit = UNIT.search(about) if array.dtype.kind == "f" else None
    colour = (unit[1] if unit else "") in COLOUR or COLOURED.search(about) is not None
    axes = [("rgb" if colour else "xyz") if one == "3" else AXES.get(one, one) for one in names]
    if len(axes) != array.ndim:
        axes = [f"axis {k}" for k in range(array.ndim)]
    twice = {one for one in axes if axes.count(one) > 1}
    axes = [f"{one} {k}" if one in twice else one for k, one in enumerate(axes)]
    space = "world" if "xyz" in axes else "linear RGB" if "rgb" in axes else ""
    return Spec(", ".join(axes) or "value", unit[1] if unit else "1", (told.text if told else "") or name, space)


INPUTS = {
    "scene.vertices": Spec("vertex, xyz", "m", "Corners of triangles.", "world"),
    "scene.faces": Spec("triangle, corner", "1", "Indices of vertices."),
    "scene.material_of_face": Spec("triangle", "1", "Indices of materials."),
    "scene.vertex_normals": Spec("vertex, xyz", "1", "Unit normals, interpolated over triangles.", "world"),
    "scene.uv": Spec("triangle, corner, uv", "1", "Texture coordinates."),
    "scene.colours": Spec("triangle, corner, rgb", "1", "Factors of the diffuse reflectance, linear between corners.",
                          "linear RGB"),
    "materials.diffuse": Spec("material, rgb", "1", "Reflectance of the diffuse part.", "linear RGB"),
    "materials.specular": Spec("material, rgb", "1", "Reflectance of the Phong lobe.", "linear RGB"),
    "materials.exponent": Spec("material", "1", "Phong exponent."),
    "materials.ior": Spec("material", "1", "Index of refraction; 0 where opaque."),
    "materials.emission": Spec("material, rgb", "W/m^2/sr", "Radiance.", "linear RGB"),
    "projection.origin": Spec("map, xyz", "m", "Centre of each perspective map; of a parallel one that of depth 0.",
                              "world"),
    "projection.frame": Spec("map, (right, down, forward), xyz", "1", "Axes of each map, unit vectors.", "world"),
    "projection.half": Spec("(horizontal, vertical)", "1", "Half extent of the map on the image plane at distance 1."),
    "parallel.half": Spec("(horizontal, vertical)", "m", "Half extent of the map."),
    "lamp.strength": Spec("rgb", "W/sr", "Radiant intensity, of a spot on its axis.", "linear RGB"),
    "sun.strength": Spec("rgb", "W/m^2", "Irradiance of a surface across the light.", "linear RGB"),
    "lamp.place": Spec("xyz", "m", "Place of the lamp.", "world"),
    "lamp.direction": Spec("xyz", "1", "Where it shines to, any length.", "world"),
    "lamp.half_angles": Spec("(inner, outer)", "rad", "Half-angles of the cone: full light within, none beyond."),
}


def input_spec(name: str, value: Any, beside: Collection[str]) -> Spec | None:
    """Return what a given array is, from its name, the parameter it is in and the leaves beside it; None: unknown."""
    start, _, field = name.rpartition(".")
    last = start.rpartition(".")[2]
    if last == "lamp" and field == "strength" and not any(leaf.endswith("lamp.place") for leaf in beside):
        last = "sun"
    if last == "projection" and field == "half" and value.kind == ORTHOGRAPHIC:
        last = "parallel"
    return INPUTS.get(f"{last}.{field}")
