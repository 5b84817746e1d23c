"""Likely bugs of the mip levels of what a camera sees (HSS Sec. 4, Eq. 2)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.vectors.bugs.nearest_texels import Surface, area_of, coarser_level, first_level
from refgi.vectors.spec import Array, Arrays, Bug

EQ2 = "HSS Eq. 2 with tan(f / 2) (E-HSS-03), dP = 4^k pixels (E-HSS-06)"
CLOSEST = "HSS Sec. 4: the closest of four, with its own position, normal and colour (E-HSS-09)"
TIES = "of equally near ones that nearest to the vertical centre line, then the upper, then the left"
PIXEL = "pixel of the picture, row * columns + column"
RADIANCE = "L = albedo/pi E"
EYE = "positions are relative to the eye, z times the ray of depth 1 through the pixel's centre (E-HSS-10)"


def _choices(side: str) -> list[tuple[str, str, dict[str, Any]]]:
    return [
        (f"the farthest of {side} is kept", CLOSEST, {"rule": "farthest"}),
        (f"the upper left of {side} is kept: the first, without comparing depths", CLOSEST, {"rule": "first"}),
        (f"the last of {side} is left out: never compared", CLOSEST, {"kept": lambda i, j: (i + 1) * (j + 1) < (
            i.max() + 1) * (j.max() + 1)}),
        (f"the first of {side} is left out: never compared", CLOSEST, {"kept": lambda i, j: i + j > 0}),
        (f"only the first row of {side} is compared", CLOSEST, {"kept": lambda i, j: (i == 0) & (j >= 0)}),
        (f"only the first column of {side} is compared", CLOSEST, {"kept": lambda i, j: (j == 0) & (i >= 0)}),
        (f"void counts as nearest among {side}: no surface hides those that there are", CLOSEST, {"void": True}),
        (f"of equally near ones among {side} the upper left one is kept: ties go by the index, not by the centre line",
         TIES, {"tie": "upper left"}),
        (f"of equally near ones among {side} the last one is kept: <= in place of < at ties", TIES, {"tie": "last"}),
        (f"of equally near ones among {side} that farthest from the centre line is kept", TIES, {"tie": "edge"}),
    ]


def first_level_bugs(view: Projection, number: int, cut: bool) -> list[Bug]:
    """Return the bugs of the first level, whose texels cover 2^number x 2^number pixels; or fewer: `cut`."""
    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        return Bug(cause, lambda arrays, real: _named(0, first_level(arrays, view, number, **knobs)),  # noqa: ARG005
                   paper)

    bugs = _surface_bugs(bug, number) + _radiance_bugs(bug)
    for cause, knobs in _places(number > 0):
        bugs += [bug(cause, EYE, **knobs), bug(cause, EYE, area_of_it=False, **knobs)]
    bugs.append(Bug("depth is the distance from the eye, not along the axis", lambda arrays, real: _distant(  # noqa: ARG005
        first_level(arrays, view, number)), "axial depth (E-HSS-02)"))
    if not number:
        return bugs
    bugs += [bug(cause, paper, choice=choice) for cause, paper, choice in _choices("a texel's pixels")]
    side, columns, height = 1 << number, -(-view.width >> number), view.height
    bugs += [
        bug("a texel stores its own index, not its pixel's: the texel's number in place of the pixel's", PIXEL,
            pixel=lambda y, x, row, column: row * columns + column + 0 * (y + x)),
        bug("a pixel is counted by the columns of the level, not of the picture", PIXEL,
            pixel=lambda y, x, row, column: y * columns + x + 0 * (row + column)),
        bug("a pixel is counted by rows, not by columns", PIXEL,
            pixel=lambda y, x, row, column: y + x * height + 0 * (row + column)),
        bug("a texel stores its upper left pixel, not the one that was kept", PIXEL,
            pixel=lambda y, x, row, column: row * side * view.width + column * side + 0 * (y + x)),
        bug("a texel stores the number of its pixel within the texel", PIXEL,
            pixel=lambda y, x, row, column: (y - row * side) * side + x - column * side),
        bug("radiance is that of the texel's upper left pixel, not of the one that was kept", CLOSEST,
            light_of="corner"),
        bug("the normal is that of the texel's upper left pixel, not of the one that was kept", CLOSEST,
            normal_of="corner"),
    ]
    bugs += [bug("texels at the rim count as whole: pixels outside the picture, beyond its border, are covered", EQ2,
                 whole=(True, True))] if cut else []
    return bugs


def _places(several: bool) -> list[tuple[str, dict[str, Any]]]:
    """Return bugs of positions; those of the area go with them in some ports."""
    one: list[tuple[str, dict[str, Any]]] = [
        ("pixel centres lie at 0 instead of 1/2: rays go through corners", {"row_at": 0.0, "column_at": 0.0}),
        ("rows of pixels lie at 0 instead of 1/2: no half pixel down", {"row_at": 0.0}),
        ("columns of pixels lie at 0 instead of 1/2: no half pixel across", {"column_at": 0.0}),
        ("positions lie in the world, not relative to the eye: the camera's origin is added", {"world": True}),
        ("rays have unit length: depth is taken along the ray, not along the axis", {"unit": True}),
        ("rows of rays run upwards: positions are upside down", {"signs": (-1, 1)}),
        ("columns of rays run leftwards: positions are mirrored", {"signs": (1, -1)}),
        ("positions are not multiplied by the depth: they lie on the image plane at depth 1", {"flat": True}),
    ]
    return [*one, ("positions lie on the ray through the texel's centre, not the pixel's", {"of_texel": True})] \
        if several else one


def _radiance_bugs(bug: Callable[..., Bug]) -> list[Bug]:
    return [
        bug("radiance is not divided by pi", RADIANCE, radiance=lambda albedo, light: albedo * light),
        bug("radiance is divided by pi twice", RADIANCE, radiance=lambda albedo, light: albedo * light / np.pi**2),
        bug("the albedo is left out of the radiance", RADIANCE, radiance=lambda albedo, light: (
            light / np.pi + 0 * albedo)),
        bug("the albedo counts twice: it is squared", RADIANCE, radiance=lambda albedo, light: (
            albedo**2 * light / np.pi)),
        bug("the light is left out of the radiance: albedo / pi alone", RADIANCE, radiance=lambda albedo, light: (
            albedo / np.pi + 0 * light)),
        bug("the red channel of the albedo for green and blue as well", RADIANCE, radiance=lambda albedo, light: (
            albedo[[0, 0, 0]] * light / np.pi)),
        bug("the mean of the albedo's channels for each: gray", RADIANCE, radiance=lambda albedo, light: (
            albedo.mean(axis=0) * light / np.pi)),
    ]


def _surface_bugs(bug: Callable[..., Bug], number: int) -> list[Bug]:
    """Return bugs of the area, Eq. 2."""
    ways: list[tuple[str, Callable[[Surface], Array]]] = [
        ("tan f in place of tan(f / 2) in the area", lambda s: area_of(s) * 4 / float(np.prod(
            [1 - tangent**2 for tangent in s.half]))),
        ("the area has the whole tangents in place of half: a factor 4 is missing", lambda s: area_of(s) / 4),
        ("the cosine at the surface (beta, its slant) is missing in the area", lambda s: area_of(s) * np.abs(s.facing)),
        ("both cosines, at the surface and at the eye, are missing in the area: its slant",
         lambda s: area_of(s) * np.abs(s.facing) / s.ray),
        ("the area is multiplied by the surface's cosine (slant), not divided", lambda s: area_of(s) * s.facing**2),
        ("the area is divided by the square of the surface's cosine (slant)", lambda s: area_of(s) / np.abs(s.facing)),
        ("the area is divided by the cosine of a ray of unit length: the cosine at the eye (alpha) is missing",
         lambda s: area_of(s) * s.ray),
        ("the area grows with depth and not with its square (depth * depth), or the cosine is not normalised by depth",
         lambda s: area_of(s) / np.where(s.z > 0, s.z, 1)),
        ("the area does not grow with depth: the square of the depth (z^2) is missing",
         lambda s: area_of(s) / np.where(s.z > 0, s.z, 1) ** 2),
        ("the area grows with the cube of the depth", lambda s: area_of(s) * s.z),
        ("the area is computed of the distance, not of the depth: its square", lambda s: area_of(s) * s.ray**2),
        ("the area has the tangent across for that down as well: half[0] twice",
         lambda s: area_of(s) * s.half[0] / s.half[1]),
        ("the area has the tangent down for that across as well: half[1] twice",
         lambda s: area_of(s) * s.half[1] / s.half[0]),
        ("tangents are missing in the area: those of 90 degrees", lambda s: area_of(s) / (s.half[0] * s.half[1])),
        ("the area is not divided by the number of pixels of the picture",
         lambda s: area_of(s) * 4 * s.half[0] * s.half[1] / s.pixel_area),
    ]
    if number:
        ways += [
            ("the area is that of one pixel, not of all of the texel", lambda s: area_of(s) / np.maximum(s.pixels, 1)),
            ("the area is that of one side of the texel: 2^k in place of 4^k pixels", lambda s: area_of(s) / 2**number),
        ]
    return [bug(cause, EQ2, area=area) for cause, area in ways]


def coarser_level_bugs(index: int, number: int, size: tuple[int, int], cut: tuple[bool, bool]) -> list[Bug]:
    """Return the bugs of a coarser level of a picture of some rows and columns, which may `cut` its texels."""
    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        return Bug(cause, lambda arrays, real: _named(index, coarser_level(  # noqa: ARG005
            arrays, index, number, size, **knobs)), paper)

    bugs = [bug(cause, paper, choice=choice) for cause, paper, choice in _choices("four texels")]
    bugs += [
        bug("beyond the right rim of the level the next row's first texel is taken: columns wrap, not tested", CLOSEST,
            choice={"next_row": True}),
        bug("areas are not four times those of the finer level", EQ2, area=lambda a, to, of: a + 0 * (to + of)),
        bug("areas are twice those of the finer level, not four times", EQ2, area=lambda a, to, of: 2 * a + 0 * (
            to + of)),
        bug("areas are divided by four: a wrong way", EQ2, area=lambda a, to, of: a * of / np.maximum(to, 1)),
        bug("areas are multiplied by all pixels of the texel, not by how many more they are", EQ2,
            area=lambda a, to, of: a * to + 0 * of),
        bug("the area is the sum of the four texels', not four times the nearest one's", EQ2, summed=True),
        bug("the area is the mean of the four texels'", EQ2, means=("area",)),
        bug("radiance is the mean of four texels", CLOSEST, means=("radiance",)),
        bug("normals are means of four texels", CLOSEST, means=("normal",)),
        bug("positions are means of four texels", CLOSEST, means=("position",)),
        bug("depths are means of four texels", CLOSEST, means=("depth",)),
        bug("positions, normals and radiance are means of four texels", CLOSEST,
            means=("position", "normal", "radiance")),
        bug("all of a texel but its depth is that of the upper left of four", CLOSEST,
            first=("position", "normal", "radiance", "pixel")),
        bug("radiance is that of the upper left of four texels", CLOSEST, first=("radiance",)),
        bug("the normal is that of the upper left of four texels", CLOSEST, first=("normal",)),
        bug("a texel stores the index of the finer texel, not the pixel's", PIXEL,
            pixel=lambda y, x, row, column: y * -(-size[1] >> (number - 1)) + x + 0 * (row + column)),
        bug("a texel stores its own index, not its pixel's: the texel's number in place of the pixel's", PIXEL,
            pixel=lambda y, x, row, column: row * -(-size[1] >> number) + column + 0 * (y + x)),
    ]
    if any(cut):
        bugs += [
            bug("texels at the rim count as whole: pixels outside the picture, beyond its border, are covered", EQ2,
                area=lambda a, to, of: 4 * a + 0 * (to + of)),
            bug("texels at the rim count as if all their pixels lay in the picture: none are outside its border", EQ2,
                whole=(True, True)),
            bug("finer texels at the rim count as whole: pixels outside the picture, beyond its border", EQ2,
                finer_whole=(True, True)),
        ]
        bugs += [bug("texels at the lower rim count as whole: rows outside the picture, beyond its border", EQ2,
                     whole=(True, False))] if cut[0] else []
        bugs += [bug("texels at the right rim count as whole: columns outside the picture, beyond its border", EQ2,
                     whole=(False, True))] if cut[1] else []
    return bugs


def _named(index: int, planes: Arrays) -> dict[str, Array]:
    return {f"level{index}.{key}": array for key, array in planes.items()}


def _distant(planes: dict[str, Array]) -> dict[str, Array]:
    far = np.sqrt((planes["position"] ** 2).sum(axis=0))
    return _named(0, planes | {"depth": np.where(np.isfinite(planes["depth"]), far, np.inf)})
