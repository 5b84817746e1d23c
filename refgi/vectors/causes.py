"""Likely causes of a difference: hypotheses that turn the expected array into the one that a port has. NumPy alone.

A hypothesis explains a difference where it predicts what the port has, element by element, at nearly all elements.
Those of this module hold for any array: factors, signs, axes that are flipped, exchanged or shifted, coding of values,
order. A kit adds those of each stage as arrays (`BugEntry`).
"""

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import distance, large_value
from refgi.vectors.manifest import ArrayEntry, Cause
from refgi.vectors.spec import axes_of

EXPLAINED = 0.9  # share of the differing elements from which on a hypothesis counts
SEEN = EXPLAINED  # share of what is seen without a hypothesis: one that explains more comes first
ROOM = 8.0  # how much farther off than its bound an explained element may be: the bug changes the rounding too
FEWEST = 4  # elements that a factor can be told from
NEARER = 0.25  # of its distance from what is expected: how near an element must be to what explains it
SORTED = 1e-3  # the same, of elements in order
SLIGHT = 100.0  # bounds: a difference without an explanation that stays below may be rounding
SINGLE = 2.0**-22
TILES = (4, 8, 16, 32, 64, 128, 256)  # sides of groups of threads
CONSTANT = "all elements are "
STEPS = {0.5: "texel centres for corners, or corners for centres", 1: "rounded to the nearest or upwards, not down"}
FEW_VALUES = 8  # of whole numbers: states, not indices
FACTORS = {"2": 2.0, "1/2": 0.5, "pi": np.pi, "1/pi": 1 / np.pi, "2 pi": 2 * np.pi, "1/(2 pi)": 0.5 / np.pi,
           "4 pi": 4 * np.pi, "1/(4 pi)": 0.25 / np.pi, "pi^2": np.pi**2, "1/pi^2": np.pi**-2, "4": 4.0, "1/4": 0.25,
           "3": 3.0, "1/3": 1 / 3, "-1": -1.0, "-2": -2.0, "1000": 1000.0, "1/1000": 1e-3, "100": 100.0, "1/100": 0.01,
           "255": 255.0, "1/255": 1 / 255, "2/pi": 2 / np.pi, "pi/2": np.pi / 2, "180/pi": 180 / np.pi,
           "pi/180": np.pi / 180, "6": 6.0, "1/6": 1 / 6}


class Difference(NamedTuple):
    """An array that is out."""

    name: str
    entry: ArrayEntry
    expected: Array
    got: Array  # of the same shape
    out: Array  # elements beyond their bounds
    limit: Array  # the bounds

    @property
    def noisy(self) -> bool:
        """Whether the array is an estimate, whose noise hides single elements."""
        return self.entry.tier == "T3" and self.expected.dtype.kind == "f"


def explain(
    difference: Difference, factors: Mapping[str, float], others: Mapping[str, Array]
) -> list[Cause]:
    """Return the causes that explain a difference, the likeliest first; none where they explain less than `EXPLAINED`.

    `factors`: numbers of the case that a port may forget or repeat; `others`: expected arrays of the case, one of which
    the port may have written in this one's place.
    """
    found = told_at_once(difference)
    if not found or found[0].cause.startswith(CONSTANT):  # a factor may say more
        guesses = [*_factors(difference, factors), *_axes(difference), *_coded(difference), *_indices(difference),
                   *_taken_for(difference, others), *_running_sums(difference), *_depth_buffer(difference)]
        found += [Cause(cause=cause, share=share) for cause, predicted in guesses
                  if (share := explained(difference, predicted)) >= EXPLAINED]
        found = found or [*_at_one_place(difference, factors)] or [*_at_some(difference, factors)] or [
            *_order(difference), *_slight(difference)]
    unique = {cause.cause: cause for cause in sorted(found, key=lambda one: -round(one.share, 2))}
    return list(unique.values())


def _at_one_place(difference: Difference, factors: Mapping[str, float]) -> Iterator[Cause]:
    """Yield what explains a difference that lies in one channel, component or other place of an axis alone."""
    at, names = np.argwhere(difference.out), axes_of(difference.entry.axes)
    if len(names) != difference.out.ndim:
        return
    for axis, name in enumerate(names):
        size, indices = difference.out.shape[axis], np.unique(at[:, axis])
        if size < 2 or len(indices) > 1 or len(at) < FEWEST:
            continue
        index = int(indices[0])
        expected, got, out, limit = (np.take(one, index, axis) for one in difference[2:])
        rest = ", ".join(names[:axis] + names[axis + 1 :])
        entry = difference.entry.model_copy(update={"axes": rest})
        part = Difference(difference.name, entry, expected, got, out, limit)
        guesses = [*_factors(part, factors), *_coded(part)]
        others = [(f"it holds {name} {k}", np.take(difference.expected, k, axis)) for k in range(size) if k != index]
        taken = [one for one in others if explained(part, one[1]) >= EXPLAINED]
        for cause, predicted in [*guesses, *(taken if len(taken) == 1 else [])]:  # several: they are alike
            if (share := explained(part, predicted)) >= EXPLAINED:
                yield Cause(cause=f"at {name} {index} alone: {cause}", share=share)


def _at_some(difference: Difference, factors: Mapping[str, float]) -> Iterator[Cause]:
    """Yield a factor that has a name, or a step of 1/2 or one index, that all elements which differ have in common."""
    expected, got, out = difference.expected, difference.got, difference.out
    step = {"f": 0.5, "i": 1}.get(expected.dtype.kind)
    if step is None or np.count_nonzero(out) < FEWEST or (step == 1 and len(np.unique(expected)) <= FEW_VALUES):
        return
    factor, _, name = _factor(difference, factors)
    said = "of the wrong sign" if name == "-1" else f"{name} times what it should be{_missing(name)}"
    guesses = [] if name is None else [(said, factor * expected)]
    way = 1 if np.mean(got[out] > expected[out]) > 0.5 else -1
    guesses += [(f"{step} too {'large' if way > 0 else 'small'}: {STEPS[step]}", expected + way * step)]
    for cause, predicted in guesses:
        if (share := explained(difference, np.where(out, predicted, expected))) >= EXPLAINED:
            yield Cause(cause=f"every element that differs is {cause}", share=share)


def told_at_once(difference: Difference) -> list[Cause]:
    """Return what is seen without a hypothesis; none where bytes are swapped, which makes numbers that are none."""
    swapped = difference.expected.astype("<f4").view("<u4").byteswap().view("<f4")
    if difference.expected.dtype.kind == "f" and np.array_equal(swapped, difference.got, equal_nan=True):
        return [Cause(cause="bytes are swapped (big-endian)", share=1.0)]
    return [*_plain(difference)]


def places_of(difference: Difference) -> list[Cause]:
    """Return where a difference without a cause lies: what all elements that differ have in common."""
    at = np.argwhere(difference.out)
    names = axes_of(difference.entry.axes)
    if not len(at) or len(names) != difference.out.ndim:
        return []
    found = ["they are 0 here"] if not difference.got[difference.out].any() else []
    found += ["0 is expected of all of them"] if not difference.expected[difference.out].any() else []
    for axis, name in enumerate(names):
        size, indices = difference.out.shape[axis], np.unique(at[:, axis])
        if size > 1 and len(indices) == 1:
            found.append(f"all lie at {name} {indices[0]}{' (the last)' if indices[0] == size - 1 else ''}")
        elif size > 4 and len(indices) == 2 and indices[0] == 0 and indices[1] == size - 1:
            found.append(f"all lie in the first and the last {name}")
    share = len(at) / difference.out.size
    return [Cause(cause=f"no known cause fits; {share:.0%} of {difference.name} differ" + (
        f": {', '.join(found)}" if found else ""), share=0.0)]


def explained(difference: Difference, predicted: Array, places: Array | None = None) -> float:
    """Return the share of elements that a prediction explains, of those that differ and of all: the lesser.

    `places`: flat indices of the elements that are predicted; all where absent. Of an estimate: the share of the mean
    square of z that is gone.
    """
    expected, got, out, limit = (array.reshape(-1) if places is None else array.reshape(-1)[places] for array in (
        difference.expected, difference.got, difference.out, difference.limit))
    predicted = np.asarray(predicted).reshape(-1)
    if difference.noisy:
        z, left = (np.divide(distance(got, one), limit, out=np.zeros(len(got)), where=limit > 0)
                   for one in (expected, predicted))
        with np.errstate(invalid="ignore"):  # values that are none
            return max(0.0, float(1 - (left**2).sum() / (z**2).sum())) if z.any() else 0.0
    told = distance(predicted, expected) > limit
    if not told.any() or not out.any():
        return 0.0
    with np.errstate(invalid="ignore"):
        room = ROOM * (limit + SINGLE * (np.abs(np.where(np.isfinite(predicted), predicted, 0.0))))
    room = np.where(out, np.minimum(room, NEARER * distance(got, expected)), room)
    right = distance(got, predicted) <= room
    return float(min(right[out].mean(), right[told].mean(), right.mean()))


def _plain(difference: Difference) -> Iterator[Cause]:
    """Yield what is seen without a hypothesis: nothing written, numbers that are none."""
    got, out = difference.got, difference.out
    if got.dtype.kind == "f" and not np.isfinite(got[out]).all() and np.isfinite(difference.expected[out]).all():
        bad = int(np.count_nonzero(~np.isfinite(got[out])))
        what = "NaN" if np.isnan(got[out]).any() else "infinite"
        count = "1 element is" if bad == 1 else f"{bad} elements are"
        zero = " where 0 is expected: 0 over 0" if not difference.expected[out & ~np.isfinite(got)].any() else ""
        yield Cause(cause=f"{count} {what}{zero}", share=min(SEEN, bad / max(1, int(out.sum()))))
    elif not got.any() and difference.expected.any():
        yield Cause(cause="all elements are 0: nothing was written", share=SEEN)
    elif got.size > 1 and (got == got.reshape(-1)[0]).all():
        yield Cause(cause=f"{CONSTANT}{got.reshape(-1)[0]:g}", share=SEEN)


def _factors(difference: Difference, factors: Mapping[str, float]) -> Iterator[tuple[str, Array]]:
    expected = difference.expected
    factor, shift, name = _factor(difference, factors)
    if np.isnan(factor):
        return
    if name == "-1":
        yield "the sign is turned round", -expected
    elif factor and abs(factor - 1) < 1e-3:
        yield f"every element is {factor - 1:+.2g} of itself off: a constant with too few digits", expected * factor
    elif factor:
        yield f"every element is {name or f'{factor:.6g}'} times what it should be{_missing(name)}", expected * factor
    yield f"{shift:.6g} is added to every element", expected + shift


def _factor(difference: Difference, factors: Mapping[str, float]) -> tuple[float, float, str | None]:
    """Return how many times what is expected is there and how much more, medians of what is out; that factor's name."""
    expected, got = difference.expected, difference.got
    usable = difference.out & np.isfinite(expected) & (np.abs(expected) > 1e-3 * large_value(expected))
    if expected.dtype.kind != "f" or np.count_nonzero(usable) < FEWEST:
        return np.nan, np.nan, None
    with np.errstate(over="ignore"):
        factor = float(np.median(got[usable].astype(np.float64) / expected[usable]))
        shift = float(np.median(got[usable].astype(np.float64) - expected[usable]))
    known = {**FACTORS, **factors, **{f"1/({name})": 1 / value for name, value in factors.items() if value}}
    name = next((name for name, value in known.items() if abs(factor - value) <= 2e-4 * abs(value)), None)
    return factor, shift, name


def _missing(factor: str | None) -> str:
    """Return which factor is missing or too many, where its name says it."""
    if factor is None:
        return ""
    if factor.startswith("1/"):
        return f": a factor {factor[2:].strip('()')} is missing"
    return "" if "/" in factor else f": a factor {factor} too many"


def _axes(difference: Difference) -> Iterator[tuple[str, Array]]:
    expected = difference.expected
    names = axes_of(difference.entry.axes)
    if expected.ndim > 2:  # of two axes the words below say more
        yield ("the bytes lie in Fortran order, the first axis fastest, under a header that says C order",
               expected.ravel(order="F").reshape(expected.shape))
        yield ("the header says Fortran order, the bytes lie in C order",
               expected.ravel().reshape(expected.shape, order="F"))
    if len(names) != expected.ndim:
        return
    for axis, name in enumerate(names):
        if expected.shape[axis] < 2:
            continue
        if name in ("xy", "xyz", "rgb") and expected.shape[axis] == len(name):
            yield from _components(expected, axis, name)
            continue
        words = {"row": "rows run upwards: upside down", "column": "columns run leftwards: mirrored"}
        order = f"both {name} are exchanged" if expected.shape[axis] == 2 else f"{name}s are in reverse order"
        yield words.get(name, order), np.flip(expected, axis)
        for step, which in ((1, "before"), (-1, "after"))[: 2 * (expected.shape[axis] > 2)]:
            yield f"{name}s are shifted by one: each holds the one {which} it", np.roll(expected, step, axis)
            if name in ("row", "column") and expected.dtype.kind == "f":
                with np.errstate(invalid="ignore"):
                    yield f"half a texel off along {name}s", 0.5 * (expected + np.roll(expected, step, axis))
    if "row" in names and "column" in names:
        row, column = names.index("row"), names.index("column")
        yield "both rows and columns are reversed", np.flip(expected, (row, column))
        if expected.shape[row] == expected.shape[column]:
            yield "rows and columns are exchanged", np.swapaxes(expected, row, column)
        turned = np.swapaxes(expected, row, column)
        yield "written column by column instead of row by row", turned.reshape(expected.shape)
    if names[0] in ("xyz", "rgb") and len(expected) == len(names[0]):
        yield "components lie beside each other (h, w, 3) instead of in planes (3, h, w)", np.moveaxis(
            expected, 0, -1).reshape(expected.shape)
        yield ("vectors take 4 numbers each, as a vec3 of std430 does, and are read as planes",
               padded := _padded(expected))
        yield ("vectors take 4 numbers each, as a vec3 of std430 does, and are read as if they took 3",
               padded.reshape(-1, 3).T.reshape(expected.shape))
    yield from _tiles(difference, names)


def _padded(planes: Array) -> Array:
    """Return the first numbers of planes that are written as vectors of 4."""
    vectors = np.pad(planes.reshape(len(planes), -1).T, ((0, 0), (0, 4 - len(planes))))
    return np.asarray(vectors.reshape(-1)[: planes.size].reshape(planes.shape))


def _tiles(difference: Difference, names: list[str]) -> Iterator[tuple[str, Array]]:
    """Yield what is there where groups of threads are rounded down: beyond whole tiles all holds one number."""
    expected, got, shape = difference.expected, difference.got, difference.expected.shape
    single = [(axis,) for axis, name in enumerate(names) if name not in ("xy", "xyz", "rgb")]
    both = [tuple(names.index(name) for name in ("row", "column"))] if {"row", "column"} <= set(names) else []
    sides: dict[tuple[tuple[int, ...], tuple[int, ...]], list[int]] = {}
    for axes in (*single, *both):
        for side in TILES:
            whole = tuple(shape[axis] // side * side for axis in axes)
            if all(whole) and any(end < shape[axis] for axis, end in zip(axes, whole, strict=True)):
                sides.setdefault((axes, whole), []).append(side)
    for (axes, whole), fitting in sides.items():
        beyond = np.logical_or.reduce(np.broadcast_arrays(*(
            (np.arange(shape[axis]) >= end).reshape([-1 if one == axis else 1 for one in range(len(shape))])
            for axis, end in zip(axes, whole, strict=True))))
        beyond = np.broadcast_to(beyond, shape)
        held = np.unique(got[beyond])
        if len(held) == 1:
            yield (f"{' and '.join(f'{names[axis]}s' for axis in axes)} beyond whole tiles of "
                   f"{' or '.join(map(str, fitting))} are not written: they hold {held[0]:g}",
                   np.where(beyond, held[0], expected))


def _components(expected: Array, axis: int, name: str) -> Iterator[tuple[str, Array]]:
    for order in [*itertools.permutations(range(len(name)))][1:]:
        yield f"components are in the order {''.join(name[k] for k in order)}", np.take(expected, order, axis)
    if name == "rgb":
        yield "all channels hold red", np.repeat(np.take(expected, [0], axis), 3, axis)
        return
    along = [-1 if one == axis else 1 for one in range(expected.ndim)]
    signs = [np.where(np.arange(len(name)) == k, -1.0, 1.0).reshape(along) for k in range(len(name))]
    for letter, sign in zip(name, signs, strict=True):
        yield f"{letter} is mirrored", expected * sign
    if name == "xy":
        return
    swapped = np.take(expected, (0, 2, 1), axis)
    yield "y and z are exchanged and y is turned round (z up)", swapped * signs[1]
    yield "y and z are exchanged and z is turned round (z up)", swapped * signs[2]


def _coded(difference: Difference) -> Iterator[tuple[str, Array]]:
    expected, got = difference.expected, difference.got
    if expected.dtype.kind == "b":
        yield "true and false are exchanged", ~expected
    if expected.dtype.kind != "f":
        return
    with np.errstate(all="ignore"):
        positive = np.maximum(expected, 0)
        yield "encoded as sRGB; linear values are expected", np.where(
            positive <= 0.0031308, 12.92 * positive, 1.055 * positive ** (1 / 2.4) - 0.055)
        yield "decoded from sRGB once too often", np.where(
            positive <= 0.04045, positive / 12.92, ((positive + 0.055) / 1.055) ** 2.4)
        yield "a gamma of 1/2.2; linear values are expected", positive ** (1 / 2.2)
        yield "squared", expected**2
        yield "the square root", np.sqrt(positive)
        yield "the reciprocal", 1 / expected
        yield "1 minus what it should be", 1 - expected
        yield "packed as (x + 1) / 2", (expected + 1) / 2
        yield "unpacked as 2 x - 1", 2 * expected - 1
        yield "the absolute value", np.abs(expected)
        yield "negative values are cut to 0", positive
        yield "cut to at most 1", np.minimum(expected, 1)
        yield "bytes are swapped (big-endian)", expected.astype("<f4").view("<u4").byteswap().view("<f4")
        yield "the natural logarithm", np.log(expected)
        yield "the logarithm to base 2", np.log2(expected)
        yield "0 in place of infinity", np.where(np.isinf(expected), 0.0, expected)
        if np.array_equal(got, expected.astype(np.float16).astype(got.dtype)):
            yield "stored as float16: tier T2 allows that", got
        yield from _stored_in_few_bits(expected, difference.entry.axes)
        if difference.entry.axes.startswith("xyz") and expected.ndim > 1:
            yield "vectors are not normalised: right direction, other length", _along(expected, got)


def _stored_in_few_bits(expected: Array, axes: str) -> Iterator[tuple[str, Array]]:
    """Yield arrays as formats of textures keep them; infinite numbers as they are."""
    for bits in (8, 16):
        unsigned, signed = 2**bits - 1, 2 ** (bits - 1) - 1
        cut = ", in which what is below 0 is cut" if (expected < 0).any() else ""
        yield f"stored as unorm{bits}{cut}", np.rint(np.clip(expected, 0, 1) * unsigned) / unsigned
        yield f"stored as snorm{bits}", np.rint(np.clip(expected, -1, 1) * signed) / signed
        yield (f"packed as (x + 1) / 2 in unorm{bits} and unpacked",
               2 * np.rint(np.clip((expected + 1) / 2, 0, 1) * unsigned) / unsigned - 1)
    if axes.startswith("rgb"):
        kept = np.array([6, 6, 5]).reshape(-1, *[1] * (expected.ndim - 1))
        part, power = np.frexp(np.maximum(expected, 0))
        for said, rounded in (("", np.rint), (" by cutting", np.floor)):
            yield (f"stored as R11G11B10F{said}: 5 and 6 bits of a float",
                   np.ldexp(rounded(np.ldexp(part, kept + 1)), power - kept - 1))


def _along(expected: Array, got: Array) -> Array:
    """Return expected vectors with the lengths of others."""
    length = np.sqrt((expected.astype(np.float64) ** 2).sum(axis=0))
    own = np.sqrt((got.astype(np.float64) ** 2).sum(axis=0))
    return np.asarray(expected * np.divide(own, length, out=np.ones_like(own), where=length > 0))


def _indices(difference: Difference) -> Iterator[tuple[str, Array]]:
    expected, entry = difference.expected, difference.entry
    if expected.dtype.kind != "i":
        return
    some = expected >= 0
    yield "indices begin at 1", np.where(some, expected + 1, expected)
    yield "every index is one too high, that for none too", expected + 1
    yield "every index is one too low", np.where(some, expected - 1, expected)
    yield "none is marked by 0", np.where(some, expected, 0)
    yield "none is marked by the largest number", np.where(some, expected, -1).view(np.uint32).astype(np.int64)
    yield from _exchanged(difference)
    if entry.index_of is not None:
        rows, columns = entry.index_of
        row, column = expected // columns, expected % columns
        yield "indices count column by column", np.where(some, column * rows + row, expected)
        yield "rows of indices run upwards", np.where(some, (rows - 1 - row) * columns + column, expected)
        yield "columns of indices run leftwards", np.where(some, row * columns + columns - 1 - column, expected)


def _exchanged(difference: Difference) -> Iterator[tuple[str, Array]]:
    """Yield which of a few values stand for which others."""
    expected, got = difference.expected, difference.got
    values = np.unique(expected)
    if len(values) > FEW_VALUES:
        return
    predicted, said = np.array(expected), []
    for value in values:
        here = expected == value
        found, counts = np.unique(got[here], return_counts=True)
        usual = found[np.argmax(counts)]
        if usual != value:
            predicted[here] = usual
            said.append((int(value), int(usual)))
    if len(said) == 2 and said[0] == said[1][::-1]:
        yield f"{said[0][0]} and {said[0][1]} are exchanged", predicted
    elif said:
        yield " and ".join(f"every {a} is {b}" for a, b in said), predicted


def _taken_for(difference: Difference, others: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    for name, array in others.items():
        if name != difference.name and array.shape == difference.expected.shape and array.any():
            yield f"it holds {name}", array


def _running_sums(difference: Difference) -> Iterator[tuple[str, Array]]:
    """Yield sums that are not cleared between the elements of a plane; one that is skipped stays 0."""
    expected, names = difference.expected, axes_of(difference.entry.axes)
    if expected.dtype.kind != "f" or len(names) != expected.ndim or not np.isfinite(expected).all():
        return
    planes = int(names[0] in ("xyz", "rgb") and expected.ndim > 1)

    for order in ("", ", column by column")[: expected.ndim - planes]:
        along = np.swapaxes(expected, -1, -2) if order else expected
        sums = np.cumsum(along.reshape(*along.shape[:planes], -1), axis=-1, dtype=np.float64).reshape(along.shape)
        yield (f"values are running sums{order}: the accumulator is not cleared between elements",
               np.where(difference.got == 0, 0.0, np.swapaxes(sums, -1, -2) if order else sums))


def _depth_buffer(difference: Difference) -> Iterator[tuple[str, Array]]:
    """Yield numbers of a depth buffer, a + b / z, fitted to what is there, in place of depth in m."""
    z, got = (one.astype(np.float64) for one in (difference.expected, difference.got))
    usable = difference.out & np.isfinite(z) & (z > 0) & np.isfinite(got)
    if not difference.name.endswith("depth") or np.count_nonzero(usable) < 2 * FEWEST:
        return
    (a, b), *_ = np.linalg.lstsq(np.stack([np.ones(np.count_nonzero(usable)), 1 / z[usable]], 1), got[usable])
    if a and b:
        yield ("a depth buffer's numbers (clip space) in place of linear depth, m: "
               f"{a:.4g} {'+' if b > 0 else '-'} {abs(b):.4g} / z; --depth takes them",
               np.where(np.isfinite(z) & (z > 0), a + b / np.where(z > 0, z, 1), z))


def _slight(difference: Difference) -> Iterator[Cause]:
    """Yield that a difference is small; not of an estimate, which rounding hardly moves."""
    if difference.noisy:
        return
    worst = distance(difference.got, difference.expected)[difference.out]
    with np.errstate(over="ignore", divide="ignore"):
        over = float((worst / difference.limit[difference.out]).max(initial=0.0))
    if over < SLIGHT:
        yield Cause(cause=f"{over:.2g} times the bound at most: rounding, such as half floats, approximate functions "
                          "or cancellation", share=1.0)


def _order(difference: Difference) -> Iterator[Cause]:
    """Yield that the right elements are there in another order, along the last axis or all over."""
    expected, got = difference.expected, difference.got
    if expected.size < 2:
        return
    a, b = np.sort(expected.astype(np.float64), axis=None), np.sort(got.astype(np.float64), axis=None)
    apart = np.median(distance(got, expected)[difference.out])
    if not np.isfinite(apart):
        return
    if bool((distance(a, b) <= 4 * SINGLE * np.abs(a) + SORTED * apart).all()):
        yield Cause(cause="the right values in another order", share=1.0)
