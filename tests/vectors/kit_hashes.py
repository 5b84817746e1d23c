"""Hashes of what stages without libm make, in kit_hashes.json: `python -m tests.vectors.kit_hashes` writes them anew.

They hold on any machine: each value is IEEE arithmetic and square roots in float64, rounded to float32.
"""

import json
import re
from pathlib import Path

from refgi.testing import quick_kit
from refgi.vectors.check import Asked

FILE = Path(__file__).with_suffix(".json")
LIBM_FREE = re.compile(r"rsm\.(visible_triangles|surface|map_triangles|map_surface)\d?|"
                       r"lights\.((halton_points|grid_points|importance|warp|texels)\d|pixel_lights|footprints)|"
                       r"multires\.(.*_ranges\d?|discontinuities|states|subsplats|points)|sssil\.(first|coarser)_level\d?")


def hashes(kit):
    """Return the SHA-256 of each array that such a stage writes, by case and name."""
    return {f"{case.id}/{name}": case.arrays[name].sha256 for case in kit.cases(Asked()) for step in case.stages
            if LIBM_FREE.fullmatch(step.name) for name in step.writes}


if __name__ == "__main__":
    FILE.write_text(json.dumps(hashes(quick_kit()), indent=0, sort_keys=True) + "\n")
