"""Rays against a scene's triangles: closest hits, occlusion, openness. The only importer of Embree.

`Tracer` copies the triangles into Embree once, huge ones in pieces, and answers batches of rays; `ray_offset` says how
far off a surface rays must start and end. Embree works in float32 and, although its robust mode closes the seams
between triangles, lets a few rays aimed exactly at vertices through; `Tracer` finds those misses and decides them in
float64. There are two backends of Embree with the same answers, to the bit: its C functions called by address from
compiled kernels, and the `run` method of embreex (`REFGI_EMBREE=run`, or wherever the library of the wheel cannot be
found).
"""

from refgi.rays.embree import MISS
from refgi.rays.openness import openness
from refgi.rays.tracer import Hits, Tracer
from refgi.rays.watertight import STEPS, far_offset, ray_offset

__all__ = ["MISS", "STEPS", "Hits", "Tracer", "far_offset", "openness", "ray_offset"]
