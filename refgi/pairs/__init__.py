"""Sums over pairs of pixel light and receiver (SII Eq. 2 and 3): packed lights, tiles of receivers, the kernels.

`pair_sum` adds diffuse lights, `lobe_sum` glossy ones, `sphere_sum` virtual spheres; `ranged_sum` those pairs alone
that the threshold keeps, `glossy_sum` what receivers' lobes reflect, `shadow_rays` with a ray for each pair.
"""
