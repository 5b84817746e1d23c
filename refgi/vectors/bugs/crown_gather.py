"""Likely bugs of the sum over samples (HSS Eq. 1, 4): the stage written out, each of its parts a function to replace.

x, n: place and normal of the receiver; y, m: of the sender; d = y - x.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug
from refgi.vectors.stages.levels import level_names

EQ1 = "HSS Eq. 1: a sum over all samples"
EQ4 = "HSS Eq. 4 with its pi (E-HSS-04): pi cos R^2 / (r^2 + R^2), R^2 = cos' ds / pi"
AREA, OUTSIDE, TILE = "E-HSS-06", "E-HSS-08", "offsets[row % m, column % P]"
SENDER = ("position", "normal", "radiance", "area")


class Pairs(NamedTuple):
    """What each receiver and each of its samples have, (h, w, n)."""

    square: Array  # of the distance r
    r: Array
    received: Array  # n . d
    sent: Array  # -m . d
    area: Array  # of the sender's texel
    own_area: Array  # of the receiver's
    weight: Array  # texels that the sample stands for


def disc(p: Pairs, received: Array | None = None, sent: Array | None = None, area: Array | None = None) -> Array:
    """Return the form factor of Eq. 4; cosines and area may be given."""
    received = np.maximum(p.received / p.r, 0) if received is None else received
    sent = np.maximum(p.sent / p.r, 0) if sent is None else sent
    disc_square = sent * (p.area * p.weight if area is None else area) / math.pi
    return np.asarray(math.pi * received * disc_square / np.maximum(p.square + disc_square, 1e-30))


def gathered(
    arrays: Arrays, index: int, *, form: Callable[[Pairs], Array] = disc, outside: str = "", transposed: bool = False,
    moved: tuple[int, int] = (0, 0), by: tuple[int, int] = (1, 1), weigh_by: tuple[int, int] = (1, 1),
    axes: tuple[int, int] = (1, 0), signs: tuple[int, int] = (1, 1), kept: slice = slice(None), facing: str = "sender",
    radiance_of: str = "sender", rim: tuple[int, int] = (0, 0), first_weight: bool = False,
) -> Array:
    """Return the light of the samples, in float64, with a bug."""
    place, normal, radiance, area = (np.asarray(arrays[name], np.float64) for name in level_names(index, *SENDER))
    offsets, weight = arrays[f"samples{index}.offsets"], np.asarray(arrays[f"samples{index}.weight"], np.float64)
    (h, w), row, column = area.shape, np.arange(area.shape[0])[:, None], np.arange(area.shape[1])
    down, across = (column, row) if transposed else (row - moved[0], column - moved[1])
    here = offsets[down * by[0] % len(offsets), across * by[1] % offsets.shape[1]][..., kept, :]
    stands_for = weight[down * by[0] * weigh_by[0] % len(weight),
                        across * by[1] * weigh_by[1] % weight.shape[1]][..., kept]
    stands_for = stands_for[..., :1] if first_weight else stands_for
    i, j = row[..., None] + signs[0] * here[..., axes[0]], column[..., None] + signs[1] * here[..., axes[1]]
    i, j, known = _inside(i, j, (h, w), outside, rim)
    stands_for = stands_for * known * ((i != row[..., None]) | (j != column[..., None]))
    if outside == "scaled":
        stands_for = stands_for * known.shape[-1] / np.maximum(known.sum(axis=-1, keepdims=True), 1)
    d = place[:, i, j] - place[..., None]
    square, up = (d**2).sum(axis=0), normal[:, i, j] if facing == "sender" else normal[..., None]
    pairs = Pairs(square, np.sqrt(np.maximum(square, 1e-30)), (normal[..., None] * d).sum(axis=0),
                  -(up * d).sum(axis=0), area[i, j], area[..., None], stands_for)
    light = radiance[..., None] if radiance_of == "receiver" else radiance[:, i, j]
    light = light[[0, 0, 0]] if radiance_of == "red" else light
    return np.asarray((form(pairs) * light).sum(axis=-1))


def _inside(
    i: Array, j: Array, size: tuple[int, int], outside: str, rim: tuple[int, int]
) -> tuple[Array, Array, Array]:
    """Return rows and columns of samples that can be read, and which of them count."""
    h, w = size
    if outside == "next row":  # what a row * w + column finds
        at = i * w + j
        known = (at >= 0) & (at < h * w)
        i, j = np.divmod(np.clip(at, 0, h * w - 1), w)
        return i, j, known
    if outside == "repeated":
        return i % h, j % w, np.ones(i.shape, bool)
    if outside == "mirrored":
        i, j = (np.abs(a) for a in (i, j))
        i, j = (np.where(a > n - 1, 2 * (n - 1) - a, a) for a, n in ((i, h), (j, w)))
        return np.clip(i, 0, h - 1), np.clip(j, 0, w - 1), np.ones(i.shape, bool)
    known = (i >= rim[0]) & (i < h - rim[1]) & (j >= rim[0]) & (j < w - rim[1])
    known |= outside == "edge"
    return np.clip(i, 0, h - 1), np.clip(j, 0, w - 1), known


def gather_bugs(index: int, inner: int, crown: int) -> list[Bug]:
    """Return the bugs of a level's sum over samples, `inner` in the disc, which come first, and `crown` others."""
    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        return Bug(cause, lambda arrays, real: {  # noqa: ARG005
            f"gather{index}.irradiance": gathered(arrays, index, **knobs)}, paper)

    places = [
        bug("samples outside the picture are moved to its edge: clamped to the border", OUTSIDE, outside="edge"),
        bug("samples outside the picture are made up for by those within", OUTSIDE, outside="scaled"),
        bug("samples outside the picture wrap to the other side: repeated", OUTSIDE, outside="repeated"),
        bug("samples outside the picture are mirrored at its border", OUTSIDE, outside="mirrored"),
        bug("samples beyond the left or right rim wrap to the next row: columns are not tested", OUTSIDE,
            outside="next row"),
        bug("samples in the first row and column count as outside: > 0 in place of >= 0", OUTSIDE, rim=(1, 0)),
        bug("samples in the last row and column count as outside: off by one", OUTSIDE, rim=(0, 1)),
        bug("rows and columns of the tile are exchanged: the tile is transposed", TILE, transposed=True),
        bug("samples of the receiver's left neighbour", TILE, moved=(0, 1)),
        bug("samples of the receiver's upper neighbour", TILE, moved=(1, 0)),
        bug("samples of the receiver's right neighbour", TILE, moved=(0, -1)),
        bug("samples and weights of the tile's first texel for all receivers", TILE, by=(0, 0)),
        bug("the row within the tile is left out: samples of its first row for all", TILE, by=(0, 1)),
        bug("the column within the tile is left out: samples of its first column for all", TILE, by=(1, 0)),
        bug("weights of the tile's first texel for all receivers", TILE, weigh_by=(0, 0)),
        bug("the first sample's weight for all samples", AREA, first_weight=True),
        bug("offsets are taken as (down, right): columns and rows are exchanged", "(right, down)", axes=(0, 1)),
        bug("rows run upwards: the sign of the row's offset", "row 0 is the top row", signs=(-1, 1)),
        bug("columns run leftwards: the sign of the column's offset", "(right, down)", signs=(1, -1)),
        bug("offsets are subtracted, not added: the opposite side", "(right, down)", signs=(-1, -1)),
        bug("the last sample is left out", EQ1, kept=slice(None, -1)),
        bug("the first sample is left out", EQ1, kept=slice(1, None)),
        bug("only the first sample counts", EQ1, kept=slice(0, 1)),
        bug("only the last sample counts: the sum is overwritten, not accumulated", EQ1, kept=slice(-1, None)),
        bug("radiance of the receiver in place of the sample's (the sender's)", EQ1, radiance_of="receiver"),
        bug("the red channel's radiance for green and blue as well: first channel", EQ1, radiance_of="red"),
        bug("the receiver's normal in place of the sender's", EQ4, facing="receiver"),
    ]
    if inner:
        places += [bug("the samples of the disc are left out: the crown alone", "HSS Sec. 3.2",
                       kept=slice(inner, None)),
                   bug("the samples of the crown are left out: the disc alone", "HSS Sec. 3.2",
                       kept=slice(0, inner))]
    return [*places, *_form_bugs(bug, index, inner + crown)]


def _form_bugs(bug: Callable[..., Bug], index: int, count: int) -> list[Bug]:
    """Return bugs of the form factor."""
    def cosines(p: Pairs) -> tuple[Array, Array]:
        return np.maximum(p.received / p.r, 0), np.maximum(p.sent / p.r, 0)

    def reach(p: Pairs) -> Array:
        """Return R^2."""
        return np.asarray(cosines(p)[1] * p.area * p.weight / math.pi)

    def over(p: Pairs, below: Array) -> Array:
        """Return Eq. 4 with another denominator."""
        return np.asarray(math.pi * cosines(p)[0] * reach(p) / np.maximum(below, 1e-30))

    ways: list[tuple[str, str, Callable[[Pairs], Array]]] = [
        ("Eq. 4 lacks its pi", "E-HSS-04", lambda p: disc(p) / math.pi),
        ("Eq. 4 has its pi twice: a factor pi too many", "E-HSS-04", lambda p: disc(p) * math.pi),
        ("the sample's surface is not divided by pi: R^2 = cos' ds", EQ4,
         lambda p: disc(p, area=math.pi * p.area * p.weight)),
        ("the sample's surface is divided by pi twice: R^2 = cos' ds / pi^2", EQ4,
         lambda p: disc(p, area=p.area * p.weight / math.pi)),
        ("Eq. 3 in place of Eq. 4: the disc's R^2 is missing in the denominator, 1/r^2 of a point", EQ4,
         lambda p: over(p, p.square)),
        ("the disc of Eq. 4 faces the receiver: the sender's cosine is missing in R^2 below", EQ4,
         lambda p: over(p, p.square + p.area * p.weight / math.pi)),
        ("the distance is not squared: r in place of r^2 beside R^2", EQ4,
         lambda p: over(p, p.r + reach(p))),
        ("R^2 is subtracted, r^2 - R^2 in the denominator: a wrong sign", EQ4,
         lambda p: over(p, np.abs(p.square - reach(p)))),
        ("R and not R^2 is added to r^2 in the denominator", EQ4,
         lambda p: over(p, p.square + np.sqrt(reach(p)))),
        ("the denominator is (r^2 + R^2) squared", EQ4,
         lambda p: over(p, (p.square + reach(p)) ** 2)),
        ("the distance is taken to the fourth power: 1/r^4, no normalised directions", EQ4,
         lambda p: over(p, p.square**2 + reach(p))),
        ("the disc is that of one texel, not of all that a sample stands for", AREA,
         lambda p: disc(p, area=p.area) * p.weight),
        ("weights of samples are left out: each stands for one texel", AREA,
         lambda p: disc(p, area=p.area * (p.weight > 0))),
        ("weights of samples are counted twice, in the area and in the sum", AREA, lambda p: disc(p) * p.weight),
        ("the area of the texels is left out", AREA, lambda p: disc(p, area=p.weight)),
        ("the receiver's surface (its area) in place of the sample's, the sender's", AREA,
         lambda p: disc(p, area=p.own_area * p.weight)),
        ("the receiver's cosine is missing", EQ4, lambda p: disc(p, received=(p.received > 0) * 1.0)),
        ("the sender's cosine is missing", EQ4, lambda p: disc(p, sent=(p.sent > 0) * 1.0)),
        ("both cosines are missing", EQ4, lambda p: disc(p, (p.received > 0) * 1.0, (p.sent > 0) * 1.0)),
        ("senders that face away send light: the absolute value of their cosine", EQ4,
         lambda p: disc(p, sent=np.abs(p.sent / p.r))),
        ("light arrives from behind the receiver: the absolute value of its cosine", EQ4,
         lambda p: disc(p, received=np.abs(p.received / p.r))),
        ("the receiver's cosine is not clamped to 0: negative light from behind", EQ4,
         lambda p: disc(p, received=p.received / p.r)),
        ("the sender's cosine is not clamped to 0: negative light of senders that face away", EQ4,
         lambda p: disc(p, sent=p.sent / p.r)),
        ("the sender's cosine has the wrong sign: its back sends light", EQ4,
         lambda p: disc(p, sent=np.maximum(-p.sent / p.r, 0))),
        ("the receiver's cosine has the wrong sign: light arrives from behind", EQ4,
         lambda p: disc(p, received=np.maximum(-p.received / p.r, 0))),
        ("the receiver's cosine is squared", EQ4, lambda p: disc(p, received=cosines(p)[0] ** 2)),
        ("the sender's cosine is squared", EQ4, lambda p: disc(p, sent=cosines(p)[1] ** 2)),
        ("the sender's cosine is multiplied by the distance: the direction is not normalised to unit length", EQ4,
         lambda p: disc(p, sent=np.maximum(p.sent, 0))),
        ("the receiver's cosine is multiplied by the distance: the direction is not normalised to unit length", EQ4,
         lambda p: disc(p, received=np.maximum(p.received, 0))),
        ("both cosines are multiplied by the distance: directions are not normalised to unit length", EQ4,
         lambda p: disc(p, np.maximum(p.received, 0), np.maximum(p.sent, 0))),
        ("the sender's cosine is divided by the distance twice", EQ4, lambda p: disc(p, sent=cosines(p)[1] / p.r)),
        ("the receiver's cosine is divided by the distance twice", EQ4,
         lambda p: disc(p, received=cosines(p)[0] / p.r)),
        ("the sender's cosine stands in place of the receiver's", EQ4, lambda p: disc(
            p, received=cosines(p)[1] * (p.received > 0))),
        ("the receiver's cosine stands in place of the sender's", EQ4, lambda p: disc(
            p, sent=cosines(p)[0] * (p.sent > 0))),
        ("the mean over the samples, not their sum: divided by their number once more", EQ1, lambda p: disc(p) / count),
        ("directions are divided by r^2, not by r", EQ4, lambda p: disc(
            p, cosines(p)[0] / p.r, cosines(p)[1] / p.r)),
    ]
    if index:
        ways.append(("areas are scaled by 4^k a second time", AREA, lambda p: disc(p) * 4.0**index))
        ways.append(("areas are divided by 4^k: a coarse texel counts as one of the first level", AREA,
                     lambda p: disc(p, area=p.area * p.weight / 4.0**index)))
    return [bug(cause, paper, form=form) for cause, paper, form in ways]
