"""What ports get wrong in the points and normals of subsplats (Nichols and Wyman 2009, Sec. 3.4)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from refgi.splat.multires.settings import Representative
from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"
LIST = ("multires.level", "multires.row", "multires.column", "multires.pixel")
POINTS = ("multires.point", "multires.normal")


def point_bugs(representative: Representative) -> Iterator[Bug]:
    """Yield likely bugs of the point and normal that each subsplat is evaluated at."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: literal_points(arrays, representative, **bugs)

    for cause, knobs in (
            ("all subsplats lie at the first one's place", {"change": "first"}),
            ("each subsplat lies at the next one's place", {"change": "next"}),
            ("normals are turned round", {"change": "turned"}),
            ("components of pictures lie beside each other (h, w, 3), not in planes (3, h, w)", {"read": "beside"})):
        yield Bug(cause, literal(**knobs), "E-AMS-11")
    if representative == "pixel":
        for cause, of_pixel in (
                ("the pixel to the left of the representative one", "left"),
                ("the pixel to the right of the representative one", "right"),
                ("the pixel above the representative one", "above"),
                ("the pixel below the representative one", "below"),
                ("the pixel at the cell's corner (upper left, its first pixel), not the representative one", "corner"),
                ("the pixel at the cell's centre, whether it shows a surface or not, not the representative one",
                 "centre"),
                ("the place in the list in place of the pixel's index", "list"),
                ("rows of the cell are not multiplied by its side 2^level", "row column"),
                ("pixels are counted from the lower row upwards", "upwards"),
                ("the pixel's row and column are found with the number of rows", "stride")):
            yield Bug(cause, literal(of_pixel=of_pixel), "E-AMS-11")
        yield Bug("the mean normal of the cell, at the representative pixel", literal(normal_of="mean"), "E-AMS-11")
        yield Bug("the representative pixel's normal, at the mean of the cell's surface", literal(point_of="mean"),
                  "E-AMS-11")
        return
    means: tuple[tuple[str, dict[str, Any]], ...] = (
            ("the mean position with the representative pixel's normal", {"normal_of": "pixel"}),
            ("the representative pixel's position with the mean normal", {"point_of": "pixel"}),
            ("positions are added, not divided by their number: sum in place of mean", {"divided": "none"}),
            ("sums are divided by all pixels of the cell, not by those that show a surface", {"divided": "side"}),
            ("the middle of least and largest position, not the mean", {"point_of": "middle"}),
            ("the normal of the cell's first pixel, not the mean", {"normal_of": "first"}),
            ("the position of the cell's first pixel, not the mean", {"point_of": "first"}),
            ("the last row of each cell is left out of the mean", {"trim": (0, 1, 0, 0)}),
            ("the last column of each cell is left out of the mean", {"trim": (0, 0, 0, 1)}),
            ("the first row of each cell is left out of the mean", {"trim": (1, 0, 0, 0)}),
            ("one row and one column too many count in the mean", {"trim": (0, -1, 0, -1)}),
            ("cells are one level too large: 2^(level + 1) pixels", {"size": 1}),
            ("cells are one level too small: 2^(level - 1) pixels", {"size": -1}))
    for cause, more in means:
        yield Bug(cause, literal(**more), "mean of the surface")


def literal_points(
    arrays: Arrays, representative: Representative, *, change: str = "", read: str = "", of_pixel: str = "",
    point_of: str = "", normal_of: str = "", divided: str = "", trim: tuple[int, int, int, int] = (0, 0, 0, 0),
    size: int = 0,
) -> dict[str, Array]:
    """Return point and normal of each subsplat, with bugs."""
    planes = [np.asarray(arrays[f"gbuffer.{name}"], np.float64) for name in ("position", "normal")]
    if read == "beside":
        planes = [np.moveaxis(plane.reshape(*plane.shape[1:], 3), -1, 0) for plane in planes]
    shown, made = np.asarray(arrays[IDS]) >= 0, np.zeros((2, 3, len(np.asarray(arrays[LIST[0]]))))
    for k, (level, row, column, pixel) in enumerate(zip(*(np.asarray(arrays[name]).tolist() for name in LIST),
                                                        strict=True)):
        y, x = _pixel((level, row, column, pixel, k), shown.shape, of_pixel)
        side = 1 << max(level + size, 0)
        rows, columns = (slice(at * side + trim[2 * axis], max((at + 1) * side - trim[2 * axis + 1], at * side + 1))
                         for axis, at in enumerate((row, column)))
        here = shown[rows, columns]
        for which, (plane, how) in enumerate(zip(planes, (point_of, normal_of), strict=True)):
            cell = plane[:, rows, columns][:, here]
            how = how or representative
            if how == "pixel" or not cell.size:
                made[which, :, k] = plane[:, y, x]
            elif how in ("first", "middle"):
                made[which, :, k] = cell[:, 0] if how == "first" else (cell.min(axis=1) + cell.max(axis=1)) / 2
            else:
                count = {"none": 1, "side": side * side}.get(divided, cell.shape[1])
                mean = cell.sum(axis=1) / (cell.shape[1] if which else count)
                made[which, :, k] = mean / (np.linalg.norm(mean) or 1.0) if which else mean
    made = {"first": np.broadcast_to(made[..., :1], made.shape), "next": np.roll(made, -1, axis=-1)}.get(change, made)
    return {POINTS[0]: made[0], POINTS[1]: -made[1] if change == "turned" else made[1]}


def _pixel(entry: tuple[int, int, int, int, int], shape: tuple[int, int], how: str) -> tuple[int, int]:
    level, row, column, pixel, k = entry
    height, width = shape
    y, x = divmod(pixel, width)
    half = (1 << level) // 2
    y, x = {"left": (y, x - 1), "right": (y, x + 1), "above": (y - 1, x), "below": (y + 1, x),
            "corner": (row << level, column << level), "centre": ((row << level) + half, (column << level) + half),
            "list": divmod(k, width), "row column": (row, column), "upwards": (height - 1 - y, x),
            "stride": divmod(pixel, height)}.get(how, (y, x))
    return min(max(y, 0), height - 1), min(max(x, 0), width - 1)
