"""The disc that the cone from an area light to a pixel covers on its map, as a port gets it wrong (VAL Sec. 4.2)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

CONE = "tan a = Delta (d - z) / (2 d z)"
DISC = "E-VAL-08: centre sin th / (cos th + cos a), radius sin a / (cos th + cos a)"
NEARER = "receivers nearer than the nearest blocker are searched as well"
STEEPEST = np.radians(80)


class Cone(NamedTuple):
    """How a disc is found; by default as the stages do."""

    tangent: Callable[[Any, Any, Any], Any] = lambda size, d, z: size * (d - z) / (2 * d * z)
    angle: Callable[[Any], Any] = np.arctan
    steepest: float = STEEPEST
    narrowest: float = 0.0
    radius: Callable[[Any], Any] = np.sin
    axes: tuple[int, int] = (0, 1)
    signs: tuple[int, int] = (1, 1)
    total: Callable[[Any, Any], Any] = lambda forward, a: forward + np.cos(a)
    of_radius: Callable[[Any, Any], Any] | None = None  # what divides the radius, if not the same
    by_distance: tuple[bool, bool] = (True, True)
    units: tuple[float, float] = (1.0, 0.0)  # of the centre: a factor and what is added
    from_center: bool = True
    transposed: bool = False
    of_first: tuple[str, ...] = ()  # arrays of which the first area light's is taken for all


def seen_from(arrays: Arrays, cone: Cone) -> tuple[Array, Array]:
    """Return pixels in each map's frame, (3, area light, h, w), and their distances."""
    position = np.asarray(arrays["gbuffer.position"], np.float64)
    center, frame = (np.asarray(first(arrays, cone, name), np.float64) for name in ("maps.center", "areas.frame"))
    away = np.repeat(position[:, None], len(center), axis=1)
    away = away - center.T[:, :, None, None] if cone.from_center else away
    local = np.einsum("kca,ckij->akij" if cone.transposed else "kac,ckij->akij", frame, away)
    return local, np.sqrt((local**2).sum(axis=0))


def first(arrays: Arrays, cone: Cone, name: str) -> Array:
    """Return an array, or the first area light's for all where a port takes that."""
    array = np.asarray(arrays[name])
    return np.repeat(array[:1], len(array), axis=0) if name in cone.of_first else array


def disc_of(arrays: Arrays, cone: Cone, z: Array) -> Array:
    """Return the discs of blockers at distances z, (area light, 3, h, w)."""
    local, d = seen_from(arrays, cone)
    size = np.asarray(first(arrays, cone, "areas.delta"), np.float64)[:, None, None]
    with np.errstate(all="ignore"):
        a = np.clip(cone.angle(cone.tangent(size, d, z)), cone.narrowest, cone.steepest)
        unit = local / d
        total = cone.total(unit[2], a)
        centre = [sign * (unit if by else local)[axis] / total * cone.units[0] + cone.units[1]
                  for axis, sign, by in zip(cone.axes, cone.signs, cone.by_distance, strict=True)]
        below = total if cone.of_radius is None else cone.of_radius(unit[2], a)
        return np.stack([*centre, cone.radius(a) / below], axis=1)


CONES: Mapping[str, Cone] = {
    "the tangent of the cone is not divided by the pixel's distance d": Cone(
        tangent=lambda size, d, z: size * (d - z) / (2 * z)),
    "the tangent of the cone is not divided by the blocker's distance z": Cone(
        tangent=lambda size, d, z: size * (d - z) / (2 * d)),
    "the tangent is Delta / (2 z): the factor (d - z) / d is missing": Cone(
        tangent=lambda size, d, z: size / (2 * z) + 0 * d),
    "the tangent is divided by d squared, not by d z": Cone(tangent=lambda size, d, z: size * (d - z) / (2 * d * d)),
    "the tangent is divided by z squared, not by d z": Cone(tangent=lambda size, d, z: size * (d - z) / (2 * z * z)),
    "the light's half size is halved once more: a quarter of Delta": Cone(
        tangent=lambda size, d, z: size * (d - z) / (4 * d * z)),
    "the tangent stands for the angle: no arctangent (atan)": Cone(angle=lambda tangent: tangent),
    "the whole angle in place of half: 2 atan": Cone(angle=lambda tangent: 2 * np.arctan(tangent)),
    "the angle is halved": Cone(angle=lambda tangent: np.arctan(tangent) / 2),
    "the sine of the cone is taken for its tangent: asin in place of atan": Cone(
        angle=lambda tangent: np.arcsin(np.minimum(tangent, 1))),
    "the radius is that of the tangent: tan a for the sine of a": Cone(radius=np.tan),
    "the radius is the angle: a for the sine of a": Cone(radius=lambda a: a),
    "the radius is the cosine: cos a for the sine of a": Cone(radius=np.cos),
    "the radius is not divided by cos th + cos a": Cone(of_radius=lambda forward, a: 1 + 0 * (forward + a)),
    "the radius is divided by 1 + cos a: the disc of the map's middle for all": Cone(
        of_radius=lambda forward, a: 1 + np.cos(a) + 0 * forward),
    "the radius is divided by 1 + cos th": Cone(of_radius=lambda forward, a: 1 + forward + 0 * a),
    "centre and radius are divided by 1 + cos th: cos a is missing": Cone(total=lambda forward, a: 1 + forward + 0 * a),
    "centre and radius are divided by 1 + cos a: the pixel's cosine is missing": Cone(
        total=lambda forward, a: 1 + np.cos(a) + 0 * forward),
    "centre and radius are divided by cos th alone": Cone(total=lambda forward, a: forward + 0 * a),
    "centre and radius are divided by cos th + sin a: the sine of the cone for its cosine": Cone(
        total=lambda forward, a: forward + np.sin(a)),
    "centre and radius are divided by cos th - cos a: wrong sign": Cone(total=lambda forward, a: forward - np.cos(a)),
    "the direction to the pixel is not normalised: the centre is not divided by the distance": Cone(
        by_distance=(False, False)),
    "the disc's s is not divided by the distance, the direction's first component not normalised": Cone(
        by_distance=(False, True)),
    "the disc's t is not divided by the distance, the direction's second component not normalised": Cone(
        by_distance=(True, False)),
    "the disc's s is counted along down: both coordinates take the second axis": Cone(axes=(1, 1)),
    "the disc's t is counted along right: both coordinates take the first axis": Cone(axes=(0, 0)),
    "s and t are exchanged: right and down axes swapped": Cone(axes=(1, 0)),
    "s counts along the forward axis": Cone(axes=(2, 1)),
    "columns run leftwards: the disc's s is mirrored (sign of right)": Cone(signs=(-1, 1)),
    "s and t are both mirrored: directions run from the pixel to the light": Cone(signs=(-1, -1)),
    "the disc's centre is in [0, 1], not in [-1, 1]": Cone(units=(0.5, 0.5)),
    "positions count from the world's origin, not from the map's centre": Cone(from_center=False),
    "the frame of the area light is transposed": Cone(transposed=True),
    "the first area light's frame (axes) for all": Cone(of_first=("areas.frame",)),
    "the first area light's centre for all": Cone(of_first=("maps.center",)),
    "the first area light's size Delta for all": Cone(of_first=("areas.delta",)),
    "the first area light's centre, frame and size for all: the first map": Cone(
        of_first=("areas.frame", "maps.center", "areas.delta")),
}


def search_disc_bugs(run: Run) -> tuple[Bug, ...]:
    """Return likely bugs of the search region: of its cone and disc, and of who is searched."""
    return (*(Bug(cause, searched_by(cone), DISC if "tangent of" not in cause else CONE)
              for cause, cone in CONES.items()),
            Bug("the first area light's nearest distance for all: the first map's",
                searched_by(Cone(of_first=("maps.near",))), "of each map"),
            Bug("cones are limited to 45 degrees, not 80", searched_by(Cone(steepest=np.pi / 4)), CONE),
            Bug(f"{NEARER}, by cones of negative angles (d < near)",
                searched_by(Cone(narrowest=-STEEPEST), WHO[NEARER]),
                "VAL Sec. 4.2"),
            *(Bug(cause, searched_by(Cone(), pending=flags), "VAL Sec. 4.2") for cause, flags in WHO.items()),
            *(Bug(cause, _with_distance(run, change), "d, from the map's centre") for cause, change in (
                ("the distance is squared: the root is missing", lambda d, near: d * d),  # noqa: ARG005
                ("the distance counts from the nearest depth: d - near", lambda d, near: d - near),
                ("the distance is in units of the nearest: d / near", lambda d, near: d / near),
                ("the distance is the nearest blocker's, not the pixel's", lambda d, near: near + 0 * d),
                ("the reciprocal of the distance: 1 / d", lambda d, near: 1 / d))))  # noqa: ARG005


def cone_bugs(run: Run) -> tuple[Bug, ...]:
    """Return likely bugs of the penumbra's disc of a stage that has found z_avg otherwise."""
    def by(cone: Cone) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            made = dict(run(arrays, real))
            disc = disc_of(arrays, cone, np.asarray(made["penumbra.z_avg"], np.float64))
            return made | {"penumbra.region": np.where(np.asarray(made["penumbra.shaded"])[:, None], disc, 0)}

        return altered

    return tuple(Bug(cause, by(cone), "E-VAL-07, 08") for cause, cone in CONES.items())


WHO: Mapping[str, Callable[..., Array]] = {
    NEARER: lambda ahead, beyond, half: ahead & half,  # noqa: ARG005
    "the test for the nearest distance is turned round: only pixels before the nearest blocker are searched":
        lambda ahead, beyond, half: ahead & half & ~beyond,
    "the test for the light's plane is turned round: only pixels behind the light are searched":
        lambda ahead, beyond, half: ~ahead & beyond & half,
    "pixels behind the light's plane are searched as well: the sign of forward is not tested":
        lambda ahead, beyond, half: beyond & half,  # noqa: ARG005
    "area lights without extent (Delta 0) are searched as well": lambda ahead, beyond, half: ahead & beyond,  # noqa: ARG005
}


def searched_by(cone: Cone, pending: Callable[..., Array] | None = None) -> Run:
    """Return the search as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        local, d = seen_from(arrays, cone)
        near = np.asarray(first(arrays, cone, "maps.near"), np.float64)[:, None, None]
        half = np.asarray(arrays["areas.delta"])[:, None, None] > 0
        ahead, beyond = local[2] > 0, d > near
        flags = (ahead & beyond & half) if pending is None else pending(ahead, beyond, half)
        flags = flags & np.isfinite(np.asarray(arrays["maps.near"])[:, None, None])
        flags = flags & (np.asarray(arrays["gbuffer.triangle_id"]) >= 0)
        disc = np.where(flags[:, None], disc_of(arrays, cone, near + 0 * d), 0)
        return {"search.pending": flags, "search.region": disc, "search.distance": np.where(flags, d, 0)}

    return run


def _with_distance(run: Run, change: Callable[[Any, Any], Any]) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        near = np.asarray(arrays["maps.near"])[:, None, None]
        with np.errstate(all="ignore"):
            changed = change(made["search.distance"], near)
        return made | {"search.distance": np.where(made["search.pending"], changed, 0)}

    return altered
