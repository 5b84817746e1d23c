"""The rasterizer as a port writes it, every triangle at every texel, and as it gets it wrong (docs/rasterizer).

Edge functions are those of homogeneous coordinates: (x, y, depth) in the view's frame, depth 1 in parallel projection.
"""

from typing import Any

import numpy as np

from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection
from refgi.vectors.bugs.views import ALL_CENTRES, CENTRES, View, ViewChange, view_changes, view_of
from refgi.vectors.spec import Array, Arrays, Bug, Run

NEAREST, LOWEST = "the nearest triangle", "docs/rasterizer"


def ids_family(name: str, view: str, maps: Projection) -> tuple[Bug, ...]:
    """Return likely bugs of the ids that a view sees: wrong centres, tests, order of depths, frames, numbers."""
    if maps.kind == PARABOLOID:
        return ()

    def literal(change: ViewChange | None = None, **bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 numbers of triangles
            seen = view_of(arrays, view, maps)
            return {f"{name}.triangle_id": literal_ids(arrays, change(seen) if change else seen, **bugs)}

        return altered

    found = [
        *(Bug(cause, literal(centre=centre), ALL_CENTRES) for cause, centre in CENTRES.items()),
        Bug("texel coordinates are divided by the resolution less 1", literal(less=1), ALL_CENTRES),
        Bug("no depth test: the last triangle that covers a texel wins, not the nearest", literal(pick="last"),
            NEAREST),
        Bug("no depth test: the first triangle that covers a texel wins, not the nearest", literal(pick="first"),
            NEAREST),
        Bug("the farthest triangle in place of the nearest: the depth test or the sign of depth is turned round",
            literal(pick="farthest"), NEAREST),
        Bug("depths are compared by the triangle's first corner, not at the texel", literal(compared="first"), NEAREST),
        Bug("depths are compared by the mean of the triangle's corners, not at the texel", literal(compared="mean"),
            NEAREST),
        Bug("the first triangle is left out", literal(kept=slice(1, None)), LOWEST),
        Bug("the last triangle is left out: the number of triangles is one too few", literal(kept=slice(0, -1)),
            LOWEST),
        Bug("back faces are culled: triangles seen from behind are left out", literal(facing=1), "both sides are seen"),
        Bug("front faces are culled: triangles seen from the front are left out", literal(facing=-1),
            "both sides are seen"),
        *(Bug(f"the edge function opposite the triangle's {which} corner is not tested", literal(untested=k), LOWEST)
          for k, which in enumerate(("first", "second", "third"))),
        Bug("triangles cover their bounding box", literal(box=True), LOWEST),
        Bug("the number of the material in place of that of the triangle", _numbered(
            literal(), name, lambda a: np.asarray(a["scene.material_of_face"])), "ids of triangles"),
        Bug("the triangle's first vertex in place of its number", _numbered(
            literal(), name, lambda a: np.asarray(a["scene.faces"])[:, 0]), "ids of triangles"),
        Bug("three times the triangle's number: where its indices begin", _numbered(
            literal(), name, lambda a: 3 * np.arange(len(a["scene.faces"]))), "ids of triangles"),
        *(Bug(f"the sign of the cross product's {which} component", literal(turned=k), "a x b")
          for k, which in enumerate(("first", "second", "third"))),
        *(Bug(cause, literal(change), paper) for cause, change, paper in view_changes(maps)),
    ]
    if maps.kind == ORTHOGRAPHIC:
        found.append(Bug("perspective division in a parallel projection", literal(parallel=False), "orthographic"))
    else:
        found.append(
            Bug("no perspective division: a parallel projection", literal(parallel=True), "(x, y) / depth"))
    if maps.maps > 1:
        found.append(Bug("triangles that reach behind the eye are left out and not clipped", literal(whole=True),
                         LOWEST))
    return tuple(found)


def literal_ids(
    arrays: Arrays, view: View, *, centre: tuple[float, float] = (0.5, 0.5), less: int = 0, pick: str = "nearest",
    compared: str = "here", kept: slice = slice(None), facing: int = 0, untested: int | None = None, box: bool = False,
    turned: int | None = None, parallel: bool | None = None, whole: bool = False,
) -> Array:
    """Return the nearest triangle at each texel of the stacked maps, or with a bug: (H, W) int32, -1 for none."""
    x, y = view.image_points(centre, less)
    place = np.stack([x.reshape(-1), y.reshape(-1), np.ones(x.size)])
    flat = view.parallel if parallel is None else parallel
    faces = np.asarray(arrays["scene.faces"])
    offered = np.arange(len(faces))[kept]
    made = []
    for m in range(view.maps):
        local = (np.asarray(arrays["scene.vertices"], np.float64) - view.origin[m]) @ view.frame[m].T
        corner = local[faces[offered]]
        depth, flattened = corner[..., 2], corner.copy()
        if flat:
            flattened[..., 2] = 1.0
        edge = np.cross(np.roll(flattened, -1, axis=1), np.roll(flattened, -2, axis=1))
        if turned is not None:
            edge[..., turned] *= -1
        det = (flattened[:, 0] * edge[:, 0]).sum(axis=-1)
        edge = edge * np.where(det > 0, 1.0, -1.0)[:, None, None]
        share = edge @ place
        covers = _covered(edge, share, untested) & (det != 0)[:, None]
        if box:
            covers = _boxes(flattened, place) & (det != 0)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            near = share.sum(axis=1) / np.abs(det)[:, None]
            if flat:
                near = -(share * depth[..., None]).sum(axis=1) / share.sum(axis=1)
            covers &= (near > 0) | view.parallel
        if compared in ("first", "mean"):
            key = depth[:, 0] if compared == "first" else depth.mean(axis=1)
            near = np.broadcast_to(-key[:, None], near.shape)
        if facing:  # seen from the front: corners run clockwise on the image plane, whose y points down
            covers &= (det * facing < 0)[:, None]
        if whole:
            covers &= (depth > 0).all(axis=1)[:, None]
        made.append(np.where(covers.any(axis=0), offered[_chosen(near, covers, pick)], -1))
    return np.concatenate(made).reshape(view.maps * view.rows, view.columns).astype(np.int32)


def _chosen(near: Array, covers: Array, pick: str) -> Array:
    """Return which of the triangles that cover each texel is kept; the lowest of equally near ones."""
    if pick == "last":
        return np.asarray(len(covers) - 1 - np.argmax(covers[::-1], axis=0))
    if pick == "first":
        return np.asarray(np.argmax(covers, axis=0))
    order = (-near if pick == "farthest" else near).astype(np.float32)
    return np.asarray(np.argmax(np.where(covers, order, -np.inf), axis=0))


def _covered(edge: Array, share: Array, untested: int | None) -> Array:
    """Return which texels triangles cover: one on an edge where the first coefficient that is not 0 is positive."""
    first = np.where(edge[..., 0] != 0, edge[..., 0], np.where(edge[..., 1] != 0, edge[..., 1], edge[..., 2]))
    inside = (share > 0) | ((share == 0) & (first > 0)[..., None])
    if untested is not None:
        inside[:, untested] = True
    return np.asarray(inside.all(axis=1))


def _boxes(corner: Array, place: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = corner[..., :2] / corner[..., 2:]
    low, high = plane.min(axis=1)[..., None], plane.max(axis=1)[..., None]
    return np.asarray(((place[:2] >= low) & (place[:2] <= high)).all(axis=1))


def _numbered(run: Run, name: str, numbers: Any) -> Run:
    """Return ids in which each triangle has another number."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        ids = np.asarray(run(arrays, real)[f"{name}.triangle_id"])
        return {f"{name}.triangle_id": np.where(ids >= 0, numbers(arrays)[ids], -1)}

    return altered
