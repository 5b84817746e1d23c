"""Sums over pairs of pixel light and receiver (SII Eq. 2 and 3): packed lights, tiles of receivers, the kernels.

`pair_sum` adds diffuse lights, `lobe_sum` glossy ones, `sphere_sum` virtual spheres; `ranged_sum` those pairs alone
that the threshold keeps. `packing` makes the arrays they read, `tiles` the order in which they see the pixels, and
`tiles` and `lobe_culling` tell which lights a tile can do without. `shadow_rays` asks a ray for each pair, the sum that
`vpl` takes at every pixel and `multires` at its subsplats.
"""
