"""The figures and tables of Splatting Indirect Illumination (Dachsbacher and Stamminger 2006).

The paper's own scenes are not published. Built-in ones stand in for them, and for its "I_low = x % of I_0", whose
unit of length is not stated, a reference length is chosen under which the splats of 5 % overdraw the picture as often
as in the paper's Figure 8 (125 of 768). The colour plates are cited by the text as Figures 11 to 13.
"""

from functools import partial

from benchmarks.papers.records import Case, Entry
from benchmarks.papers.sii.cuts import cut_off, gathering, overdraw, scaled_fluxes, scaled_pictures
from benchmarks.papers.sii.lights import caustics, instant_radiosity, warped
from benchmarks.papers.sii.subjects import BOX, CAUSTIC, isosurfaces, moving_and_resting, warp_alone
from refgi.settings import replaced

COURT = "atrium:faces=50000"

FIGURES = (
    Entry("fig4", "Figure 4", "Caustics",
          "A metal ring and its caustic at more than 95 frames per second, and a glass figure that refracts at its "
          "back faces alone at 150.", columns=7,
          make=partial(caustics, cases=(
              Case("ring", "metal ring", CAUSTIC, 95, "ring"),
              Case("ring_wide", "metal ring, lobes widened within 0.4 m", replaced(CAUSTIC, {"widening": 0.4}),
                   scene="ring"),
              Case("glass", "glass ball, back faces alone", CAUSTIC, 150, "glass_ball"),
              Case("glass_two", "glass ball, both faces", replaced(CAUSTIC, {"refraction": "two_interface"}),
                   scene="glass_ball"),
              Case("glass_even", "the same, widened within 0.2 m, a tenth of the lights spread evenly",
                   replaced(CAUSTIC, {"refraction": "two_interface", "widening": 0.2, "warp.defensive": 0.1}),
                   scene="glass_ball")))),
    Entry("fig6", "Figure 6", "Splatting and instant radiosity",
          "Splatting beside instant radiosity in a ray tracer, both with 1000 lights of a quasi-random walk: the "
          "latter has soft shadows of indirect light, yet the results are comparable.", columns=5,
          make=partial(instant_radiosity, scene="cornell_box", lights=1000,
                       sources={"walk": "quasi-random walk", "rsm": "shadow map"})),
    Entry("fig7", "Figure 7", "Importance warping",
          "Importance sampling by flux times (1 - openness) times lobe peak: three or more levels give good "
          "samplings, and both methods comparable ones.", columns=5,
          make=partial(warped, scene="stage", lights=1024, seeds=(1, 2, 3, 4))),
    Entry("fig8", "Figure 8", "Overdraw",
          "The overdraw of 768 splats: 125 on average, white stands for 256; 42 600 fragments a light.",
          make=partial(overdraw, scene=BOX, bounds={
              "full": "none", "quad": "screen quad", "ellipsoid": "ellipsoid of the appendix",
              "tangent": "tangent-family ellipsoid"})),
    Entry("fig9", "Figure 9", "Where a light is significant",
          "Isosurfaces B = I_low of pixel lights with exponents 1, 10 and 100: the sharper, the thinner.",
          make=partial(isosurfaces, exponents=(1, 10, 100), bounded=False)),
    Entry("fig10", "Figure 10", "Isosurfaces and their bounds",
          "The isosurfaces of exponents 1 and 10 and the ellipses around them.",
          make=partial(isosurfaces, exponents=(1, 10), bounded=True)),
    Entry("fig11", "Figure 11", "The cut-off I_low",
          "A scene with splats cut at 1, 5 and 7 % of I_0, at 14, 54 and 74 frames per second: larger cuts make "
          "smaller bounds, fewer fragments and darker pictures.", columns=5,
          make=partial(cut_off, scene=BOX, shares=(0, 1, 5, 7, 10), fps={1: 14.0, 5: 54.0, 7: 74.0})),
    Entry("fig12", "Figure 12", "Gathering and splatting",
          "Gathering with 1020, 308 and 156 samples, interpolated from every eighth pixel, beside 768 and 108 splats.",
          columns=7,
          make=partial(gathering, scene=BOX, samples={1020: 14, 308: 44, 156: 82},
                       splatted={(768, 5): 48, (768, 10): 83, (108, 5): 254})),
    Entry("fig13", "Figure 13", "Fluxes scaled by openness",
          "Pictures with and without fluxes scaled by the ambient occlusion term, at full and at half resolution.",
          columns=3, make=partial(scaled_pictures, scene=COURT, lights=256)),
    Entry("table1", "Table 1", "What a frame costs when light and camera move or rest",
          "Milliseconds a frame of the caustic ring with 4096 importance-sampled lights (three levels, method B).",
          make=partial(moving_and_resting, scene="ring", printed={
              "dynamic light and camera": 10.4, "dynamic light, static camera": 10.8,
              "static light, dynamic camera": 9.3, "static scene, just render": 6.9})),
    Entry("table2", "Table 2", "What the warp costs",
          "Milliseconds of the importance warp for 32² and 64² samples: method A dearer than B, both rising.",
          make=partial(warp_alone, scene="ring", printed={  # "32" and "64" samples are read as 32^2 and 64^2
              ("A", 1024): (0.123, 0.238, 0.541, 1.739), ("A", 4096): (0.148, 0.358, 1.019, 3.484),
              ("B", 1024): (0.111, 0.183, 0.422, 1.274), ("B", 4096): (0.125, 0.258, 0.754, 2.584)})),
    Entry("table3", "Table 3", "Fluxes scaled by openness",
          "256 lights on a regular pattern, their flux scaled by the ambient occlusion term: 27 becomes 37 frames "
          "per second, and 63 becomes 85 at half resolution.",
          make=partial(scaled_fluxes, scene=COURT, lights=256,
                       fps={"full": (27.0, 37.0), "half": (63.0, 85.0)})),
)
