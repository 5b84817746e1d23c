"""What arrays are, from the docstrings of stages and the comments beside fields: axes, unit, text, source."""

import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any

from refgi.vectors.spec import Array, Spec

UNIT = re.compile(r"(?<![\w^/])(W/m\^2/sr|W/m\^2|W/sr|W|m\^2|m|sr|rad)(?![\w^/])")
SHAPE = re.compile(r"^\(([^()]*)\)")
SOURCE = re.compile(r" \(((?:SII|VAL|AMS|HSS|RSM|E-|docs/)[^()]*)\)\.?$")  # ends a stage's first line: section, erratum
TYPE = re.compile(r"^.*(?:ndarray(?: of \w+)?|array_like) ")
AXES = {"h": "row", "w": "column", "H": "row", "W": "column", "h_l": "row", "w_l": "column", "h x w": "row, column"}
COLOURED = re.compile(r"reflectance|linear RGB")  # has channels, whatever its unit
COLOUR = ("W", "W/m^2", "W/m^2/sr", "W/sr")


def summary(function: Callable[..., Any]) -> tuple[str, str]:
    """Return what a stage does and where that is said: its docstring's first line, and the source in brackets there."""
    line = (inspect.getdoc(function) or function.__name__).splitlines()[0]
    source = SOURCE.search(line)
    return line[:source.start()] if source else line.rstrip("."), source[1] if source else ""


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Return what a stage's docstring says of its parameters: type, then text."""
    return _section(function, "Parameters")


def returned(function: Callable[..., Any]) -> dict[str, str]:
    """Return what a stage's docstring says of what it returns, by name in order; "" where it has none."""
    return _section(function, "Returns")


def _section(function: Callable[..., Any], section: str) -> dict[str, str]:
    text = inspect.cleandoc(function.__doc__ or "")
    part = re.search(rf"^{section}\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    found: dict[str, str] = {}
    for entry in re.split(r"\n(?=\S)", part[1].rstrip()) if part else []:
        head, _, about = entry.partition("\n")
        names, colon, kind = head.partition(" : ")
        for name in names.split(", ") if colon else [""]:
            found[name] = f"{kind if colon else head} {' '.join(about.split())}"
    return found


def field_description(value: Any, leaf: str) -> str:
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
    return said


def spec_of(about: str, array: Array, name: str) -> Spec:
    """Return what an array is, as far as a line says: its axes by the shape written there, its unit, the text."""
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
    return Spec(", ".join(axes) or "value", unit[1] if unit else "1", TYPE.sub("", about) or name, space)
