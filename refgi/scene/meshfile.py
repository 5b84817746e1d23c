"""Mesh files by their suffix."""

from collections.abc import Callable
from pathlib import Path

from refgi.errors import InputError, expect
from refgi.scene.files import Contents
from refgi.scene.gltf import read_gltf
from refgi.scene.obj import read_obj
from refgi.scene.ply import read_ply

READERS: dict[str, Callable[[Path], Contents]] = {
    ".glb": read_gltf, ".gltf": read_gltf, ".obj": read_obj, ".ply": read_ply,
}


def read_mesh_file(path: Path) -> Contents:
    """Read a mesh file of any known format.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Contents
        Its meshes, cameras and lights.

    Raises
    ------
    InputError
        If the suffix is unknown, the file is damaged or it holds no triangle.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: expected a file named {', '.join(READERS)}, got {path.suffix!r}")
    found = reader(path)
    expect(bool(found.meshes), f"{path}", "at least one mesh of triangles", 0)
    return found
