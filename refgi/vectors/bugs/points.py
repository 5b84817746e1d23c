"""What ports get wrong in the points that pixel lights are chosen by, and in importance (SII Sec. 3.1, 3.5)."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from refgi.sampling import halton
from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

ORDER = "u along columns, v along rows"
MIRRORED = "digits are mirrored at the point"
BELOW_1 = 1.0 - 2.0**-24
WRAPPED = "added modulo 1"


def below_1(points: Array) -> Array:
    """Return points that stay below 1 in float32."""
    return np.minimum(points, BELOW_1)


def halton_bugs(name: str, count: int, shift: tuple[float, float] | None, before: int, first: Any) -> Iterator[Bug]:
    """Yield likely bugs of Halton points.

    Parameters
    ----------
    name : str
        The array of points.
    count : int
        Their number.
    shift : tuple or None
        What is added to them, modulo 1.
    before : int
        Points of the maps before this one.
    first : tuple or None
        The first map's shift, where this is another map.
    """
    added: Array = np.zeros(2) if shift is None else np.array(shift, np.float32).astype(np.float64)

    def made(points: Any, moved: Any = added) -> Run:
        values = below_1((points + np.asarray(moved)) % 1.0)
        return lambda _arrays, _real: {name: values}

    plain = halton(count)
    yield Bug("the Halton sequence starts at index 1, not at index 0: one point further", made(halton(count, start=1)),
              "index 0 is the origin (docs/conventions)")
    for cause, bases in (("bases 2 and 3 are exchanged", (3, 2)), ("both coordinates have base 2", (2, 2)),
                         ("both coordinates have base 3", (3, 3)), ("the second base is 5, not 3", (2, 5)),
                         ("the second base is 4, not 3", (2, 4))):
        yield Bug(cause, made(halton(count, bases)), "base 2 along columns, 3 along rows")
    yield Bug("digits of the radical inverse are not mirrored: the index over a power of the base",
              made(_digits(count, mirrored=False)), MIRRORED)
    yield Bug("the last digit of the index is left out of the radical inverse", made(_digits(count, last=False)),
              MIRRORED)
    yield Bug("the first digit of the index is left out of the radical inverse", made(_digits(count, first=False)),
              MIRRORED)
    yield Bug("the first digit counts 1, not 1/base: the radical inverse is a base too large, then wrapped",
              made(plain * (2, 3)), MIRRORED)
    yield Bug("the first digit counts 1, not 1/base: the radical inverse is a base too large, then clamped",
              lambda _a, _r: {name: below_1(plain * (2, 3) + added)}, MIRRORED)
    yield Bug("the radical inverse is one power of the base too small", made(plain / (2, 3)), MIRRORED)
    yield Bug("Hammersley points in place of Halton: u is k/N", made(
        np.stack([np.arange(count) / count, plain[:, 0]], axis=1)), "SII Sec. 3.1")
    yield Bug("half a cell 1/(2N) is added to every point", made(plain + 0.5 / count), "SII Sec. 3.1")
    yield Bug("v runs upwards: 1 - v", writing(made(plain), **{name.replace(".", "__"): upwards}), ORDER)
    if before:
        yield Bug("the index counts on over all maps: each map's sequence must start again",
                  made(halton(count, start=before)), "index 0 is each map's first")
    if shift is not None:
        yield from _shift_bugs(name, plain, added, made)
    if first is not None:
        yield Bug("the first map's shift for all maps", made(plain, np.array(first, np.float32).astype(np.float64)),
                  WRAPPED)


def _shift_bugs(name: str, plain: Array, shift: Array, made: Any) -> Iterator[Bug]:
    moved = plain + shift
    for cause, other in (("the shift is left out", np.zeros(2)), ("the shift is subtracted", -shift),
                         ("both coordinates take the first shift: that of the second is not used", shift[[0, 0]]),
                         ("both coordinates take the second shift: the first is not used", shift[[1, 1]]),
                         ("the first and the second shift are exchanged", shift[::-1]),
                         ("the shift is added twice", 2 * shift)):
        yield Bug(cause, made(plain, other), WRAPPED)
    for cause, points in (
            ("points beyond 1 are clamped to 1, not wrapped (modulo 1, fract)", below_1(moved)),
            ("points beyond 1 are not wrapped (modulo 1, fract)", moved),
            ("points beyond 1 are mirrored, not wrapped (modulo 1, fract)", np.where(moved < 1, moved, 2 - moved)),
            ("points beyond 1 become 0, not wrapped (modulo 1, fract)", np.where(moved < 1, moved, 0))):
        yield Bug(cause, partial(_constant, name, points), WRAPPED)


def _constant(name: str, values: Array, _arrays: Arrays, _real: Any) -> Arrays:
    return {name: values}


def _digits(count: int, *, mirrored: bool = True, last: bool = True, first: bool = True) -> Array:
    """Return Halton points digit by digit, with bugs."""
    points = np.zeros((count, 2))
    for axis, base in enumerate((2, 3)):
        for k in range(count):
            digits = [int(one) for one in np.base_repr(k, base)[::-1]] if k else []
            kept = digits if last else digits[:-1]
            kept = kept if first else kept[1:]
            kept = kept if mirrored else kept[::-1]
            points[k, axis] = sum(digit / base ** (place + 1) for place, digit in enumerate(kept))
    return points


def grid_bugs(name: str, n: int) -> Iterator[Bug]:
    """Yield likely bugs of the centres of n x n cells."""
    k = np.arange(n * n)
    row, column = k // n, k % n

    def made(u: Any, v: Any) -> Run:
        points = below_1(np.stack([u, v], axis=1).astype(np.float64))
        return lambda _arrays, _real: {name: points}

    def both(place: Any) -> Run:
        return made(place(column), place(row))

    centres, fewer = "centres of n x n cells, row by row", max(n - 1, 1)
    for cause, place in (
            ("points lie at the upper left corners of cells, not at their centres: half a cell (0.5) is not added",
             lambda i: i / n),
            ("points lie at the lower right corners of cells, not at their centres: 1 is added, not 0.5",
             lambda i: (i + 1) / n),
            ("points run from border to border: divided by n - 1, not by n", lambda i: i / fewer),
            ("centres of cells are divided by n - 1, not by n", lambda i: (i + 0.5) / fewer),
            ("centres of cells are divided by n + 1, not by n", lambda i: (i + 0.5) / (n + 1)),
            ("points are divided by n + 1, not by n: (i + 1) / (n + 1)", lambda i: (i + 1) / (n + 1)),
            ("divided by the number of points, not by that of cells along a side", lambda i: (i + 0.5) / n**2),
            ("half a cell is subtracted, not added", lambda i: np.maximum(i - 0.5, 0) / n)):
        yield Bug(cause, both(place), centres)
    x, y = (column + 0.5) / n, (row + 0.5) / n
    yield Bug("cells are counted column by column: u and v are exchanged", made(y, x), centres)
    yield Bug("rows of cells run upwards: v is turned round", made(x, 1 - y), centres)
    yield Bug("columns of cells run leftwards: u is turned round", made(1 - x, y), centres)
    yield Bug("both coordinates are the column's", made(x, x), centres)
    yield Bug("both coordinates are the row's", made(y, y), centres)
    yield Bug("half a cell is added along columns alone: rows lie at corners, not centres", made(x, row / n), centres)
    yield Bug("half a cell is added along rows alone: columns lie at corners, not centres", made(column / n, y),
              centres)
    for cause, side in (("one cell too few along a side", fewer), ("one cell too many along a side", n + 1)):
        yield Bug(cause, made((k % side + 0.5) / side, (k // side + 0.5) / side), centres)
    yield Bug("a diagonal of points (k + 0.5) / N in place of cells", made((k + 0.5) / n**2, (k + 0.5) / n**2), centres)


def importance_bugs(name: str, glossy: bool, maps: int) -> Iterator[Bug]:
    """Yield likely bugs of the importance of a map's texels: its largest channel of flux, lobe included."""
    def made(value: Any) -> Run:
        def run(arrays: Arrays, real: Any) -> Arrays:
            flux = np.asarray(arrays[f"{name}.flux"])
            lobe = arrays[f"{name}.lobe_flux"] if glossy else np.zeros_like(flux)
            exponent = arrays[f"{name}.lobe_exponent"] if glossy else np.zeros_like(flux[0])
            return {f"{name}.importance": np.asarray(value(flux, lobe, exponent)).astype(real)}

        return run

    def whole(value: Any) -> Run:
        return made(lambda flux, lobe, _: value(flux + lobe))

    def of_first(one: Array) -> Array:
        rows = one.shape[0] // maps
        return np.tile(one[:rows], (maps, 1))

    largest = "SII Sec. 3.5: the largest channel"
    for cause, value in (
            ("luminance in place of the largest channel", lambda f: np.tensordot((0.2126, 0.7152, 0.0722), f, 1)),
            ("luminance by 0.299, 0.587, 0.114 in place of the largest channel",
             lambda f: np.tensordot((0.299, 0.587, 0.114), f, 1)),
            ("the sum of channels in place of the largest", lambda f: f.sum(axis=0)),
            ("the mean of channels in place of the largest", lambda f: f.mean(axis=0)),
            ("the smallest channel in place of the largest", lambda f: f.min(axis=0)),
            ("the length of the vector of channels in place of the largest", lambda f: np.sqrt((f**2).sum(axis=0))),
            ("the first channel alone: red in place of the largest", lambda f: f[0]),
            ("green alone in place of the largest channel", lambda f: f[1]),
            ("the last channel alone: blue in place of the largest, each overwrites the one before", lambda f: f[2]),
            ("the last channel is left out: the larger of red and green", lambda f: f[:2].max(axis=0)),
            ("the first channel is left out: the larger of green and blue", lambda f: f[1:].max(axis=0)),
            ("importance is divided by its sum", lambda f: f.max(axis=0) / max(f.max(axis=0).sum(), 1e-30)),
            ("importance is divided by its largest value", lambda f: f.max(axis=0) / max(f.max(initial=0), 1e-30)),
            ("importance is divided by its mean", lambda f: f.max(axis=0) / max(f.max(axis=0).mean(), 1e-30)),
            ("importance is 1 where there is any flux", lambda f: f.max(axis=0) > 0)):
        yield Bug(cause, whole(value), largest)
    if maps > 1:
        yield Bug("all faces of a cube take the first face's importance (maps are stacked along rows)",
                  whole(lambda f: of_first(f.max(axis=0))), largest)
    if glossy:
        for cause, full in (
                ("lobes are left out: importance is that of the diffuse flux alone, without glossy (specular) flux",
                 lambda f, _g, _p: f.max(axis=0)),
                ("the diffuse flux is left out: importance is that of lobes alone", lambda _f, g, _p: g.max(axis=0)),
                ("the larger of diffuse flux and lobe flux in place of their sum",
                 lambda f, g, _p: np.maximum(f, g).max(axis=0)),
                ("the largest channels of diffuse and lobe flux are added, not the channels before",
                 lambda f, g, _p: f.max(axis=0) + g.max(axis=0)),
                ("lobe flux is subtracted from the diffuse flux", lambda f, g, _p: (f - g).max(axis=0)),
                ("diffuse and lobe flux are multiplied, not added", lambda f, g, _p: (f * g).max(axis=0)),
                ("lobe flux counts twice", lambda f, g, _p: (f + 2 * g).max(axis=0)),
                ("lobe flux counts half", lambda f, g, _p: (f + 0.5 * g).max(axis=0)),
                ("lobe flux is multiplied by the exponent P", lambda f, g, p: (f + p * g).max(axis=0)),
                ("lobe flux is multiplied by the peak of the lobe (P + 1) / 2",
                 lambda f, g, p: (f + 0.5 * (p + 1) * g).max(axis=0)),
                ("lobes count where there is no diffuse flux alone",
                 lambda f, g, _p: np.where(f.max(axis=0) > 0, f.max(axis=0), g.max(axis=0)))):
            yield Bug(cause, made(full), "SII Sec. 3.5: lobe included")


def upwards(points: Array) -> Array:
    """Return points whose v runs upwards."""
    return np.stack([points[:, 0], BELOW_1 - points[:, 1]], axis=1)
