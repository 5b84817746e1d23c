"""Normals of the triangles that pixels see, as a port gets them wrong (A.6 P4)."""

from typing import Any

import numpy as np

from refgi.vectors.spec import Arrays, Bug, Run

TURNED = "on the side of the interpolated normals"


def facing_bugs() -> tuple[Bug, ...]:
    """Return likely bugs of triangles' normals where interpolated ones differ from them."""
    return (
        Bug("normals by the triangle's winding: not turned to the viewer's side, sign", faced_by(turned=False), TURNED),
        Bug("the triangle's winding is the other way and normals are not turned: opposite sign",
            faced_by(turned=False, sign=-1), TURNED),
        Bug("normals are not of unit length: not normalised, twice the triangle's area", faced_by(unit=False), "unit"),
        Bug("the first triangle's normal for all", faced_by(first=True), "gbuffer.triangle_id"),
        Bug("the triangle before: indices are one too low", faced_by(step=-1), "gbuffer.triangle_id"),
        Bug("the next triangle: indices are one too high", faced_by(step=1), "gbuffer.triangle_id"))


def faced_by(turned: bool = True, sign: int = 1, unit: bool = True, first: bool = False, step: int = 0) -> Run:
    """Return the stage as a port writes it, with bugs."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        id, normal = np.asarray(arrays["gbuffer.triangle_id"]), np.asarray(arrays["gbuffer.normal"], np.float64)
        faces, vertices = np.asarray(arrays["scene.faces"]), np.asarray(arrays["scene.vertices"], np.float64)
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        across = sign * np.cross(b - a, c - a)
        across = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30) if unit else across
        made = np.moveaxis(across[0 * id if first else np.clip(id + step, 0, len(faces) - 1)], 2, 0)
        made = np.where((made * normal).sum(axis=0) < 0, -made, made) if turned else made
        return {"gbuffer.facing": np.where(id >= 0, made, 0)}

    return run
