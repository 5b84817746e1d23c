"""The figures of hierarchical screen-space indirect illumination (Soler et al. 2009).

The game that the paper shows is not published: built-in scenes stand in for it (`subjects`). Figures 1 and 3 are
drawings of the method. The last three entries go beyond the paper's figures: its temporal filter, visibility, and which
of its approximations costs how much.
"""

from functools import partial

from benchmarks.papers.hssil.error import FRAMES, split, visibility
from benchmarks.papers.hssil.judged import ONE, SIDES, point_or_disc, several_cameras
from benchmarks.papers.hssil.levels import crowns, level_by_level
from benchmarks.papers.hssil.setups import by_level, five_setups, three_setups
from benchmarks.papers.hssil.subjects import BASKET, BOX, HALL, HORSE, SPOT, side_views
from benchmarks.papers.hssil.temporal import filtered
from benchmarks.papers.records import Entry

FIGURES = (
    Entry("fig2", "Figure 2", "Discs and crowns",
          "Each level samples a crown from r to 2 r of its texels, the first one the disc within as well: together "
          "they cover the picture without cracks or overlaps.", crowns, columns=3),
    Entry("fig4", "Figure 4", "Level by level",
          "Under a vertical spot, the light that each of four levels gathers, and all together: each level reaches "
          "twice as far as the one before, and they blend smoothly.", columns=3,
          # two levels beyond the paper's four, so that the far end is seen; the line is across curtains and columns
          make=partial(level_by_level, scene=SPOT, levels=6, line=0.42)),
    Entry("fig5", "Figure 5", "Point or disc, against path tracing",
          "One bounce by path tracing and by the method, fed with exact direct light: the form factor of a disc "
          "(Eq. 4) drastically reduces the noise of that of a point (Eq. 3).",
          make=partial(point_or_disc, scene=BOX, line=0.83)),  # across both blocks and near edges
    Entry("fig6", "Figure 6", "Times of five setups",
          "Milliseconds of sampling, upsampling and compositing for five setups, on two graphics processors.",
          five_setups),
    Entry("fig7", "Figure 7", "Time by level",
          "Milliseconds by mipmap level for half resolution and 64 samples; more than 70 % of the time goes into the "
          "first level. The bars' heights are not printed.", by_level),
    Entry("fig8", "Figure 8", "Three setups and a picture",
          "Views of the game with the indirect light of three setups; 64 samples from quarter resolution on are enough "
          "for a satisfying picture.", columns=3, make=partial(three_setups, scene=HALL)),
    Entry("fig9", "Figure 9", "Several cameras",
          "A plant basket lit on its far side: with one camera its light is missing, with side views it comes back.",
          columns=3, make=partial(several_cameras, scene=BASKET, ways={ONE: {}, SIDES: {"views": side_views()}})),
    Entry("temporal", "Section 3.3", "Noise and the frames before",
          "Blending each frame with the one before, warped to the new camera, takes away noise at next to no cost. The "
          "paper has no figure of it.", columns=3, make=partial(filtered, scene=HALL)),
    Entry("visibility", "Visibility", "Beyond the paper",
          "The paper supposes that all that is seen sees each other (v = 1), and gives no bound of the error.",
          make=partial(visibility, scenes=(HORSE, HALL))),
    Entry("error", "Error, split", "Beyond the paper",
          "The paper says that its picture may be heavily biased, by what is not seen and by v = 1, and gives no "
          "figures.",
          make=partial(
              split, scenes=(BOX, HORSE, HALL),
              shown=("unseen senders", "visibility", "clamp", "levels", "downsampling", "cut", "few samples"),
              variants={
                  "as published": {}, "from full resolution on, as far": {"start": "full", "further": 1},
                  "from quarter resolution on, as far": {"start": "quarter", "further": -1},
                  "a level more": {"further": 1}, "16 samples": {"samples": 16}, "256 samples": {"samples": 256},
                  "every texel": {"pattern": "all"}, FRAMES: {}, "every pixel its own samples": {"pattern": "pixel"},
                  "levels averaged": {"downsample": "average"},
                  "closest, average radiance": {"downsample": "closest_average"},
                  "bilinear upsampling": {"upsampling": "bilinear"}, "nearest upsampling": {"upsampling": "nearest"},
                  "Eq. 3": {"form_factor": "point"}, "bitmask": {"visibility": "bitmask"},
                  "rays": {"visibility": "rays"}})),
)
