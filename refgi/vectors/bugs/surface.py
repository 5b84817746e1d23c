"""Depth, position, normal and albedo of what texels see, as a port finds them, and as it gets them wrong.

A texel's ray has the length 1 along the view's axis, so that its parameter at the triangle's plane is the depth.
"""

from typing import Any

import numpy as np

from refgi.rsm.raster.projection import PARABOLOID, Projection
from refgi.vectors.bugs.views import ALL_CENTRES, CENTRES, View, ViewChange, view_changes, view_of
from refgi.vectors.spec import Array, Arrays, Bug, Run

DEPTH, SIDE, WORLD = "depth along the view's axis, not along the ray", "on the side that is seen", "world space"
EMPTY, SMOOTH = "depth inf, all else 0", "interpolated over the triangle at the point, then normalised"
DIFFUSE = "diffuse reflectance of the triangle's material"


def surface_family(name: str, view: str, maps: Projection, channels: tuple[str, ...], smooth: bool) -> tuple[Bug, ...]:
    """Return likely bugs of what a view sees; `smooth`: the triangles have interpolated normals."""
    if maps.kind == PARABOLOID:
        return ()

    def literal(change: ViewChange | None = None, **bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 in float64
            seen = view_of(arrays, view, maps)
            made = literal_surface(arrays, np.asarray(arrays[f"{name}.triangle_id"]),
                                   change(seen) if change else seen, **bugs)
            return {f"{name}.{key}": made[key] for key in channels}

        return altered

    found = [
        *(Bug(cause, literal(centre=centre), ALL_CENTRES) for cause, centre in CENTRES.items()),
        Bug("texel coordinates are divided by the resolution less 1", literal(less=1), ALL_CENTRES),
        *(Bug(f"depth is {value} where there is no surface, not infinite", literal(empty=number), EMPTY)
          for value, number in (("0", 0.0), ("1", 1.0), ("-1", -1.0), ("1e30", 1e30))),
        Bug("texels without a surface have the last triangle's values: background with id -1", literal(holes=-1),
            EMPTY),
        Bug("texels without a surface have the first triangle's values: background taken for id 0", literal(holes=0),
            EMPTY),
        Bug("the ray's origin is forgotten where depth is found: distance of the plane from 0, not from the eye",
            literal(plane_from_eye=False), "n . (p - o) / n . d"),
        Bug("positions count from the eye and not from the world's origin", literal(space="eye"), WORLD),
        Bug("positions are those of the camera's space: view space, not the world's", literal(space="view"), WORLD),
        Bug("normals are those of the camera's space: view space, not the world's", literal(normal_space="view"),
            WORLD),
        Bug("positions are the triangle's first corner", literal(space="corner"), WORLD),
        Bug("positions are the triangle's centre", literal(space="middle"), WORLD),
        Bug("normals are turned away from the side that is seen", literal(side="away"), SIDE),
        Bug("normals are as the triangle is wound: not turned to the side that is seen", literal(side="wound"), SIDE),
        Bug("normals are not normalised: the cross product of two edges", literal(unit=False), "unit vector"),
        *(Bug(f"the sign of the cross product's {which} component", literal(turned=k), "a x b")
          for k, which in enumerate(("first", "second", "third"))),
        Bug("each texel has the triangle after its own: ids are one off", literal(step=1), "triangle_id"),
        Bug("each texel has the triangle before its own: ids are one off", literal(step=-1), "triangle_id"),
        *(Bug(cause, literal(change), paper) for cause, change, paper in view_changes(maps)),
    ]
    if maps.kind == 1:
        found += [
            Bug("rays of a parallel projection spread from one point: perspective", literal(parallel=False),
                "orthographic"),
            Bug("rays of a parallel projection all begin at the map's origin", literal(spread=0.0), "orthographic")]
    else:
        found += [
            Bug("depth is the distance along the ray from the eye, not along the view's axis: a normalised ray",
                literal(measure="distance"), DEPTH),
            Bug("depth along a normalised ray, position along the one that is not", literal(measure="mixed"), DEPTH),
            Bug("depth is the squared distance from the eye", literal(measure="square"), DEPTH),
            Bug("rays are parallel to the view's axis: no perspective", literal(parallel=True), "perspective")]
    if maps.maps > 1:
        found.append(Bug("the row counts on over all faces of a cube in place of within one: rows of one map",
                         literal(modulo=False), "rows of one map"))
    if smooth:
        found += _smooth_bugs(literal)
    if "albedo" in channels:
        found += [*_albedo_bugs(literal), Bug("normals are turned upwards: to +y and not to the side that is seen",
                                              literal(side="up"), SIDE)]
    return tuple(found)


def _smooth_bugs(literal: Any) -> list[Bug]:
    return [
        Bug("the face's normal in place of the interpolated one: flat, no vertex normals", literal(smooth="no"),
            SMOOTH),
        Bug("the first corner's vertex normal for the whole triangle: not interpolated", literal(smooth="first"),
            SMOOTH),
        Bug("the mean of the vertex normals for the whole triangle: not interpolated", literal(smooth="mean"), SMOOTH),
        Bug("interpolated normals are not normalised", literal(smooth="long"), "unit vector"),
        Bug("barycentric coordinates belong to the corner after theirs", literal(smooth="after"), SMOOTH),
        Bug("barycentric coordinates belong to the corner before theirs", literal(smooth="before"), SMOOTH),
        Bug("normals are interpolated on the image plane: not perspective-correct", literal(smooth="affine"), SMOOTH),
    ]


def _albedo_bugs(literal: Any) -> list[Bug]:
    return [
        Bug("albedo is the first material's everywhere", literal(paint="first"), DIFFUSE),
        Bug("albedo is the last material's everywhere", literal(paint="last"), DIFFUSE),
        Bug("albedo is the specular reflectance", literal(paint="specular"), DIFFUSE),
        Bug("albedo is the sum of diffuse and specular reflectance", literal(paint="sum"), DIFFUSE),
        Bug("albedo is divided by pi: the BRDF", literal(paint="brdf"), DIFFUSE),
        Bug("the triangle's number picks the material", literal(paint="triangle"), DIFFUSE),
        Bug("materials are one off: each triangle has the next one's", literal(paint="next"), DIFFUSE),
        Bug("albedo is 1 where there is no surface: background", literal(paint="white"), EMPTY),
    ]


def literal_surface(
    arrays: Arrays, ids: Array, view: View, *, centre: tuple[float, float] = (0.5, 0.5), less: int = 0,
    empty: float = np.inf, holes: int | None = None, plane_from_eye: bool = True, space: str = "world",
    normal_space: str = "world", side: str = "seen", unit: bool = True, turned: int | None = None, step: int = 0,
    measure: str = "axis", parallel: bool | None = None, spread: float = 1.0, modulo: bool = True,
    smooth: str = "yes", paint: str = "own",
) -> dict[str, Array]:
    """Return depth, position, normal and albedo at each texel, or with a bug."""
    seen = ids >= 0
    face = np.where(seen, (ids + step) % len(arrays["scene.faces"]), 0 if holes is None else holes)
    seen = seen | (holes is not None)
    corners = np.asarray(arrays["scene.faces"])[face]
    p = np.moveaxis(np.asarray(arrays["scene.vertices"], np.float64)[corners], (2, 3), (0, 1))  # corner, xyz, H, W
    origin, d, frame = rays(view, centre, less, parallel, spread, modulo)
    normal = np.cross(p[1] - p[0], p[2] - p[0], axis=0)
    if turned is not None:
        normal[turned] *= -1
    length = np.sqrt((normal**2).sum(axis=0))
    normal = normal / length
    toward = {"seen": -d, "away": d, "up": np.broadcast_to(np.reshape((0.0, 1.0, 0.0), (3, 1, 1)), d.shape)}.get(side)
    if toward is not None:
        normal = np.where((normal * toward).sum(axis=0) < 0, -normal, normal)
    with np.errstate(all="ignore"):
        t = (normal * (p[0] - (origin if plane_from_eye else 0))).sum(axis=0) / (normal * d).sum(axis=0)
        point = origin + t * d
        axial = np.sqrt((d**2).sum(axis=0))
        depth = {"axis": t, "distance": t * axial, "mixed": t * axial, "square": (t * axial) ** 2}[measure]
        point = origin + depth * d if measure == "mixed" else point
        position = {"world": point, "eye": point - origin, "corner": p[0], "middle": p.mean(axis=0),
                    "view": np.einsum("hwij,jhw->ihw", frame, point - origin)}[space]
        shading = shading_normal(arrays, corners, p, normal, origin + t * d, (frame, origin), smooth)
    shading = shading if unit else shading * length
    if normal_space == "view":
        shading = np.einsum("hwij,jhw->ihw", frame, shading)
    made = {"position": position, "normal": shading, "albedo": _albedo(arrays, face, paint)}
    background = 1.0 if paint == "white" else 0.0
    return {"depth": np.where(seen, depth, empty)} | {
        key: np.where(seen, one, background if key == "albedo" else 0.0) for key, one in made.items()}


def rays(
    view: View, centre: tuple[float, float] = (0.5, 0.5), less: int = 0, parallel: bool | None = None,
    spread: float = 1.0, modulo: bool = True,
) -> tuple[Array, Array, Array]:
    """Return origin and direction (3, H, W) of each texel's ray, and its map's frame (H, W, 3, 3)."""
    rows = np.arange(view.maps * view.rows)
    x, y = view.image_points(centre, less, rows % view.rows if modulo else rows)
    frame = np.broadcast_to(view.frame[rows // view.rows][:, None], (*x.shape, 3, 3))
    start = np.moveaxis(np.broadcast_to(view.origin[rows // view.rows][:, None], (*x.shape, 3)), -1, 0)
    across = np.moveaxis(x[..., None] * frame[:, :, 0] + y[..., None] * frame[:, :, 1], -1, 0)
    forward = np.moveaxis(frame[:, :, 2], -1, 0)
    begin = start + spread * across if view.parallel else start
    if view.parallel if parallel is None else parallel:
        return begin if parallel is None else start + across, forward, frame
    return start, across + forward, frame


def shading_normal(
    arrays: Arrays, corners: Array, p: Array, face: Array, point: Array, view: tuple[Array, Array], how: str
) -> Array:
    """Return the normal interpolated at points of triangles, or with a bug; the face's where there is none."""
    if "scene.vertex_normals" not in arrays or how == "no":
        return face
    frame, origin = view
    normals = np.moveaxis(np.asarray(arrays["scene.vertex_normals"], np.float64)[corners], (2, 3), (0, 1))
    share = np.stack([(face * np.cross(p[(k + 1) % 3] - point, p[(k + 2) % 3] - point, axis=0)).sum(axis=0)
                      for k in range(3)])
    if how == "affine":
        share = share * np.stack([((q - origin) * np.moveaxis(frame[:, :, 2], -1, 0)).sum(axis=0) for q in p])
    share = {"first": np.ones_like(share) * np.reshape((1.0, 0.0, 0.0), (3, 1, 1)), "mean": np.ones_like(share),
             "after": np.roll(share, 1, axis=0), "before": np.roll(share, -1, axis=0)}.get(how, share)
    total = (share[:, None] * normals).sum(axis=0)
    if how == "long":
        total = total / share.sum(axis=0)
    total = np.where((total * face).sum(axis=0) < 0, -total, total)
    with np.errstate(all="ignore"):
        return total if how == "long" else np.asarray(total / np.sqrt((total**2).sum(axis=0)))


def _albedo(arrays: Arrays, face: Array, paint: str) -> Array:
    diffuse, specular = (np.asarray(arrays[f"materials.{key}"], np.float64) for key in ("diffuse", "specular"))
    material = np.asarray(arrays["scene.material_of_face"])[face]
    material = {"first": np.zeros_like(material), "last": np.full_like(material, len(diffuse) - 1),
                "triangle": face % len(diffuse), "next": (material + 1) % len(diffuse)}.get(paint, material)
    table = {"specular": specular, "sum": diffuse + specular, "brdf": diffuse / np.pi}.get(paint, diffuse)
    return np.moveaxis(table[material], -1, 0)
