"""The figures of hierarchical screen-space indirect illumination (Soler et al. 2009).

The game that the paper shows is not published: built-in scenes stand in for it (`scenes`). Figures 1 and 3 are drawings
of the method. The last three entries go beyond the paper's figures: its temporal filter, visibility, and which of its
approximations costs how much.
"""

from benchmarks.papers.catalogue import Entry
from benchmarks.papers.hssil.figure2 import figure2
from benchmarks.papers.hssil.figure4 import figure4
from benchmarks.papers.hssil.figure5 import figure5
from benchmarks.papers.hssil.figure6 import figure6
from benchmarks.papers.hssil.figure7 import figure7
from benchmarks.papers.hssil.figure8 import figure8
from benchmarks.papers.hssil.figure9 import figure9
from benchmarks.papers.hssil.filtered import filtered
from benchmarks.papers.hssil.splitting import splitting
from benchmarks.papers.hssil.visible import visible

FIGURES = (
    Entry("fig2", "Figure 2", "Discs and crowns", figure2),
    Entry("fig4", "Figure 4", "Level by level", figure4),
    Entry("fig5", "Figure 5", "Point or disc, against path tracing", figure5),
    Entry("fig6", "Figure 6", "Times of five setups", figure6),
    Entry("fig7", "Figure 7", "Time by level", figure7),
    Entry("fig8", "Figure 8", "Three setups and a picture", figure8),
    Entry("fig9", "Figure 9", "Several cameras", figure9),
    Entry("temporal", "Section 3.3", "Noise and the frames before", filtered),
    Entry("visibility", "Visibility", "Beyond the paper", visible),
    Entry("error", "Error, split", "Beyond the paper", splitting),
)
