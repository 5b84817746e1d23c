"""Whether a file is one of refgi's, which it may overwrite."""

import json
from pathlib import Path
from typing import Any

from refgi.image.png import read_png_attributes
from refgi.image.whole import MARK

START_OF_PAGE = 4096  # bytes that hold a page's head
GENERATOR = f'<meta name="generator" content="{MARK}'


def is_from_refgi(path: str | Path) -> bool:
    """Return whether refgi wrote a file, as far as its mark tells.

    Parameters
    ----------
    path : str or Path
        A file.

    Returns
    -------
    bool
        False where the file is another program's, or so damaged that its mark is lost.
    """
    path = Path(path)
    has_mark = {".exr": _exr, ".png": _png, ".json": _json, ".html": _page}.get(path.suffix.lower())
    try:
        return has_mark is not None and has_mark(path)
    except Exception:  # a damaged header makes OpenEXR raise nearly anything
        return False


def _exr(path: Path) -> bool:
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        header: dict[str, Any] = file.header()
        return MARK in header


def _png(path: Path) -> bool:
    return read_png_attributes(path) is not None


def _json(path: Path) -> bool:
    content = json.loads(path.read_text("utf-8"))
    return isinstance(content, dict) and MARK in content


def _page(path: Path) -> bool:
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(START_OF_PAGE)
