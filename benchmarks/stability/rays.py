"""Part `rays`: rays inside closed meshes that must hit, rays off their faces that must not, by both ways to Embree.

The bare path (`fill_closest`, `fill_occluded`) is what estimators use; the checked one (`closest`, `occluded`) decides
in float64 whatever the bare path lets through. A mesh is measured in sizes from 1e-6 to 1e8 m. Rays come in chunks,
each of one size, so that case `i` of a seed is the same in every run.

A bounce ray that slips through a closed surface loses the radiance it should have found, a shadow ray adds light that
is not there; which rays slip has nothing to do with their radiance, so the bare path's share of misses is the relative
bias that it puts into the truth.
"""

import os
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from functools import cache, partial
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.stability import promise
from benchmarks.stability.meshes import MESHES, Mesh, Places, Rays, aimed_rays, leaving_rays, places_upon, random_rays
from benchmarks.stability.promise import Promise, Task, Tell, promise_tasks
from refgi.rays import MISS, Tracer
from refgi.stress.promises import Row
from refgi.types import Array

SEED = 17
SIZES = (1e-6, 1e-3, 1.0, 1e4, 1e8)  # m
CHUNK = 1 << 14  # always drawn whole
DOORS = ("address", "run")
KINDS = ("random", "aimed", "leaving", "between")
# rays of a mesh, full and short; `run` copies what it answers, and is asked less
COUNTS = {("random", "address"): (47_000_000, 30_000), ("random", "run"): (4_000_000, 10_000),
          ("aimed", "address"): (1_000_000, 60_000), ("aimed", "run"): (1_000_000, 10_000),
          ("leaving", "address"): (1_000_000, 20_000), ("leaving", "run"): (1_000_000, 10_000),
          ("between", "address"): (1_000_000, 20_000), ("between", "run"): (1_000_000, 10_000)}
# rays along needles pass thousands of them: so many times fewer
SLOWER = {"random": 7, "aimed": 1, "leaving": 20, "between": 20}
BARE_RANDOM, BARE_AIMED = 1e-7, 0.0143
DISTANCE = 8.4e-7


class Found(NamedTuple):
    """Of some rays: how many, wrong answers of the bare and the checked path, the farthest off, where first."""

    rays: int = 0
    bare: int = 0
    checked: int = 0
    off: float = 0.0
    first_bare: int = -1
    first_checked: int = -1
    farthest: int = -1


def door(name: str) -> AbstractContextManager[Any]:
    """Open Embree one way or the other inside the block."""
    return patch.dict(os.environ, REFGI_EMBREE=name)


@cache
def tracer_of(mesh: str, size: float, way: str) -> tuple[Mesh, Tracer]:
    """Return a mesh and a tracer whose tree is built."""
    shape = MESHES[mesh](size)
    tracer = Tracer(shape.geometry)
    with door(way):
        tracer.occluded(np.zeros((1, 3)), np.ones((1, 3)))
    return shape, tracer


def chunk_of(mesh: str, way: str, kind: str, seed: int, chunk: int, first: int = 0, last: int = CHUNK) -> Any:
    """Return mesh, tracer and some rays of a chunk; of the kind "between" the places on either end of segments."""
    size = SIZES[chunk % len(SIZES)]
    shape, tracer = tracer_of(mesh, size, way)
    rng = np.random.default_rng((seed, KINDS.index(kind), chunk))
    if kind == "between":
        at = places_upon(shape, rng, 2 * CHUNK)
        return shape, tracer, [Places(*(part[begin + first : begin + last] for part in at)) for begin in (0, CHUNK)]
    rays = (leaving_rays(shape, tracer.offsets, rng, CHUNK) if kind == "leaving" else
            random_rays(shape, size, rng, CHUNK) if kind == "random" else aimed_rays(shape, size, rng, CHUNK))
    return shape, tracer, Rays(*(part[first:last] for part in rays))


def bare(tracer: Tracer, rays: Rays) -> tuple[Array, Array]:
    """Return the faces that the bare path finds, and which rays it calls blocked."""
    count = len(rays.origins)
    face, distance, blocked = np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.bool_)
    reach = np.full(count, np.inf, np.float32)
    tracer.fill_closest(rays.origins, rays.directions, reach, face, distance)
    tracer.fill_occluded(rays.origins, rays.directions, reach, blocked)
    return face, blocked


def slips(mesh: str, way: str, kind: str, seed: int, chunk: int, count: int) -> Found:
    """Count the rays from inside that hit nothing: of the checked path those, too, that hit far from their aim."""
    shape, tracer, rays = chunk_of(mesh, way, kind, seed, chunk, 0, count)
    face, blocked = bare(tracer, rays)
    through = (face == MISS) | ~blocked
    asked = np.flatnonzero(through) if kind == "random" else np.arange(count)
    off, wrong, far = 0.0, np.zeros(0, bool), -1
    if len(asked):
        hits = tracer.closest(rays.origins[asked], rays.directions[asked])
        wrong = (hits.triangle_id == MISS) | ~tracer.occluded(rays.origins[asked], rays.directions[asked])
        if kind == "aimed" and shape.convex:  # a direction's length ends upon the mesh
            away = np.where(wrong, 0.0, np.abs(hits.distance - 1))
            far = int(np.argmax(away))
            off = float(away[far])
    begin = chunk * CHUNK
    return Found(count, int(through.sum()), int(wrong.sum()), off, _first(through, begin),
                 begin + int(asked[np.argmax(wrong)]) if wrong.any() else -1, begin + far)


def own_hits(mesh: str, way: str, kind: str, seed: int, chunk: int, count: int) -> Found:
    """Count the rays off a face that hit it; of the sphere, too, those that hit any other.

    The planes of needles are tilted by rounding, each by its own: near a pole a ray may leave one and meet another.
    """
    shape, tracer, rays = chunk_of(mesh, way, kind, seed, chunk, 0, count)
    face, blocked = bare(tracer, rays)
    hits = tracer.closest(rays.origins, rays.directions).triangle_id
    convex = shape.convex and mesh != "needles"
    wrong = [(face == rays.own) | (convex & ((face != MISS) | blocked)),
             (hits == rays.own) | (convex & (hits != MISS))]
    begin = chunk * CHUNK
    return Found(count, int(wrong[0].sum()), int(wrong[1].sum()), 0.0, _first(wrong[0], begin),
                 _first(wrong[1], begin))


def blocked_between(mesh: str, way: str, kind: str, seed: int, chunk: int, count: int) -> Found:
    """Count the segments between inner sides of a convex mesh that something blocks."""
    _, tracer, (start, end) = chunk_of(mesh, way, kind, seed, chunk, 0, count)
    blocked = tracer.segments_blocked(start.points, end.points, -start.normals, -end.normals)
    return Found(count, 0, int(blocked.sum()), 0.0, -1, _first(blocked, chunk * CHUNK))


MEASURE: dict[str, Callable[..., Found]] = {"random": slips, "aimed": slips, "leaving": own_hits,
                                            "between": blocked_between}


def measure(mesh: str, way: str, kind: str, total: int, seed: int = SEED) -> Found:
    """Measure `total` rays, over all sizes."""
    chunks = max(len(SIZES), -(-total // CHUNK))
    found = Found()
    for chunk in range(chunks):
        one = MEASURE[kind](mesh, way, kind, seed, chunk, min(CHUNK, -(-total // chunks)))
        found = Found(found.rays + one.rays, found.bare + one.bare, found.checked + one.checked,
                      max(found.off, one.off), found.first_bare if found.first_bare >= 0 else one.first_bare,
                      found.first_checked if found.first_checked >= 0 else one.first_checked,
                      one.farthest if one.off > found.off else found.farthest)
    return found


def rows(mesh: str, way: str, kind: str, total: int) -> Iterable[Row]:
    """Yield the rows of one kind of rays."""
    found = measure(mesh, way, kind, total)
    name = f"{mesh}.{way}.{kind}"
    text = {"random": "random rays from inside", "aimed": "rays from inside at vertices and edges",
            "leaving": "rays off faces, 1e-6 above them and more", "between": "segments between inner sides"}[kind]

    def row(prop: str, figure: float, limit: float, unit: str, how: tuple[Any, str], case: int,
            detail: str = "") -> Row:
        return Row(part="rays", property=prop, subject=f"Embree by {way}", scene=mesh,
                   domain=f"{text}; sizes 1e-6 .. 1e8 m", figure=figure, unit=unit, limit=limit, kind=how[0],
                   source=how[1], cases=found.rays, seed=SEED, detail=detail,
                   reproduce=f"python -m benchmarks.stability.again rays {name} {SEED} {max(case, 0)}")

    must = ("exact", "a closed mesh lets nothing through")
    if kind in ("random", "aimed"):
        yield row(f"slips of the checked path, {kind}", found.checked, 0, "rays", must, found.first_checked)
        share = found.bare / found.rays
        most = BARE_RANDOM if kind == "random" else BARE_AIMED
        yield row(f"slips of the bare path, {kind}", share, most, "of rays",
                  ("derived", "the promise of Tracer; as much is the relative bias of truth") if kind == "random" else
                  ("observed x 2", "0.0071 of the star: float32 tests of what meets at a vertex"),
                  found.first_bare, f"{found.bare} of {found.rays:,}")
        if found.off:
            yield row("distance of what is aimed at", found.off, DISTANCE, "of 1",
                      ("observed x 2", "4.2e-7: float32 tests of triangles"), found.farthest)
    elif kind == "leaving":
        free = ("exact", "offsets lift rays off their face")
        yield row("self-hits of the checked path", found.checked, 0, "rays", free, found.first_checked)
        yield row("self-hits of the bare path", found.bare, 0, "rays", free, found.first_bare)
    else:
        yield row("segments blocked by their ends", found.checked, 0, "segments",
                  ("exact", "nothing lies between sides of a convex room"), found.first_checked)


def tasks(short: bool) -> list[Task]:
    """Return a task for each mesh, way to Embree and kind of rays, and for each promise."""
    def run(mesh: str, way: str, kind: str, total: int, _: Tell) -> Iterable[Row]:
        return rows(mesh, way, kind, total)

    def count(mesh: str, way: str, kind: str) -> int:
        most = COUNTS[kind, way][short]
        return most // SLOWER[kind] if mesh == "needles" else most

    return [*(Task(f"{mesh}.{way}.{kind}", partial(run, mesh, way, kind, count(mesh, way, kind)))
              for mesh in MESHES for way in DOORS for kind in KINDS if mesh != "star" or kind != "between"),
            *promise_tasks(promises().values(), "rays", short)]


def promises() -> dict[str, Promise]:
    """Return the promises of shadow rays, of reach and of what stands on a large floor, by name."""
    from benchmarks.stability import shadows

    return {one.name: one for one in shadows.PROMISES}


def again(name: str, seed: int, case: int) -> str:
    """Return one ray, both paths' answers and those of a brute force in float64."""
    if name in promises():
        return promise.again(promises()[name], seed, case)
    mesh, way, kind = (*name.split("."), "", "")[:3]
    if mesh not in MESHES or way not in DOORS or kind not in KINDS:
        raise ValueError(f"expected MESH.DOOR.KIND of {', '.join(MESHES)}; {', '.join(DOORS)}; {', '.join(KINDS)}, or "
                         f"{', '.join(promises())}")
    chunk, place = divmod(case, CHUNK)
    shape, tracer, found = chunk_of(mesh, way, kind, seed, chunk, place, place + 1)
    lines = [f"{name}, seed {seed}, case {case}: size {SIZES[chunk % len(SIZES)]:g} m"]
    if kind == "between":
        start, end = found
        blocked = tracer.segments_blocked(start.points, end.points, -start.normals, -end.normals)
        return "\n".join([*lines, f"  from      {start.points[0].tolist()} of face {start.face[0]}",
                          f"  to        {end.points[0].tolist()} of face {end.face[0]}", f"  blocked   {blocked[0]}"])
    face, blocked = bare(tracer, found)
    hits = tracer.closest(found.origins, found.directions)
    origin, direction = found.origins[0].astype(float), found.directions[0].astype(float)
    distance, nearest = brute(shape, origin, direction)
    return "\n".join([*lines, f"  origin    {origin.tolist()}", f"  direction {direction.tolist()}",
                      f"  leaves    {found.own[0]}", f"  bare      face {face[0]}, blocked {blocked[0]}",
                      f"  checked   face {hits.triangle_id[0]}, distance {hits.distance[0]!r}",
                      f"  float64   face {nearest}, distance {distance!r}, of {len(shape.corners)} faces"])


def brute(shape: Mesh, origin: Array, direction: Array) -> tuple[float, int]:
    """Return distance and face of the nearest hit by barycentric coordinates in float64, inf and -1 for none."""
    v = shape.corners - origin
    volumes = np.stack([np.cross(v[:, i], v[:, j]) @ direction for i, j in ((1, 2), (2, 0), (0, 1))])
    inside = (volumes >= 0).all(axis=0) | (volumes <= 0).all(axis=0)
    normal = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    with np.errstate(all="ignore"):
        distance = (v[:, 0] * normal).sum(axis=1) / (normal @ direction)
    distance = np.where(inside & (distance > 0), distance, np.inf)
    nearest = int(np.argmin(distance))
    return float(distance[nearest]), nearest if distance[nearest] < np.inf else -1


def _first(flags: Array, begin: int) -> int:
    return begin + int(np.argmax(flags)) if flags.any() else -1
