"""Whether a scene of so many triangles can be held at all, asked before the memory is taken."""

import os

from refgi.errors import expect

# A vertex is 24 bytes, a face 12 and its material 4; joining the meshes holds them twice for a moment.
BYTES_OF_VERTEX, BYTES_OF_FACE = 2 * 24, 2 * (12 + 4)
MOST_VERTICES = 2**31 - 1  # corner indices are int32


def expect_room(vertices: int, faces: int, where: str) -> None:
    """Raise `InputError` unless indices and memory suffice for a scene's geometry.

    Parameters
    ----------
    vertices, faces : int
        Of the whole scene, instances counted each.
    where : str
        File and key, for the error's text.

    Raises
    ------
    InputError
        If there are more vertices than an int32 can count, or more bytes than the machine has.
    """
    expect(vertices <= MOST_VERTICES, where, f"at most {MOST_VERTICES} vertices in all", vertices)
    needed = vertices * BYTES_OF_VERTEX + faces * BYTES_OF_FACE
    present = physical_memory()
    if needed > present:  # asked for every object of a file; the text is made once
        expect(False, where, f"a scene that fits in {present / 2**30:.1f} GiB of memory",
               f"{vertices} vertices and {faces} faces ({needed / 2**30:.1f} GiB)")


def physical_memory() -> float:
    """Return the machine's memory in bytes, infinity where the platform does not say.

    Returns
    -------
    float
        Bytes.
    """
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return float("inf")
