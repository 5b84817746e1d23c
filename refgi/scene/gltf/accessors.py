"""Typed views of glTF buffers, every bound checked before a byte is read."""

from typing import Any

import numpy as np

from refgi.errors import expect
from refgi.scene.gltf.container import Document
from refgi.scene.model import Array

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def accessor(document: Document, index: Any, kind: str, referrer: str) -> Array:
    """Return the elements of an accessor.

    Parameters
    ----------
    document : Document
        The file.
    index : int
        Which accessor; checked.
    kind : str
        ``"SCALAR"``, ``"VEC3"`` ...: what the referrer needs.
    referrer : str
        The key that names the accessor.

    Returns
    -------
    (count,) or (count, width) ndarray
        In the file's component type, or float64 where the accessor is normalised.

    Raises
    ------
    InputError
        If a key is missing or any byte lies outside its buffer.
    """
    entry = document.item("accessors", index, referrer)
    where = f"accessors[{index}]"
    path = document.path
    expect(entry.get("type") == kind, f"{path}: {where}.type", kind, entry.get("type"))
    code = entry.get("componentType")
    known = isinstance(code, int) and code in COMPONENTS
    expect(known, f"{path}: {where}.componentType", f"one of {sorted(COMPONENTS)}", code)
    expect("sparse" not in entry, f"{path}: {where}.sparse", "a dense accessor", "a sparse one")
    expect("bufferView" in entry, f"{path}: {where}.bufferView", "an index", None)
    dtype = np.dtype(COMPONENTS[code])  # type: ignore[index]
    elements = _view(document, entry, where, dtype, WIDTHS[kind])
    if entry.get("normalized") is True and dtype.kind != "f":
        elements = np.maximum(elements / np.iinfo(dtype).max, -1.0)
    return elements if WIDTHS[kind] > 1 else elements[:, 0]


def _view(document: Document, entry: dict[str, Any], where: str, dtype: np.dtype[Any], width: int) -> Array:
    """Return (count, width) elements of an accessor after checking that they lie inside view and buffer."""
    path = document.path
    view = document.item("bufferViews", entry["bufferView"], f"{where}.bufferView")
    place = f"bufferViews[{entry['bufferView']}]"
    content = document.buffer(document.integer(view, "buffer", place))
    start = document.integer(view, "byteOffset", place, 0)
    length = document.integer(view, "byteLength", place)
    expect(start + length <= len(content), f"{path}: {place}", f"a range inside the buffer's {len(content)} bytes",
           f"{start} to {start + length}")
    size = dtype.itemsize * width
    stride = document.integer(view, "byteStride", place, size)
    expect(stride >= size and stride <= 1024, f"{path}: {place}.byteStride", f"{size} to 1024", stride)
    count = document.integer(entry, "count", where)
    offset = document.integer(entry, "byteOffset", where, 0)
    end = offset + stride * (count - 1) + size if count else offset
    expect(end <= length, f"{path}: {where}", f"a range inside the view's {length} bytes", f"{offset} to {end}")
    return np.ndarray((count, width), dtype, content, start + offset, (stride, dtype.itemsize))
