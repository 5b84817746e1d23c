"""Sums over pairs of pixel light and receiver (SII Eq. 2 and 3): packed lights, tiles of receivers, the kernels.

`pair_sum` adds diffuse lights, `lobe_sum` glossy ones, `sphere_sum` virtual spheres; `ranged_sum` those pairs alone
that the threshold keeps. `packing` makes the arrays they read, `blocks` the order in which they see the pixels, and
the files on culling tell which lights a tile can do without.
"""
