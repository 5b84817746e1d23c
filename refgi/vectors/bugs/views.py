"""Cameras and maps of lights as a port has them, and what ports get wrong about them (docs/conventions)."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection
from refgi.vectors.spec import Array, Arrays

ALL_CENTRES = "centres at + 1/2 (docs/conventions)"
CENTRES = {  # row and column of a texel's point
    "rays go through the texels' left edges: half a texel is missing along columns": (0.5, 0.0),
    "rays go through the texels' upper edges: half a texel is missing along rows": (0.0, 0.5),
    "texel centres lie at 0 instead of 1/2: no half texel is added": (0.0, 0.0),
    "rays go through the texels' right edges: half a texel too much along columns": (0.5, 1.0),
    "rays go through the texels' lower edges: half a texel too much along rows": (1.0, 0.5),
}
FRAME, CUBE = "rows of a frame are right, down, forward", "each face of a cube has its own frame"
HALF = "half extents, horizontal and vertical"


class View(NamedTuple):
    """Maps stacked along rows."""

    parallel: bool
    maps: int
    rows: int  # of one map
    columns: int
    origin: Array  # (k, 3)
    frame: Array  # (k, 3, 3): right, down, forward
    half: Array  # (2,)

    def image_points(
        self, centre: tuple[float, float] = (0.5, 0.5), less: int = 0, rows: Array | None = None
    ) -> tuple[Array, Array]:
        """Return x and y on the image plane of each texel of one map, or of some rows of it: (rows, columns) each."""
        row, column = np.meshgrid(np.arange(self.rows) if rows is None else rows, np.arange(self.columns),
                                  indexing="ij")
        x = (2 * (column + centre[1]) / max(self.columns - less, 1) - 1) * self.half[0]
        return x, (2 * (row + centre[0]) / max(self.rows - less, 1) - 1) * self.half[1]


ViewChange = Callable[[View], View]


def view_of(arrays: Arrays, name: str, maps: Projection) -> View:
    """Return the camera or maps among arrays."""
    origin, frame, half = (np.asarray(arrays[f"{name}.{key}"], np.float64) for key in ("origin", "frame", "half"))
    return View(maps.kind == ORTHOGRAPHIC, maps.maps, maps.height, maps.width, origin, frame, half)


def view_changes(maps: Projection) -> Iterator[tuple[str, ViewChange, str]]:
    """Yield causes, what turns a view into the wrong one, and where it says how it should be."""
    yield "columns run leftwards: right and left are exchanged", _framed(lambda f: f * _signs(-1, 1, 1)), FRAME
    yield "the frame's forward axis is turned round: the view looks backwards", _framed(
        lambda f: f * _signs(1, 1, -1)), FRAME
    yield "the frame is transposed: columns in place of rows", _framed(lambda f: np.swapaxes(f, 1, 2)), FRAME
    yield "right and down are exchanged: rows and columns of the image plane", _framed(lambda f: f[:, [1, 0, 2]]), FRAME
    yield "right and forward are exchanged in the frame", _framed(lambda f: f[:, [2, 1, 0]]), FRAME
    yield "the view has no origin: the eye lies at 0, the translation is missing", _placed(np.zeros_like), "origin"
    yield "the origin is added in place of subtracted: the sign of the eye's translation", _placed(
        lambda a: -a), "origin"
    yield "horizontal and vertical half extent are exchanged: the aspect ratio is inverted", _extended(
        lambda a: a[[1, 0]]), HALF
    yield "the vertical half extent for both axes: the aspect ratio is left out", _extended(lambda a: a[[1, 1]]), HALF
    yield "the horizontal half extent for both axes: the aspect ratio is left out", _extended(
        lambda a: a[[0, 0]]), HALF
    yield "the half extent is left out: 1 in its place", _extended(np.ones_like), HALF
    yield "whole extents in place of half ones: the view is half as wide", _extended(lambda a: a / 2), HALF
    yield "the view is twice as wide as its half extent says", _extended(lambda a: a * 2), HALF
    if maps.maps > 1:
        yield "every face of a cube has the first face's frame: the first map for all", _framed(_first), CUBE
        yield "every face of a cube looks along the first face's forward axis", _framed(_first_axis(2)), CUBE
        yield "every face of a cube has the first face's right", _framed(_first_axis(0)), CUBE
        yield "every face of a cube has the first face's down", _framed(_first_axis(1)), CUBE
        yield "faces of a cube are in another order: each axis' negative face first", _framed(
            lambda f: f[[k ^ 1 if k ^ 1 < len(f) else k for k in range(len(f))]]), CUBE
        yield "faces of a cube are one off: each has the frame of the next map", _framed(
            lambda f: np.roll(f, -1, axis=0)), CUBE
        yield "faces of a cube are turned by 180 degrees, as in OpenGL", _framed(lambda f: f * _signs(-1, -1, 1)), CUBE


def _signs(*signs: float) -> Array:
    return np.reshape(signs, (3, 1))


def _framed(change: Any) -> ViewChange:
    return lambda view: view._replace(frame=change(view.frame))


def _placed(change: Any) -> ViewChange:
    return lambda view: view._replace(origin=change(view.origin))


def _extended(change: Any) -> ViewChange:
    return lambda view: view._replace(half=change(view.half))


def _first(frame: Array) -> Array:
    return np.broadcast_to(frame[:1], frame.shape)


def _first_axis(axis: int) -> Any:
    def changed(frame: Array) -> Array:
        made = frame.copy()
        made[:, axis] = frame[0, axis]
        return made

    return changed
