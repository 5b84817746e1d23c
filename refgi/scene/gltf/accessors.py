"""Typed views of glTF buffers, dense and sparse, every bound checked before a byte is read."""

from typing import Any

import numpy as np

from refgi.errors import expect
from refgi.scene.gltf.container import Document
from refgi.scene.mesh import expect_memory
from refgi.types import Array

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def accessor(document: Document, index: Any, kind: str, referrer: str) -> Array:
    """Return the elements of an accessor, those that a sparse one replaces in their place.

    `kind`: ``"SCALAR"``, ``"VEC3"`` ...: what the referrer needs. `referrer`: the key that names the accessor. Returns
    (count,) or (count, width): in the file's component type, or float64 where the accessor is normalised; zeros where
    it has no buffer view. Raises `InputError` if a key is missing or any byte lies outside its buffer.
    """
    entry = document.item("accessors", index, referrer)
    where = f"accessors[{index}]"
    path = document.path
    expect(entry.get("type") == kind, f"{path}: {where}.type", kind, entry.get("type"))
    dtype = _component_type(document, entry, where)
    if "bufferView" in entry:
        elements = _view(document, entry, where, dtype, WIDTHS[kind])
    else:
        count = document.integer(entry, "count", where)
        expect_memory(count, 0, f"{path}: {where}.count")
        elements = np.zeros((count, WIDTHS[kind]), dtype)
    if "sparse" in entry:
        elements = _replaced(document, entry, where, elements)
    if entry.get("normalized") is True and dtype.kind != "f":
        elements = np.maximum(elements / np.iinfo(dtype).max, -1.0)
    return elements if WIDTHS[kind] > 1 else elements[:, 0]


def _component_type(document: Document, entry: dict[str, Any], where: str) -> np.dtype[Any]:
    code = entry.get("componentType")
    known = isinstance(code, int) and code in COMPONENTS
    expect(known, f"{document.path}: {where}.componentType", f"one of {sorted(COMPONENTS)}", code)
    return np.dtype(COMPONENTS[code])  # type: ignore[index]


def _replaced(document: Document, entry: dict[str, Any], where: str, elements: Array) -> Array:
    """Return elements (count, width) with those replaced that `sparse` lists."""
    where = f"{where}.sparse"
    sparse = document.member(entry, "sparse", where)
    count = {"count": document.integer(sparse, "count", where)}
    listed = document.member(sparse, "indices", where) | count
    values = document.member(sparse, "values", where) | count
    for key, part in (("indices", listed), ("values", values)):
        expect("bufferView" in part, f"{document.path}: {where}.{key}.bufferView", "an index", None)
    kind = _component_type(document, listed, f"{where}.indices")
    expect(kind.kind == "u", f"{document.path}: {where}.indices.componentType", "unsigned integers", kind.name)
    index = _view(document, listed, f"{where}.indices", kind, 1)[:, 0]
    outside = int(index.max(initial=0))
    expect(outside < len(elements) or not len(index), f"{document.path}: {where}.indices",
           f"indices below {len(elements)}", outside)
    replaced = elements.copy()
    replaced[index] = _view(document, values, f"{where}.values", elements.dtype, elements.shape[1])
    return replaced


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
