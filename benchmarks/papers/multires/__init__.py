"""The figures and tables of adaptive multiresolution splatting (Nichols and Wyman 2009, in print 2010).

Of the paper's scenes the teapot is a name and the others are models that are not published with it; bodies of their
face counts and about their visual complexity stand in for them (`scenes`). The least distance of the clamp that the
paper always has it does not state: see `subjects`.
"""

from functools import partial

from benchmarks.papers.multires.error import (
    beside_path_tracing,
    edges,
    rows_of_criteria,
    surface_detail,
    two_pictures,
)
from benchmarks.papers.multires.rates import by_lights, by_scene, by_threshold
from benchmarks.papers.multires.speed import flight, glossy_receivers
from benchmarks.papers.multires.subjects import BUDDHA, BUNNIES, DRAGON, TEAPOT
from benchmarks.papers.multires.subsplats import of_each_light, passes, upsampling, upsampling_passes
from benchmarks.papers.records import Case, Entry

TITLES = {TEAPOT: "Simple Teapot", BUDDHA: "Spinning Buddha", DRAGON: "Dragon & Bunny", BUNNIES: "Flying Bunnies"}
CURVATURE = {"criteria.curvature": "chord", "criteria.normal": "none"}

FIGURES = (
    Entry("fig1", "Figure 1", "Direct light, and with indirect light",
          "The dragon and bunny scene by direct light only, and with indirect light subdivided to 512² at most.",
          columns=3, make=partial(two_pictures, scene=DRAGON, part=2)),
    Entry("fig5", "Figure 5", "Subsplats, pass by pass",
          "An initial set of 16² subsplats, refined pass by pass at discontinuities of depth and normal; those that a "
          "pass leaves as they are, in grey scale, and the combined result after six passes.", columns=5,
          make=partial(passes, scene=DRAGON)),
    Entry("fig6", "Figure 6", "A body with a Phong BRDF",
          "Indirect light from and on a Buddha with a Phong BRDF, subsplats refined separately for each light; very "
          "sharp highlights may go undetected (Sec. 3.3.1).", columns=5,
          make=partial(glossy_receivers, scene=BUDDHA, exponents=(10.0, 100.0, 1000.0, 10000.0),
                       thresholds=(0.05, 0.01))),
    Entry("fig7", "Figure 7", "Upsampling",
          "Nearest neighbour shows blocks, bilinear interpolation of each level by itself halos and rings.", columns=5,
          make=partial(upsampling, scene=DRAGON, ways={
              "nearest": "nearest neighbour", "naive_bilinear": "naive bilinear", "demo": "the authors' demo",
              "tent": "tent (default)", "filter_all": "tent, rendered texels filtered too"})),
    Entry("fig8", "Figure 8", "Two passes of upsampling",
          "From 32² to 64² to 128²: missing samples are filled by what is interpolated from the levels before.",
          make=partial(upsampling_passes, scene=DRAGON, sides=(32, 64, 128))),
    Entry("fig9", "Figure 9", "A fly-through",
          "Frame rates and numbers of subsplats while flying through the dragon scene, with discontinuities found by "
          "depth or its derivative and by normals or curvature, at similar quality.", columns=3,
          make=partial(flight, scene=DRAGON, variation=3.0,  # "up to 300 percent"
                       ways=(("depth", "normal"), ("derivative", "normal"), ("depth", "curvature"),
                             ("derivative", "curvature")))),
    Entry("fig10", "Figure 10", "The normal threshold",
          "One view of the dragon scene: at low resolutions the normal threshold does nothing, at high ones frame "
          "rates rise with it.",
          make=partial(by_threshold, scene=DRAGON, thresholds=(0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.4, 2.0),
                       resolutions=(16, 32, 64, 128, 256, 512, 1024), flat=64)),
    Entry("fig11", "Figure 11", "Fine surface and its detail",
          "The Buddha with a normal threshold of 0.25 at 8 frames per second, of 1.4 at 32, and of 1.4 with detail "
          "put back by the angle between normal and view.",
          make=partial(surface_detail, scene=BUDDHA, cases=(
              Case("low", "threshold 0.25", {"normal_threshold": 0.25}, 8),
              Case("high", "threshold 1.4", {"normal_threshold": 1.4}, 32),
              Case("detail", "threshold 1.4, surface detail", {"normal_threshold": 1.4, "detail": 0.5}, 32)))),
    Entry("fig12", "Figure 12", "Four scenes by criteria and thresholds",
          "Direct light only; curvature above 0.1 and 0.3; normals above 0.2 and 1.5; 1.5 with surface detail.",
          make=partial(rows_of_criteria, scenes=TITLES, ways={
              "curvature 0.1": CURVATURE | {"criteria.curvature.threshold": 0.1},
              "curvature 0.3": CURVATURE | {"criteria.curvature.threshold": 0.3},
              "normals 0.2": {"normal_threshold": 0.2}, "normals 1.5": {"normal_threshold": 1.5},
              "normals 1.5, detail": {"normal_threshold": 1.5, "detail": 0.5}})),
    Entry("fig13", "Figure 13", "Beside gathering and path tracing",
          "The method and reflective shadow mapping are near indistinguishable; every texel as a light, without a "
          "clamp, is brighter; path tracing differs by visibility, clamp and the solid angles of texels.", columns=5,
          make=partial(beside_path_tracing, scene="cornell_sphere")),
    Entry("fig14", "Figure 14", "The number of lights",
          "Frame rates of the dragon scene fall as lights are added, the faster the finer indirect light is resolved; "
          "in simple scenes 16² to 32² lights gave smooth results under animation.",
          make=partial(by_lights, scene=DRAGON, counts=(4, 8, 16, 32, 64), resolutions=(16, 64, 256, 512, 1024))),
    Entry("fig15", "Figure 15", "Edges that no cell holds",
          "An edge on the border of cells is no discontinuity within any of them, and light blurs across it; the same "
          "happens diagonally. Looking beyond a cell's border costs up to 40 % of the speed, looking at diagonal "
          "neighbours 2 to 3 %.",
          make=partial(edges, scene=DRAGON, seconds={"no rule": 1.0, "literal": 1.025, "rim": 1.4}, rules={
              "no rule": {"diagonal": "off"}, "corner": {"diagonal": "corner"}, "literal": {"diagonal": "literal"},
              "all eight": {"diagonal": "full8"}, "rim": {"diagonal": "off", "rim": 1},
              "rim and corner": {"diagonal": "corner", "rim": 1}})),
    Entry("table1", "Table 1", "Subsplats of each light's own",
          "A Buddha with a Phong BRDF, each light with its own list of subsplats: 65.5 thousand at 16² and 16² lights, "
          "about twice as many with every doubling of the resolution, too many for memory soon.", columns=5,
          # the threshold is chosen for about the paper's growth in all, 13 times from 16² to 256²
          make=partial(of_each_light, scene=BUDDHA, threshold=0.05, sides=(16, 32, 64, 128), printed={
              16: (65.5, 262.1, 1050.0, 4190.0), 32: (120.5, 484.9, 1940.0, 7200.0),
              64: (220.4, 893.9, 3570.0, None), 128: (421.8, 1730.0, 6660.0, None),
              256: (852.0, 3220.0, None, None)})),
    Entry("table2", "Table 2", "Four scenes, four resolutions",
          "Frame rates fall with the resolution of indirect light, and hardly depend on the number of triangles: at "
          "1024² a teapot and 417 thousand triangles run alike.",
          make=partial(
              by_scene, parts=(8, 4, 2, 1), titles=TITLES,
              fps={128: (68, 60, 59, 52), 256: (50, 42, 42, 41), 512: (33, 30, 28, 31), 1024: (22, 24, 21, 25)})),
)
