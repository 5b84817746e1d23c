"""What ports get wrong in upsampling from subsplats to pixels (Nichols and Wyman 2009, Sec. 3.5), in NumPy."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

TENT, MASK = "E-AMS-09: (1, 2, 1) x (1, 2, 1)", "m = 1 where there is light and a surface"
LIST = ("multires.level", "multires.row", "multires.column", "multires.irradiance")


def tent_bugs(literal: Callable[..., Run], corner_rule: bool, coarsest: bool) -> Iterator[Bug]:
    """Yield likely bugs of a level of the masked tent; `literal` returns the stage with knobs of `tent`."""
    for cause, knobs in (
            ("nine equal weights", {"weights": (1, 1, 1)}),
            ("weights (2, 1, 2): those of the middle and of the sides are exchanged", {"weights": (2, 1, 2)}),
            ("weights (1, 4, 1) in place of (1, 2, 1)", {"weights": (1, 4, 1)}),
            ("weights (1, 3, 1) in place of (1, 2, 1)", {"weights": (1, 3, 1)}),
            ("the cell itself is left out of the filter: its neighbours alone", {"plane": _without_middle}),
            ("cells across a corner are left out of the filter: five cells alone", {"plane": _plus}),
            ("cells across a corner alone are filtered", {"plane": _cross}),
            ("weights are added (2 + 2, 2 + 1, 1 + 1), not multiplied", {"plane": _added}),
            ("rows alone are filtered: no neighbours above and below", {"left_out": ((-1, None), (1, None))}),
            ("columns alone are filtered: no neighbours left and right", {"left_out": ((None, -1), (None, 1))}),
            ("the row above is left out of the filter", {"left_out": ((-1, None),)}),
            ("the row below, the last one, is left out of the filter", {"left_out": ((1, None),)}),
            ("the column to the left is left out of the filter", {"left_out": ((None, -1),)}),
            ("the column to the right, the last one, is left out of the filter", {"left_out": ((None, 1),)}),
            ("the filter divides by 16 whatever cells are known: cells without light count as black, the sum of "
             "weights is not normalised", {"masked": False}),
            ("the filter divides by 9 whatever cells are known", {"divided": 9.0}),
            ("the filter is a sum: not divided by the sum of weights", {"divided": 1.0}),
            ("the filter divides by the number of known cells, not by the sum of their weights", {"divided": "count"}),
            ("beyond the border (rim) it is black", {"border": "constant"}),
            ("beyond the border (rim) the picture starts again from the other side: wrap, repeat", {"border": "wrap"}),
            ("beyond the border (rim) the picture is mirrored at the middle of its last cell", {"border": "reflect"}),
            ("cells beyond the border (rim) are left out of the filter and of its weights, not clamped",
             {"border": "none"}),
            ("known cells are those of this level alone, the coarser level's light is left out of the filter",
             {"counted": "own"}),
            ("known cells are those of the coarser level alone: own light is left out of the filter",
             {"counted": "coarse"}),
            ("the filter reads cells that it has written before (in place)", {"in_place": True}),
            ("the filter is applied twice", {"passes": 2})):
        yield Bug(cause, literal(**knobs), TENT)
    if corner_rule:
        for cause, corner in (("a corner is crossed only where both cells beside it are known", "both"),
                              ("a corner is crossed only where no cell beside it is known", "none"),
                              ("a corner is crossed only where the cell above or below is known", "rows"),
                              ("a corner is crossed only where the cell left or right is known", "columns")):
            yield Bug(cause, literal(corner=corner), "E-AMS-09: beside a cell that counts")
    yield Bug("cells that were evaluated at this level are left out: light of the coarser level alone",
              literal(own=False), MASK)
    if not coarsest:
        yield from _coarse_bugs(literal)


def _coarse_bugs(literal: Callable[..., Run]) -> Iterator[Bug]:
    for cause, knobs in (
            ("light does not come down from the coarser level (level above): it is not doubled, only own cells are "
             "known", {"coarse_light": False}),
            ("the coarser light is shifted by one cell", {"shift": 1}),
            ("the coarser light is shifted by one cell to the left and up", {"shift": -1}),
            ("rows and columns of the coarser level are exchanged", {"turned": True}),
            ("the cell of the coarser level is found without halving its row and column", {"halved": False}),
            ("rows of the coarser level lie half as many cells apart as this level has columns, rounded down",
             {"stride": lambda own, _: own[1] // 2}),
            ("rows of the coarser level lie as many cells apart as this level has columns",
             {"stride": lambda own, _: own[1]}),
            ("rows of the coarser level lie as many cells apart as it has rows, not columns",
             {"stride": lambda _, coarse: coarse[0]}),
            ("light spreads into cells without surface", {"spread": True}),
            ("the coarser light counts as known everywhere", {"known": True})):
        yield Bug(cause, literal(**knobs), MASK if "known" in knobs else "cell i lies in cell i / 2")
    yield Bug("the coarser light is doubled but not filtered", literal(weights=(0, 1, 0)), "E-AMS-09")


def _plus(i: int, j: int) -> float:
    return 0.0 if i and j else (1.0 if i or j else 2.0) * 2


def _cross(i: int, j: int) -> float:
    return 1.0 if i and j else (0.0 if i or j else 4.0)


def _added(i: int, j: int) -> float:
    return (1.0 if i else 2.0) + (1.0 if j else 2.0)


def _without_middle(i: int, j: int) -> float:
    return (1.0 if i else 2.0) * (1.0 if j else 2.0) if i or j else 0.0


def tent(
    layer: Array, leaf: Array, coarse: tuple[Array, Array], filled: Array, *, every: bool, corner: bool | str,
    weights: tuple[int, int, int] = (1, 2, 1), masked: bool = True, border: Any = "edge", shift: int = 0,
    spread: bool = False, plane: Callable[[int, int], float] | None = None, divided: Any = None,
    left_out: tuple[tuple[int | None, int | None], ...] = (), counted: str = "", in_place: bool = False,
    passes: int = 1, own: bool = True, coarse_light: bool = True, turned: bool = False, halved: bool = True,
    known: bool = False, stride: Callable[[tuple[int, ...], tuple[int, ...]], int] | None = None,
) -> tuple[Array, Array]:
    """Return a level of the masked tent filter and its mask, with bugs, in float64."""
    leaf = leaf & own
    i, j = np.mgrid[: filled.shape[0], : filled.shape[1]]
    i, j = (j, i) if turned else (i, j)
    row, column = (np.clip((index + shift) // (2 if halved else 1), 0, size - 1)
                   for index, size in ((i, coarse[1].shape[0]), (j, coarse[1].shape[1])))
    if stride is not None:  # row * stride + column of a flat array
        flat = row * stride(filled.shape, coarse[1].shape) + column
        row, column = np.divmod(np.minimum(flat, coarse[1].size - 1), coarse[1].shape[1])
    from_coarse = (coarse[1][row, column] | known) & (filled | spread) & coarse_light
    mask = from_coarse | leaf
    texels = np.where(leaf, layer, coarse[0][:, row, column].astype(np.float64)) * mask
    used = {"own": leaf, "coarse": from_coarse & ~leaf}.get(counted, mask)
    out = texels
    for _ in range(passes):
        mean = (_filtered_in_place if in_place else _filtered)(
            out, used, border, corner, weights, masked, plane, divided, left_out, mask & (~leaf | every))
        out = np.where(mask, np.where(leaf & (not every), texels, mean), 0.0)
    return out, mask


def _filtered(
    texels: Array, mask: Array, border: Any, corner: bool | str, weights: tuple[int, int, int], masked: bool,
    plane: Callable[[int, int], float] | None, divided: Any, left_out: tuple[tuple[int | None, int | None], ...],
    _: Array,
) -> Array:
    rows, columns = mask.shape
    mode: Any = "constant" if border == "none" else border
    mode = "edge" if mode == "reflect" and min(mask.shape) < 2 else mode
    around = np.pad(texels, ((0, 0), (1, 1), (1, 1)), mode=mode)
    known = np.pad(mask, 1, mode=mode if mode != "constant" or border == "none" else "edge")
    total, weight = np.zeros_like(texels), np.zeros((rows, columns))
    for i, j in np.ndindex(3, 3):
        if any((y is None or y == i - 1) and (x is None or x == j - 1) for y, x in left_out):
            continue
        part = np.s_[i : i + rows, j : j + columns]
        counts = known[part] & (_beside(known, part, corner) if corner and i != 1 and j != 1 else True)
        factor = weights[i] * weights[j] if plane is None else plane(abs(i - 1), abs(j - 1))
        share = factor * (counts if masked else np.ones_like(counts))
        total = total + share * around[:, *part]
        weight = weight + (counts if divided == "count" else share)
    weight = np.full_like(weight, divided) if isinstance(divided, float) else weight
    return np.divide(total, weight, out=np.zeros_like(total), where=weight > 0)


def _beside(known: Array, part: tuple[slice, slice], corner: bool | str) -> Array:
    """Return whether the rule lets a cell across a corner count: one of the cells beside it is known."""
    above, left = known[part[0], 1:-1], known[1:-1, part[1]]
    return np.asarray({"both": above & left, "none": ~(above | left), "rows": above, "columns": left}.get(
        str(corner), above | left))


def _filtered_in_place(
    texels: Array, mask: Array, border: Any, corner: bool | str, weights: tuple[int, int, int], masked: bool,
    plane: Callable[[int, int], float] | None, divided: Any, left_out: tuple[tuple[int | None, int | None], ...],
    filtered: Array,
) -> Array:
    out = np.array(texels)
    for i, j in zip(*np.nonzero(filtered), strict=True):
        top, left = max(i - 1, 0), max(j - 1, 0)
        part = np.s_[top : i + 2, left : j + 2]
        near = _filtered(out[:, *part], mask[part], border, corner, weights, masked, plane, divided, left_out, mask)
        out[:, i, j] = near[:, i - top, j - left]
    return out


def nearest_bugs(run: Run) -> Iterator[Bug]:
    """Yield likely bugs where each pixel has the light of its subsplat; `run` is the stage."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: {"multires.upsampled.0": literal_nearest(arrays, **bugs)}

    sides = "each pixel that shows a surface has the light of its subsplat"
    for cause, trim in (("the last row of each subsplat gets no light", (0, 1, 0, 0)),
                        ("the last column of each subsplat gets no light", (0, 0, 0, 1)),
                        ("the last row and column of each subsplat get no light", (0, 1, 0, 1)),
                        ("the first row of each subsplat gets no light", (1, 0, 0, 0)),
                        ("the first column of each subsplat gets no light", (0, 0, 1, 0)),
                        ("subsplats lie one row and one column too far down and right", (1, -1, 1, -1))):
        yield Bug(cause, literal(trim=trim), sides)
    for cause, how in (("light is written to the first pixel of each subsplat alone", "first pixel"),
                       ("every subsplat is half as wide: cells of 2^(level - 1) pixels", "half"),
                       ("every subsplat counts as a pixel: its level is not looked at", "pixel"),
                       ("the light of the first subsplat for all", "first"),
                       ("the light of the next subsplat is written", "next"),
                       ("light is divided by the number of the subsplat's pixels", "shared"),
                       ("rows run upwards", "upwards"),
                       ("cells that the border cuts get no light", "cut")):
        yield Bug(cause, literal(how=how), sides)
    yield Bug("the first channel for all: red", writing(run, multires__upsampled__0=lambda a: np.repeat(a[:1], 3, 0)),
              sides)


def literal_nearest(arrays: Arrays, *, trim: tuple[int, int, int, int] = (0, 0, 0, 0), how: str = "") -> Array:
    """Return the light of each pixel's subsplat, with bugs; `trim`: rows and columns of a subsplat left out."""
    shown = np.asarray(arrays["gbuffer.triangle_id"]) >= 0
    light, out = np.asarray(arrays[LIST[3]]), np.zeros((3, *shown.shape))
    light = {"first": np.repeat(light[:, :1], light.shape[1], 1), "next": np.roll(light, -1, axis=1)}.get(how, light)
    for k, (level, row, column) in enumerate(zip(*(np.asarray(arrays[name]).tolist() for name in LIST[:3]),
                                                 strict=True)):
        side = {"half": max((1 << level) // 2, 1), "pixel": 1}.get(how, 1 << level)
        y, x = row * side, column * side
        bottom, right = (y + 1, x + 1) if how == "first pixel" else (y + side - trim[1], x + side - trim[3])
        if how == "cut" and (bottom > shown.shape[0] or right > shown.shape[1]):
            continue
        part = np.s_[y + trim[0] : bottom, x + trim[2] : right]
        value = light[:, k] / (side * side if how == "shared" else 1)
        out[:, *part] = np.where(shown[part], value[:, None, None], out[:, *part])
    return out[:, ::-1] if how == "upwards" else out
