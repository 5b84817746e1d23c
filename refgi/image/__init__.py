"""Image files: EXR (lossless) and PNG (tone-mapped), written atomically and marked as refgi's."""

from refgi.image.exr import read_exr, write_exr
from refgi.image.picture import NOT_FINITE, png_bytes, read_png_attributes, tone_map, write_encoded, write_png
from refgi.image.whole import (
    MARK,
    canonical_json,
    is_dead,
    is_from_refgi,
    is_text,
    temporary_name,
    whole_file,
    write_text,
)

__all__ = [
    "MARK", "NOT_FINITE", "canonical_json", "is_dead", "is_from_refgi", "is_text", "png_bytes", "read_exr",
    "read_png_attributes", "temporary_name", "tone_map", "whole_file", "write_encoded", "write_exr", "write_png",
    "write_text",
]
