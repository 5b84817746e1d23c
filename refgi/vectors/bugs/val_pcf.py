"""Depth tests of a square of texels as a port writes them, and as it gets them wrong (VAL-03; A.6 P4, E-VAL-14)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.bugs.val_cone import Cone, first, seen_from
from refgi.vectors.spec import Array, Arrays, Bug, Run

PLANE, OWN = "E-VAL-14: before the receiver's plane and the receiver", "floor((s + 1) / 2 n)"
SLACK = 1e-3


class DepthTests(NamedTuple):
    """How texels are tested; by default as the stage does."""

    cone: Cone = Cone()
    axes: tuple[int, int] = (0, 1)
    signs: tuple[int, int] = (1, 1)
    total: Callable[[Any, Any], Any] = lambda d, forward: d + forward
    place: Callable[[Any, int], Any] = lambda s, n: (s + 1) / 2 * n
    whole: Callable[[Any], Any] = np.floor
    alone: str = ""  # "column" or "row": the one that `place` is of, the other is right
    before: tuple[int, int] = (0, 0)  # rows and columns that the kernel lacks at its begin
    after: tuple[int, int] = (0, 0)  # and at its end
    only: Callable[[int, int], bool] = lambda dy, dx: True  # noqa: ARG005
    in_disc: bool = True
    outside: str = "skipped"  # texels beyond the disc; "counted": they do not hide
    half: float = 0.5
    slack: float = SLACK
    direction: Callable[[Any, Any, Any], Any] = lambda s, t, q: np.stack([2 * s, 2 * t, 1 - q]) / (1 + q)
    unit: Callable[[Any], Any] = lambda w: w
    turned: str = "both"
    plane: bool = True
    receiver: bool = True  # texels behind the receiver do not hide it
    away: bool = True  # directions away from the plane hide where they are near enough
    facing: Callable[[Any], Any] = lambda n: n
    limit: Callable[[Any, Any], Any] = lambda height, slope: height / slope
    behind: bool = True  # pixels behind the light's plane are seen
    depth_of: Callable[[Any], Any] = lambda depth: depth
    share: Callable[[Any, Any], Any] = lambda hidden, count: 1 - hidden / count
    extents: str = ""  # "swapped": the kernel is of lights without extent; "all": lights with extent too are tested


RIGHT = DepthTests()


def depth_tests_by(name: str, texels: int, how: DepthTests) -> Run:
    """Return V by depth tests as a port writes them."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        local, d = seen_from(arrays, how.cone)
        delta, near = np.asarray(arrays["areas.delta"]), np.asarray(arrays["maps.near"])
        frame = np.asarray(first(arrays, how.cone, "areas.frame"), np.float64)
        normal = np.einsum("kac,cij->akij", frame, how.facing(np.asarray(arrays["gbuffer.facing"], np.float64)))
        depth = how.depth_of(np.asarray(first(arrays, how.cone, "maps.depth"), np.float64))
        made, seen = np.ones(d.shape), np.asarray(arrays["gbuffer.triangle_id"]) >= 0
        for k in np.flatnonzero(np.isfinite(near)):
            if name == "hard" and how.extents != "all" and (delta[k] > 0) != (how.extents == "swapped"):
                continue
            wide = (delta[k] > 0) != (how.extents == "swapped") or name == "hard"
            asked = seen & ((local[2, k] > 0) if how.behind else True)
            with np.errstate(all="ignore"):
                share = _share(depth[k], local[:, k][:, asked], d[k][asked], normal[:, k][:, asked],
                               texels if wide else 1, how)
            made[k][asked] = np.nan_to_num(share, nan=1.0)
        return {f"{name}.share": made}

    return run


def _share(depth: Array, place: Array, d: Array, normal: Array, texels: int, how: DepthTests) -> Array:
    n = len(depth)
    where = [(how if how.alone in ("", one) else RIGHT).place(sign * place[axis] / how.total(d, place[2]), n)
             for one, axis, sign in zip(("column", "row"), how.axes, how.signs, strict=True)]
    column, row = (np.clip(np.nan_to_num(how.whole(one)), -9, n + 9).astype(int) for one in where)
    reach, hidden, count = texels // 2, np.zeros(len(d)), np.zeros(len(d))
    for dy in range(-reach + how.before[0], reach + 1 - how.after[0]):
        for dx in range(-reach + how.before[1], reach + 1 - how.after[1]):
            if not how.only(dy, dx):
                continue
            y, x = row + dy, column + dx
            s, t = (2 * (one + how.half) / n - 1 for one in (x, y))
            held = (x >= 0) & (y >= 0) & (x < n) & (y < n)
            used = held & ((s * s + t * t <= 1) | (not how.in_disc))
            used |= (dy == 0) & (dx == 0)  # the receiver's own texel counts always
            z = depth[np.clip(y, 0, n - 1), np.clip(x, 0, n - 1)]
            hidden += used & _hides(z, s, t, place, d, normal, how)
            count += used | (how.outside == "counted")
    return np.asarray(np.where(count > 0, how.share(hidden, count), 1))


def _hides(z: Array, s: Array, t: Array, place: Array, d: Array, normal: Array, how: DepthTests) -> Array:
    w = how.unit(how.direction(s, t, s * s + t * t))
    height, slope = -(normal * place).sum(axis=0), (normal * w).sum(axis=0)  # of the centre above the plane
    below = height < 0
    out = below if how.turned == "none" else False
    slope = np.where(below, -slope, slope) if how.turned in ("both", "slope") else slope
    slope = np.where(below, slope, -slope) if how.turned == "opposite" else slope
    height = np.abs(height) if how.turned == "opposite" else height
    height = np.where(below, -height, height) if how.turned in ("both", "height") else height
    room = 1 - how.slack
    at_plane = z < how.limit(height, -slope) * room
    hit = np.where(slope >= 0, how.away, at_plane) if how.plane else np.ones(z.shape, bool)
    return np.asarray(np.isfinite(z) & hit & ((z < d * room) | (not how.receiver)) & ~np.asarray(out))


TESTS: Mapping[str, DepthTests] = {
    "depths are compared with the pixel's plane alone, not with its distance": DepthTests(receiver=False),
    "receivers below the light's side are not turned: their normals keep their sign, never hidden": DepthTests(
        turned="none"),
    "normals are not turned to the light's side: height and slope keep their sign": DepthTests(turned=""),
    "the height alone is turned to the light's side, not the slope: wrong sign": DepthTests(turned="height"),
    "the slope alone is turned to the light's side, not the height: wrong sign": DepthTests(turned="slope"),
    "the height of the plane has the wrong sign: from the pixel to the light, turned against the slope": DepthTests(
        turned="opposite"),
    "height over slope has the wrong sign: the plane never hides": DepthTests(
        limit=lambda height, slope: -height / slope),
    "directions away from the receiver's plane never hide": DepthTests(away=False),
    "height times slope for height over slope": DepthTests(limit=lambda height, slope: height * slope),
    "slope over height for height over slope": DepthTests(limit=lambda height, slope: slope / height),
    "the height of the plane is not divided by the slope": DepthTests(limit=lambda height, slope: height + 0 * slope),
    "no slack: surfaces hide themselves": DepthTests(slack=0.0),
    "the slack has the wrong sign: 1 + 1e-3": DepthTests(slack=-SLACK),
    "the slack is a hundred times as large: 0.1": DepthTests(slack=0.1),
    "rows and columns of the receiver's texel are exchanged (swapped)": DepthTests(axes=(1, 0)),
    "columns run leftwards: sign of right, mirrored": DepthTests(signs=(-1, 1)),
    "the receiver's row runs upwards: sign of down": DepthTests(signs=(1, -1)),
    "rows and columns run the other way: directions from the pixel to the light": DepthTests(signs=(-1, -1)),
    "both coordinates of the receiver's texel are the column: right alone": DepthTests(axes=(0, 0)),
    "both coordinates of the receiver's texel are the row: down alone": DepthTests(axes=(1, 1)),
    "the receiver's texel is rounded to the nearest, not cut off (floor): half a texel is added": DepthTests(
        whole=np.round),
    "half a texel is subtracted from the receiver's place": DepthTests(place=lambda s, n: (s + 1) / 2 * n - 0.5),
    "the receiver's texel is s n: places of [0, 1], not of [-1, 1]": DepthTests(place=lambda s, n: s * n),
    "the receiver's texel is one too far left and up": DepthTests(place=lambda s, n: (s + 1) / 2 * n - 1),
    "the receiver's texel is one too far right and down": DepthTests(place=lambda s, n: (s + 1) / 2 * n + 1),
    "the receiver's texel is scaled by n - 1, not n": DepthTests(place=lambda s, n: (s + 1) / 2 * (n - 1)),
    "the map is orthographic: x / d for the paraboloid's x / (d + z)": DepthTests(
        total=lambda d, forward: d + 0 * forward),
    "the map is perspective: x / z for the paraboloid's x / (d + z)": DepthTests(
        total=lambda d, forward: forward + 0 * d),
    "the paraboloid divides by 1 + z: the direction is not normalised": DepthTests(
        total=lambda d, forward: 1 + forward + 0 * d),
    "the texel's direction is taken at its corner, not its centre: no half texel (0.5)": DepthTests(half=0.0),
    "the texel's direction is not of unit length: not divided by 1 + q": DepthTests(
        direction=lambda s, t, q: np.stack([2 * s, 2 * t, 1 - q])),
    "the texel's direction is (s, t, 1 - q): the factor 2 is missing": DepthTests(
        direction=lambda s, t, q: np.stack([s, t, 1 - q]) / (1 + q)),
    "the texel's direction is (s, t, sqrt(1 - q)), of an orthographic map": DepthTests(
        direction=lambda s, t, q: np.stack([s, t, np.sqrt(np.maximum(1 - q, 0))])),
    "the texel's forward component is -q, one too low: 1 - q for 2 - q where q holds the 1": DepthTests(
        direction=lambda s, t, q: np.stack([2 * s, 2 * t, -q]) / (1 + q)),
    "the texel's forward component is 1, not 1 - q": DepthTests(
        direction=lambda s, t, q: np.stack([2 * s, 2 * t, 1 + 0 * q]) / (1 + q)),
    "the texel's direction is mirrored, sign of down": DepthTests(
        direction=lambda s, t, q: np.stack([2 * s, -2 * t, 1 - q]) / (1 + q)),
    "the first map's depths for all": DepthTests(cone=Cone(of_first=("maps.depth",))),
    "the first area light's centre for all": DepthTests(cone=Cone(of_first=("maps.center",))),
    "the first area light's frame (axes) for all": DepthTests(cone=Cone(of_first=("areas.frame",))),
    "the first area light's centre, frame and map for all": DepthTests(
        cone=Cone(of_first=("areas.frame", "maps.center", "maps.depth"))),
    "the next area light's map: maps are shifted by one": DepthTests(depth_of=lambda depth: np.roll(depth, -1, axis=0)),
    "rows and columns of the map are exchanged (transposed)": DepthTests(depth_of=lambda depth: depth.swapaxes(1, 2)),
    "empty texels count as blockers at distance 0": DepthTests(
        depth_of=lambda depth: np.where(np.isinf(depth), 0, depth)),
    "the frame of the area light is transposed": DepthTests(cone=Cone(transposed=True)),
    "positions count from the world's origin, not from the map's centre": DepthTests(cone=Cone(from_center=False)),
    "lights with and without extent are exchanged: Delta 0": DepthTests(extents="swapped"),
}
HARD: Mapping[str, DepthTests] = {
    "area lights with extent have hard shadows as well": DepthTests(extents="all"),
}
NO_TEXEL: Mapping[str, DepthTests] = {
    "the kernel leaves out its last row or column (loop with < for <=): nothing remains of one, V is 1": DepthTests(
        only=lambda dy, dx: False),  # noqa: ARG005
}
KERNEL: Mapping[str, DepthTests] = {
    "texels beyond the unit disc (the hemisphere) count as well: no test of the corner": DepthTests(in_disc=False),
    "the mean is over the whole kernel, also texels beyond the disc": DepthTests(outside="counted"),
    "pixels behind the light's plane are tested as well: forward's sign": DepthTests(behind=False),
    "the kernel leaves out its last row (loop with < for <=): one too few": DepthTests(after=(1, 0)),
    "the kernel leaves out its last column (loop with < for <=): one too few": DepthTests(after=(0, 1)),
    "the kernel leaves out its last row and column: one too few": DepthTests(after=(1, 1)),
    "the kernel leaves out its first row": DepthTests(before=(1, 0)),
    "the kernel leaves out its first column": DepthTests(before=(0, 1)),
    "the kernel leaves out its first row and column": DepthTests(before=(1, 1)),
    "the kernel's middle, the receiver's own texel, is left out": DepthTests(only=lambda dy, dx: bool(dy or dx)),
    "the kernel is its row alone: columns only": DepthTests(only=lambda dy, dx: dy == 0),  # noqa: ARG005
    "the kernel is its column alone: rows only": DepthTests(only=lambda dy, dx: dx == 0),  # noqa: ARG005
    "the kernel is its last texel: earlier tests are overwritten, not counted": DepthTests(
        only=lambda dy, dx: dy == dx == 2),
    "the kernel is its diagonal": DepthTests(only=lambda dy, dx: dy == dx),
    "the kernel is one texel: no filter": DepthTests(only=lambda dy, dx: dy == dx == 0),
    "any hidden texel hides all": DepthTests(share=lambda hidden, count: np.where(hidden > 0, 0.0, 1.0) + 0 * count),
    "all texels must be hidden": DepthTests(share=lambda hidden, count: np.where(hidden < count, 1.0, 0.0)),
    "the share is of one texel more: count + 1": DepthTests(share=lambda hidden, count: 1 - hidden / (count + 1)),
    "the hidden count is not divided: 1 - hidden": DepthTests(share=lambda hidden, count: 1 - hidden + 0 * count),
}


def pcf_bugs(name: str, texels: int) -> tuple[Bug, ...]:
    """Return likely bugs of depth tests of a square of texels, or of one."""
    more = HARD if name == "hard" else {}
    return tuple(Bug(cause, depth_tests_by(name, texels, how), PLANE if "plane" in cause else OWN)
                 for cause, how in {**TESTS, **_one_alone(), **(KERNEL if texels > 1 else NO_TEXEL), **more}.items())


def _one_alone() -> dict[str, DepthTests]:
    """Return tests that are wrong in the receiver's column or row alone."""
    return {cause.format(one): how._replace(alone=one) for one in ("column", "row") for cause, how in (
        ("the receiver's {} alone is s n: of [0, 1], not of [-1, 1]", DepthTests(place=lambda s, n: s * n)),
        ("the receiver's {} alone is not halved: s + 1 for (s + 1) / 2", DepthTests(place=lambda s, n: (s + 1) * n)),
        ("half a texel is subtracted from the receiver's {} alone", DepthTests(
            place=lambda s, n: (s + 1) / 2 * n - 0.5)),
        ("half a texel is added to the receiver's {} alone", DepthTests(place=lambda s, n: (s + 1) / 2 * n + 0.5)),
        ("the receiver's {} alone is one too low", DepthTests(place=lambda s, n: (s + 1) / 2 * n - 1)),
        ("the receiver's {} alone is one too high", DepthTests(place=lambda s, n: (s + 1) / 2 * n + 1)))}
