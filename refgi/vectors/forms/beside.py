"""What a stage has beside its function: its literal form, lists of likely bugs, what its arrays are more than usual."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from refgi.types import Array
from refgi.vectors.rows import Edits, Form, called_by, code_of, edited
from refgi.vectors.spec import Arrays, Bug, Run

Arguments = Mapping[str, Any]
Names = Mapping[str, str]  # leaf of a stage's parameters or output: the case's name of that array

# a unit direction, by the inverse of its length, as many machines divide, and with components that are some roundings
# off at random, those of all lights at a receiver alike: as far as dot products are that are fused or summed in another
# order, where lights coincide and a lobe's exponent magnifies it
DIRECTION = "w = np.divide(d, r, out=np.zeros_like(d), where=r > 0)"
DIRECTIONS = ("w = d * np.divide(1, r, out=np.zeros_like(r), where=r > 0)", *(
    f"{DIRECTION}; size = w.shape[:1] + (1,) * (w.ndim - 2) + w.shape[-1:]; "
    f"w = w * (1 + 2.0**-23 * np.random.default_rng({seed}).uniform(-1, 1, size))" for seed in range(3)))
# the falloff as the square of that inverse
FALL = "fall = np.divide(1, square, out=np.zeros_like(square), where=r > 0)"
INVERSE = ((DIRECTION, DIRECTIONS[0]), (FALL, f"{FALL}; inverse = np.divide(1, r, out=np.zeros_like(r), where=r > 0); "
                                        "fall = np.where(np.asarray(area) > 0, fall, inverse * inverse)"))
NO_BUGS = "likely bugs"  # fact of a stage that has none, and why
MOST_WORK = 10_000_000  # a second and 600 MB for each likely bug


@dataclass(frozen=True)
class Described:
    """What a run of a stage has beside its function; arrays by leaf: parameter or field of the output."""

    form: Form | None = None
    # literal module, "" for the form's own, list of rows, and how many first ones of it where not all
    lists: tuple[tuple[str, str] | tuple[str, str, int], ...] = ()
    exact: tuple[str, ...] = ()  # leaves of parameters, as `Stage.exact`
    specs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # of an output's leaf: fields of its Spec
    paper: str = ""  # where the stage is described; that of its docstring where empty
    facts: Mapping[str, Any] = field(default_factory=dict)  # beside the numbers among the arguments
    factors: Mapping[str, float] = field(default_factory=dict)  # as `Case.factors`: "T/N"
    variants: tuple[Callable[[Run, Names, Names], Run], ...] = ()  # other ways, of the stage, what it reads and writes
    bugs: tuple[Callable[[Run, Names, Names], tuple[Bug, ...]], ...] = ()  # those that are no rows, likewise
    without: tuple[str, ...] = ()  # words of causes of rows that cannot show
    work: int = 0  # of the form: triangles times texels; rows are left out beyond `MOST_WORK`


def form_of(
    function: Callable[..., Any], arguments: Arguments, writes: tuple[str, ...] = ("",),
    others: Mapping[str, Any] = {}, *, double: bool = False,
    adapt: Mapping[str, Callable[[Array], Array]] | None = None,
) -> Form:
    """Return the literal form of a stage whose parameters have the names of the literal function's.

    Arrays of equal names are read, and tuples of arrays; numbers and texts are taken as they are, what is None is left
    to its default.
    `others`: for parameters of other names, the leaf or tuple of leaves to read, or the value of what is no text.
    """
    reads, numbers = dict[str, Any](), dict[str, Any]()
    for name in inspect.signature(function).parameters:
        value = others.get(name, arguments.get(name))
        if name in others and isinstance(value, str | tuple):
            reads[name] = value
        elif isinstance(value, np.ndarray) and name not in others:
            reads[name] = name
        elif isinstance(value, tuple) and value and all(isinstance(one, np.ndarray) for one in value):
            reads[name] = tuple(f"{name}.{k}" for k in range(len(value)))
        elif value is not None:
            numbers[name] = value
    return Form(function, reads, writes, numbers, adapt=adapt or {}, double=double)


def alone(
    function: Callable[..., Any], writes: tuple[str, ...] = ("",), exact: tuple[str, ...] = (), *,
    lists: tuple[str, ...] | None = None, others: Mapping[str, Any] = {},
    adapt: Mapping[str, Callable[[Array], Array]] | None = None, **more: Any,
) -> Callable[[Arguments], Described]:
    """Return what describes a stage by its literal function alone, with the rows of that function's name."""
    rows = (function.__name__,) if lists is None else lists
    return lambda arguments: Described(
        form_of(function, arguments, writes, others, adapt=adapt), own(*rows), exact, **more)


def written(form: Form, *ways: Edits) -> tuple[Callable[[Run, Names, Names], Run], ...]:
    """Return other ways in which ports write a form in float32: legal edits of its text, float32 throughout."""
    def variant(edits: Edits, stage: Run, reads: Names, writes: Names) -> Run:  # noqa: ARG001
        single = dataclasses.replace(form.named(reads, writes), function=edited(form.function, edits, "variant"),
                                     double=False)

        def run(arrays: Arrays, real: Any) -> Arrays:
            with np.errstate(all="ignore"):  # texels without a surface
                return single(arrays, real)

        return run

    return tuple(partial(variant, one) for one in ways)


def ways(form: Form) -> tuple[Callable[[Run, Names, Names], Run], ...]:
    """Return other ways in which ports write a form that follows unit directions from lights to receivers."""
    texts = [code_of(one) for one in called_by(form.function)]
    follows = any(DIRECTION in one for one in texts)
    inverse = (INVERSE,) if any(DIRECTION in one and FALL in one for one in texts) else ()
    return written(form, *(((DIRECTION, other),) for other in DIRECTIONS), *inverse) if follows else ()


def own(*lists: str) -> tuple[tuple[str, str], ...]:
    """Return lists of rows of the form's own literal module."""
    return tuple(("", one) for one in lists)


def ids(covered: Array) -> Array:
    """Return triangle ids of receivers of which only whether there is one may be known."""
    return np.where(covered, np.int32(0), np.int32(-1)) if covered.dtype == np.bool_ else covered
