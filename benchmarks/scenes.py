"""Building and reading scenes: seconds, and how they grow with the number of triangles."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.harness import Row, seconds
from refgi.scene import load_scene
from refgi.scene.scenefile import read_mesh_file


def rows(quick: bool) -> Iterator[Row]:
    repeats = 1 if quick else 3
    for faces in (10_000, 100_000, 1_000_000) if quick else (10_000, 100_000, 1_000_000, 10_000_000):
        taken = seconds(lambda: load_scene(f"atrium:faces={faces}"), repeats)  # noqa: B023
        yield Row(f"build atrium, {faces} faces", taken, "s")
    vertices = load_scene("atrium:faces=100000").geometry.vertices.astype("<f4")
    faces = np.arange(len(vertices) // 3 * 3).reshape(-1, 3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "soup.ply"
        path.write_bytes(_ply(vertices, faces))
        yield Row(f"read a binary PLY, {len(faces)} faces", seconds(lambda: read_mesh_file(path), repeats), "s")


def _ply(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
            "property float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    entries = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    entries["count"], entries["corners"] = 3, faces
    return head.encode() + vertices.tobytes() + entries.tobytes()
