"""The figures and tables of clustered visibility (Dong et al. 2009).

The paper's horse, dragons and blob are not published with it; bodies of the same face counts stand in for them
(`subjects`), and the built-in atrium for Sponza. Figures 2 and 3 are drawings of the method.
"""

from functools import partial

from benchmarks.papers.records import Entry
from benchmarks.papers.val.clusters import criteria, one_by_one, to_the_ceiling
from benchmarks.papers.val.frames import by_area_lights, four_scenes, one_frame, steps
from benchmarks.papers.val.moving import changing_topology, walking
from benchmarks.papers.val.shadows import View, behind_a_light, failures, small_and_large, soft_and_crisp
from benchmarks.papers.val.subjects import AREA_LIGHTS, ATRIUM, BLOB, BOX, CORNER, HORSE

DOWN, EYE, TARGET = (0.0, -1.0, 0.0), (1.3, 2.4, 3.9), (0.05, 0.55, 0.0)

FIGURES = (
    Entry("fig1", "Figure 1", "One bounce, all moving",
          "One bounce in a scene of 17 thousand faces at 800 x 800 pixels, all free to move, at 19.7 frames per "
          "second; 30 area lights see for all lights.",
          make=partial(one_frame, name=HORSE, fps=19.7)),
    Entry("fig4", "Figure 4", "Single soft shadows",
          "Soft shadows by parabolic convolution soft shadow maps, of a small area light and of a larger one, with "
          "more than 200 frames per second.",
          make=partial(small_and_large, fps=200.0, views=(
              View("small", "small area light", (0.5, 2.9, 0.5), DOWN, 0.15, EYE, TARGET),
              View("large", "larger area light", (0.5, 2.9, 0.5), DOWN, 0.8, EYE, TARGET)))),
    Entry("fig5", "Figure 5", "What single soft shadows do wrong",
          "Limitations: ringing for very large senders, curved penumbras at a grazing angle of a large sender, light "
          "that leaks where bodies touch, steps of the mip levels.",
          make=partial(
              failures, views=(
                  View("huge", "very large light", (0.3, 2.7, 0.3), DOWN, 3.0, EYE, TARGET),
                  View("grazing", "large light at a grazing angle", (0.0, 1.1, 1.8), (0.0, 0.0, -1.0), 1.6,
                       (1.6, 2.2, 1.6), (0.0, 0.1, -0.6), "board"),
                  View("contact", "contact, from near", (0.5, 2.9, 0.5), DOWN, 0.8, (0.9, 0.5, 1.3),
                       (0.25, 0.12, 0.0))),
              ways={"as published: 4 terms, mip": {},
                    "4 terms, every texel": {"prefilter": "brute"},
                    "16 terms, every texel": {"prefilter": "brute", "terms": 16},
                    "PCSS": {"visibility": "pcss"}, "PCF": {"visibility": "pcf"},
                    "one hard shadow": {"visibility": "hard"}})),
    Entry("fig6", "Figure 6", "Clusters by position and by normals",
          "Clustered by position alone, groups of lights lie around the edges of the box and have lights of several "
          "normals; with the angle between normals in the distance they are planar.",
          make=partial(criteria, scene=CORNER, ways={
              "position": ("position alone", {"position_weight": 1.0, "normal_weight": 0.0}),
              "both": ("position 0.7, normal 0.3", {}),
              "raw": ("the same, metres and radians as printed", {"distance": "raw"}),
              "squared": ("the same, squared", {"distance": "squared"})})),
    Entry("fig7", "Figure 7", "Lights of different normals in one cluster",
          "Three lights of one area light have different normals: below its plane nothing is known of blockers, and "
          "the shadow breaks off. The paper draws it.",
          make=partial(behind_a_light, ways={"as published: all is seen": {},
                                             "a second map": {"maps.behind": "dual_paraboloid"},
                                             "rays": {"maps.behind": "raytrace"}})),
    Entry("fig8", "Figure 8", "A spot on its way to the ceiling",
          "A spot moves from the wall to the ceiling. With the clusters of the last frame to start from, ever more of "
          "them lose all their lights; restarted from the same lights in every frame, all stay.",
          make=partial(to_the_ceiling, scene=HORSE,
                       starts={"restart": "restarted every frame", "warm": "started from the last frame"},
                       distances={"raw": "metres and radians", "normalised": "normalised"})),
    Entry("fig9", "Figure 9", "Shadows of single area lights",
          "A spot lights a corner of the box, so that most light is indirect: soft shadows of some area lights, the "
          "clusters of all 30, and the whole picture.",
          make=partial(one_by_one, scene=CORNER, count=4)),
    Entry("fig10", "Figure 10", "The number of area lights",
          "With 2 to 30 area lights indirect light comes ever nearer to the picture with a hard shadow for every light "
          "and to path tracing; few already convince.", columns=5,
          make=partial(by_area_lights, scene=HORSE, shown=(2, 4, 8, 16, AREA_LIGHTS), further=(128, 512, 1024),
                       kinds={"csm": "CSM, 4 terms", "pcss": "PCSS", "hard": "one hard shadow"})),
    Entry("fig11", "Figure 11", "Bodies walking through an atrium",
          "Several animated dragons in Sponza, 100 thousand faces in all, at 14 frames per second; light that bounces "
          "off the back wall dominates.", columns=3,
          make=partial(walking, times=(0.0, 1.0), step=0.04,  # of the way, from frame to frame: 8 cm
                       fps={"moving bodies": 14.0, "still": 13.4})),
    Entry("fig12", "Figure 12", "A blob that changes its topology",
          "Global illumination of an iso-surface of 5.1 thousand faces that changes its topology, at 20.7 frames per "
          "second.", columns=3,
          make=partial(changing_topology, times=(0.0, 0.15, 0.3), step=0.01, fps=20.7)),
    Entry("fig13", "Figure 13", "Soft and crisp",
          "A wide spot casts a soft indirect shadow; soft and crisp indirect shadows come from one method.", columns=3,
          make=partial(soft_and_crisp, titles={"wide": "wide spot", "narrow": "narrow spot"})),
    Entry("table1", "Table 1", "Four scenes",
          "Frames per second of four scenes at 800 x 800 pixels with 1024 lights and 30 area lights.",
          make=partial(four_scenes, faces={BOX: "18", HORSE: "17 k", ATRIUM: "98 k", BLOB: "5 k"},
                       fps={BOX: 20.4, HORSE: 19.7, ATRIUM: 13.4, BLOB: 20.7})),
    Entry("table2", "Table 2", "Where the time goes",
          "Of a frame of 51 ms 69 % are indirect illumination, 21 % the blur, 8 % the shadow maps; clustering, lights "
          "and buffers take 2 %.", make=steps),
)
