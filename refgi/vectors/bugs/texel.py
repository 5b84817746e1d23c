"""What ports get wrong in the texels that points fall on, and in how many texels a light stands for (SII Sec. 3.1)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from refgi.vectors.bugs.points import ORDER, upwards
from refgi.vectors.recipe import reading, writing
from refgi.vectors.spec import Arrays, Bug, Run


def texel_bugs(
    name: str, points: str, weight: str, run: Run, shape: tuple[int, int, int], counts: tuple[int, int]
) -> Iterator[Bug]:
    """Yield likely bugs of the texels that points fall on, and of T/N w.

    Parameters
    ----------
    name : str
        Name of the map.
    points, weight : str
        Arrays of the points, and of the warp's weights where there is a warp.
    run : Run
        The stage.
    shape : tuple
        Maps, rows and columns of one.
    counts : tuple
        Lights of this map and of all.
    """
    maps, rows, columns = shape
    (n, every), all_rows = counts, maps * rows
    texels = all_rows * columns
    seen = points.replace(".", "__")

    def placed(u: Any, v: Any, stride: int = columns) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            at = np.asarray(arrays[points], np.float64)
            row, column = (np.maximum(np.floor(f(at)), 0).astype(np.int64) for f in (v, u))
            return {**run(arrays, real), f"{name}.texel": row * stride + column}

        return altered

    def low(size: int, axis: int) -> Any:
        return lambda at: np.minimum(at[:, axis] * size, size - 1)

    u, v = low(columns, 0), low(all_rows, 1)
    yield Bug("rows and columns are exchanged", reading(run, **{seen: lambda a: a[:, ::-1]}), ORDER)
    yield Bug("v runs upwards: rows are upside down", reading(run, **{seen: upwards}), ORDER)
    yield Bug("u runs leftwards: columns are mirrored", reading(run, **{seen: lambda a: upwards(a[:, ::-1])[:, ::-1]}),
              ORDER)
    for cause, placing in (
            ("both the row and the column are found from u", placed(u, low(all_rows, 0))),
            ("both the row and the column are found from v", placed(low(columns, 1), v)),
            ("points are rounded to texels instead of cut", placed(
                lambda at: np.minimum(at[:, 0] * columns + 0.5, columns - 1),
                lambda at: np.minimum(at[:, 1] * all_rows + 0.5, all_rows - 1))),
            ("points are multiplied by the resolution less 1 (n - 1), then cut: the last texel is left out", placed(
                lambda at: at[:, 0] * (columns - 1), lambda at: at[:, 1] * (all_rows - 1))),
            ("points are multiplied by the resolution less 1 (n - 1), then rounded", placed(
                lambda at: at[:, 0] * (columns - 1) + 0.5, lambda at: at[:, 1] * (all_rows - 1) + 0.5)),
            ("points are multiplied by the resolution plus 1", placed(
                lambda at: np.minimum(at[:, 0] * (columns + 1), columns - 1),
                lambda at: np.minimum(at[:, 1] * (all_rows + 1), all_rows - 1))),
            ("points are rounded up to the next texel", placed(
                lambda at: np.minimum(np.ceil(at[:, 0] * columns), columns - 1),
                lambda at: np.minimum(np.ceil(at[:, 1] * all_rows), all_rows - 1))),
            ("half a texel is subtracted from places", placed(
                lambda at: at[:, 0] * columns - 0.5, lambda at: at[:, 1] * all_rows - 0.5)),
            ("indices count column by column: column * rows + row", placed(v, u, all_rows)),
            ("a row has as many texels as the map has rows: row * rows + column", placed(u, v, all_rows)),
            ("a row is one texel too long: row * (columns + 1) + column", placed(u, v, columns + 1)),
            ("a row is one texel too short: row * (columns - 1) + column", placed(u, v, columns - 1)),
            ("columns are found with the number of rows", placed(low(all_rows, 0), v)),
            ("rows are found with the number of columns", placed(u, low(columns, 1))),
            ("rows of one map in place of all stacked maps (faces of a cube)", placed(u, low(rows, 1)))):
        yield Bug(cause, placing, f"floor(u W), floor(v H), {ORDER}")
    yield from _weight_bugs(name, weight, run, (texels, rows * columns, rows, columns), (n, every))


def _weight_bugs(
    name: str, weight: str, run: Run, sizes: tuple[int, int, int, int], counts: tuple[int, int]
) -> Iterator[Bug]:
    (texels, of_one, rows, columns), (n, every) = sizes, counts
    ratio = texels / n

    def times(factor: float) -> Run:
        return writing(run, **{f"{name}__weight": lambda a: a * factor})

    for cause, factor in (
            ("T/N is left out of the weight", 1 / ratio), ("the weight is 1/N: T, the number of texels, is missing",
                                                           1 / texels),
            ("the weight is T: 1/N, the number of lights, is missing", float(n)), ("the weight is N/T, not T/N",
                                                                             ratio**-2),
            ("T/N is counted twice", ratio), ("N of all maps together: T/N is each map's own", n / every),
            ("T of one map in place of all stacked maps (faces of a cube)", of_one / texels),
            ("T is the number of columns, not of texels", columns / texels), ("T is the number of rows of one map",
                                                                          rows / texels),
            ("N - 1 in place of N", n / max(n - 1, 1)), ("N + 1 in place of N", n / (n + 1)),
            ("T is the number of texels less one", (texels - 1) / texels),
            ("T/N is a division of whole numbers: its fraction is cut off", (texels // n) / ratio),
            ("the root of T/N", ratio**-0.5)):
        yield Bug(cause, times(factor), "T/N w")
    if weight:
        own = weight.replace(".", "__")
        for cause, change in (
                ("the weight of the warp (its density) is left out: T/N alone, unit weights", np.ones_like),
                ("T/N is divided by the warp's weight: the density in place of its inverse", lambda a: 1 / a),
                ("the warp's weight is squared", np.square), ("the root of the warp's weight", np.sqrt),
                ("weights of the warp are scaled to a sum of N", lambda a: a * len(a) / a.sum()),
                ("weights of the warp are scaled to a sum of 1", lambda a: a / a.sum()),
                ("the first point's weight of the warp for all", lambda a: np.full_like(a, a[0])),
                ("weights of the warp are those of the next point", lambda a: np.roll(a, -1)),
                ("T/N and the warp's weight are added, not multiplied", lambda a: 1 + a / ratio)):
            yield Bug(cause, reading(run, **{own: change}), "T/N w: w of the warp (Eq. 5, 6)")
