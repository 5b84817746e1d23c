"""Four papers as plain NumPy: one function for each stage, arrays and numbers in, arrays out.

Splatting Indirect Illumination (SII, Dachsbacher and Stamminger 2006), Clustered Visibility (VAL, Dong et al. 2009),
Hierarchical Screen-Space Indirect Illumination (HSS, Soler et al. 2009) and Adaptive Multiresolution Splatting (AMS,
Nichols and Wyman 2009), with what they stand on: gathering from reflective shadow maps (Dachsbacher and Stamminger
2005) and imperfect shadow maps (Ritschel et al. 2008).

This is what each equation says; kernels say how it is fast, and never import it. Read in this order: `buffers`,
`light_flux`, `direct`, `lights`, `warp`, `pairs`, `gather`, `sii`, `vpl`, `imperfect`, `truth`, `multires`,
`multires_lights`, `multires_upsample`, `val_areas`, `val_series`, `val_maps`, `val_visibility`, `val_filters`,
`val_back_projection`, `val`, `hssil_levels`, `hssil_crown`, `upsampling`, `hssil`, `temporal`. Whole methods, to step
through: `sii.sii`, `multires_upsample.multires`, `val.val`, `hssil.hssil`, `truth.path_traced`.

Vectors are arrays whose first axis is x, y, z (or red, green, blue); metres, watts, radians, linear RGB. Arithmetic is
in the type of the arrays. E-SII-02 and its like are errata of the papers (docs/errata), VAL-03 and its like features
(docs/features). Which variant and number is the default stands in the settings (`refgi settings METHOD`); these count
most:

- sii: pairs.clamp=auto, `area` bounds each pair; reach.cut=none, all pairs are summed; lights.source.warp=none.
- multires: subsplats.criteria.depth.measure=relative, subsplats.criteria.depth.threshold=0.1,
  subsplats.criteria.normal.threshold=0.25, subsplats.criteria.rim=0, subsplats.coarsest=16.
- val: clusters.distance=normalised, clusters.position_weight=0.7, clusters.normal_weight=0.3, clusters.rounds=50,
  clusters.count=30, visibility=csm, visibility.terms=4, maps.resolution=256.
- hssil: sampling.radius=20.0, sampling.samples=64, sampling.levels=4, sampling.start=half, upsampling.depth_sigma=0.02,
  upsampling.normal_power=8.0; from frame to frame a share of 0.9 of the light before.

Beside each file lie its likely bugs, `*.bugs`: one row each, an edit of one line (`refgi.vectors.rows`).
"""
