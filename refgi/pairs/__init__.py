"""Sums over pairs of pixel light and receiver (SII Eq. 2 and 3): packed lights, tiles of receivers, the kernels.

`pair_sum` adds diffuse lights, `lobe_sum` glossy ones, `sphere_sum` virtual spheres; `ranged_sum` those pairs alone
that the threshold keeps. `packing` makes the arrays they read, `tiles` orders pixels into tiles; `tiles` and
`lobe_culling` cull lights per tile. `shadow_rays` traces a shadow ray for each pair: `vpl` sums so at every pixel,
`multires` at its subsplats.
"""
