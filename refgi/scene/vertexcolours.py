"""Vertex colours of mesh files as factors of the diffuse reflectance, linear and from 0 to 1.

Files that name no material say with their colours what a surface reflects: its material is then white.
"""

import warnings
from typing import Any

import numpy as np

from refgi.errors import RefgiWarning
from refgi.scene.material import Material
from refgi.scene.texture.image import srgb_table
from refgi.scene.values import Array

WHITE = Material(diffuse=(1.0, 1.0, 1.0))  # of a mesh that names no material and has colours
CODES = 256


def factors(colours: Array, where: str) -> Array | None:
    """Return linear colours (n, 3) as factors from 0 to 1, float64; None where all are white: they change nothing.

    `where`: the file, for the warning that says how many lie beyond and are cut.
    """
    values = np.asarray(colours, np.float64)
    found = np.nan_to_num(np.clip(values, 0.0, 1.0))
    if cut := int(np.count_nonzero((found != values).any(axis=-1))):
        text = f"{where}: {cut:,} vertex colour(s) beyond 0 to 1 cut: a surface reflects what arrives at most"
        warnings.warn(RefgiWarning(text), stacklevel=6)
    return None if (found == 1).all() else found


def from_codes(values: Array) -> Array:
    """Return linear colours of sRGB codes of 8 or 16 bits, or of numbers that are linear already."""
    kind: np.dtype[Any] = values.dtype
    if kind.kind == "f":
        return values
    count = np.iinfo(kind).max + 1 if kind in (np.uint8, np.uint16) else CODES
    return np.asarray(srgb_table(count)[np.clip(values, 0, count - 1)])
