"""What ports get wrong in ranges of depths and normals in cells (Nichols and Wyman 2009, Sec. 3.2), cell by cell."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"
CUT, MIN_MAX = "cells of 2^level pixels, cut by the border", "least, largest of the pixels that show a surface"


def ranges_bugs(what: str, top: int, rim: int, components: int) -> Iterator[Bug]:
    """Yield likely bugs of least and largest depths or normals (`what`) of levels 1 to `top`."""
    def literal(**bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            plane = np.asarray(arrays[f"gbuffer.{what}"], real)
            planes = plane[None] if what == "depth" else plane[:components]
            return literal_ranges(planes, np.asarray(arrays[IDS]), what, top, rim, **bugs)

        return altered

    sides = {"last row": ("below", (0, -1, 0, 0)), "last column": ("right", (0, 0, 0, -1)),
             "first row": ("above", (-1, 0, 0, 0)), "first column": ("left", (0, 0, -1, 0))}
    for line, (side, trim) in sides.items():
        yield Bug(f"the rim lies on one side of a cell alone, none {side}: the {line} is left out" if rim else
                  f"the {line} of each cell is left out", literal(trim=trim), CUT)
    for cause, trim in (("the last row and the last column of each cell are left out", (0, -1, 0, -1)),
                        ("one row too many: the next cell's first row counts as well", (0, 1, 0, 0)),
                        ("one column too many: the next cell's first column counts as well", (0, 0, 0, 1)),
                        ("one row and one column of the next cell count as well", (0, 1, 0, 1)),
                        ("one row too many above each cell", (1, 0, 0, 0)),
                        ("one column too many left of each cell", (0, 0, 1, 0)),
                        ("cells begin one row and one column late", (-1, 1, -1, 1)),
                        ("cells begin one row and one column early", (1, -1, 1, -1))):
        yield Bug(cause, literal(trim=trim), CUT)
    if rim:
        for cause, trim in (
                ("the rim lies on one side of a cell alone: none right and below", (0, -rim, 0, -rim)),
                ("the rim lies on one side of a cell alone: none left and above", (-rim, 0, -rim, 0)),
                ("the rim lies on one side of a cell alone: the cell is not wider, but moved right and down",
                 (-rim, rim, -rim, rim)),
                ("the rim lies left and right of a cell alone, not above and below", (-rim, -rim, 0, 0)),
                ("the rim lies above and below a cell alone, not left and right", (0, 0, -rim, -rim)),
                ("the rim is twice as wide", (rim, rim, rim, rim))):
            yield Bug(cause, literal(trim=trim), "rim of the settings (AMS Fig. 15)")
        yield Bug("the rim is a cell wide: all neighbours (3x3) count", literal(rim_of="cell"),
                  "rim of the settings (AMS Fig. 15)")
        yield Bug("the rim grows from level to level: half a cell", literal(rim_of="half"),
                  "rim of the settings (AMS Fig. 15)")
        yield Bug("corners of the rim are left out", literal(rim_of="plus"), "rim of the settings (AMS Fig. 15)")
    for cause, knobs in (
            ("the largest starts at 0, not at -infinity", {"high": 0.0}),
            ("the least starts at 0, not at infinity", {"low": 0.0}),
            ("the least starts at 1, not at infinity", {"low": 1.0}),
            ("the largest starts at 1, not at -infinity", {"high": 1.0}),
            ("empty cells hold 0, not infinity", {"empty": 0.0}),
            ("empty cells hold the largest float, not infinity", {"empty": float(np.finfo(np.float32).max)}),
            ("the largest starts at the smallest positive float (FLT_MIN, not -FLT_MAX)", {"high": 2.0**-126}),
            ("the least is written into both", {"both": "low"}), ("the largest is written into both",
                                                                 {"both": "high"}),
            ("means of the cell in place of least and largest", {"both": "mean"}),
            ("triangle 0 counts as no surface: ids above 0 alone", {"ids_from": 1}),
            ("rows and columns of pixels are exchanged", {"read": "transposed"}),
            ("a row of pixels has as many elements as there are rows", {"read": "stride"}),
            ("pictures are read upside down", {"read": "upwards"}),
            ("cells are one level too small: 2^(level - 1) pixels", {"size": "half"}),
            ("cells are one level too large: 2^(level + 1) pixels", {"size": "twice"}),
            ("cells are 2 level pixels wide, not 2^level", {"size": "linear"}),
            ("cells count from the lower border", {"begin": "bottom"}),
            ("cells that the border cuts are left empty", {"begin": "whole"}),
            ("cells that the border cuts begin so that they are whole", {"begin": "moved"})):
        if knobs != {"size": "linear"} or top > 2:
            yield Bug(cause, literal(**knobs), MIN_MAX if "size" not in knobs else CUT)
    if what == "depth":
        yield Bug("pixels without surface count with their infinite depth (background)", literal(ids_from=-1), MIN_MAX)
        yield Bug("depth is turned round: -z", literal(value=np.negative), MIN_MAX)
        yield Bug("the reciprocal of depth", literal(value=lambda z: 1 / z), MIN_MAX)
        return
    yield Bug("the first component of normals for all", literal(value=lambda n: np.repeat(n[:1], len(n), 0)), MIN_MAX)
    yield Bug("the last component of normals for all", literal(value=lambda n: np.repeat(n[-1:], len(n), 0)), MIN_MAX)
    yield Bug("components of normals are taken as absolute values", literal(value=np.abs), MIN_MAX)
    yield Bug("normals are packed: (n + 1) / 2", literal(value=lambda n: (n + 1) / 2), MIN_MAX)
    yield Bug("normals are turned round", literal(value=np.negative), MIN_MAX)


def literal_ranges(
    planes: Array, ids: Array, what: str, top: int, rim: int, *, trim: tuple[int, int, int, int] = (0, 0, 0, 0),
    rim_of: str = "", low: float = np.inf, high: float = -np.inf, empty: float = np.inf, both: str = "",
    ids_from: int = 0, read: str = "", size: str = "", begin: str = "",
    value: Callable[[Array], Array] = np.asarray,
) -> dict[str, Array]:
    """Return least and largest of each cell of levels 1 to `top`, with bugs.

    `trim`: rows above and below, columns left and right of each cell that count too.
    """
    height, width = ids.shape
    read_ids, read_planes = _read(ids, read), _read(value(planes), read)
    shown, made = read_ids >= ids_from, dict[str, Array]()
    for level in range(1, top + 1):
        side = 1 << level
        pixels = {"half": side // 2, "twice": 2 * side, "linear": 2 * level}.get(size, side)
        around = {"cell": side, "half": side // 2}.get(rim_of, rim)
        shape = -(-height >> level), -(-width >> level)
        least, most = np.full((len(planes), *shape), low), np.full((len(planes), *shape), high)
        for i, j in np.ndindex(shape):
            y, x = i * pixels, j * pixels
            if begin == "moved":
                y, x = min(y, max(height - pixels, 0)), min(x, max(width - pixels, 0))
            if begin == "bottom":
                y = height - (shape[0] - i) * pixels
            if begin == "whole" and (y + pixels > height or x + pixels > width):
                continue
            rows = slice(max(y - around - trim[0], 0), max(y + pixels + around + trim[1], 0))
            columns = slice(max(x - around - trim[2], 0), max(x + pixels + around + trim[3], 0))
            here = shown[rows, columns]
            if rim_of == "plus":
                here = here & _plus(rows, columns, (y, x), pixels, here.shape)
            if here.any():
                found = read_planes[:, rows, columns][:, here]
                least[:, i, j] = np.minimum(found.min(axis=1), low)
                most[:, i, j] = np.maximum(found.max(axis=1), high)
                if both == "mean":
                    least[:, i, j] = most[:, i, j] = found.mean(axis=1)
        if np.isfinite(empty):
            least, most = (np.where(np.isinf(one), np.copysign(empty, one), one) for one in (least, most))
        least, most = {"low": (least, least), "high": (most, most)}.get(both, (least, most))
        made |= {f"multires.{what}_{name}.{level}": one[0] if what == "depth" else one
                 for name, one in (("least", least), ("largest", most))}
    return made


def _plus(rows: slice, columns: slice, begin: tuple[int, int], side: int, shape: tuple[int, ...]) -> Array:
    y = rows.start + np.arange(shape[0]) - begin[0]
    x = columns.start + np.arange(shape[1]) - begin[1]
    return np.asarray(((y >= 0) & (y < side))[:, None] | ((x >= 0) & (x < side)))


def _read(planes: Array, read: str) -> Array:
    """Return pixels as a port reads them that takes rows for columns."""
    if not read:
        return planes
    (height, width), flat = planes.shape[-2:], planes.reshape(*planes.shape[:-2], -1)
    y, x = np.mgrid[:height, :width]
    at = {"transposed": x * height + y, "stride": y * height + x, "upwards": (height - 1 - y) * width + x}[read]
    return np.asarray(flat[..., at % (height * width)])
