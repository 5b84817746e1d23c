"""The figures and tables of Splatting Indirect Illumination (Dachsbacher and Stamminger 2006).

The paper's own scenes are not published. Built-in ones stand in for them, and for its "I_low = x % of I_0", whose
unit of length is not stated, a reference length is chosen under which the splats of 5 % overdraw the picture as often
as in the paper's Figure 8 (125 of 768). The colour plates are cited by the text as Figures 11 to 13.
"""

from benchmarks.papers.catalogue import Entry
from benchmarks.papers.sii.figure4 import figure4
from benchmarks.papers.sii.figure6 import figure6
from benchmarks.papers.sii.figure7 import figure7
from benchmarks.papers.sii.figure8 import figure8
from benchmarks.papers.sii.figure11 import figure11
from benchmarks.papers.sii.figure12 import figure12
from benchmarks.papers.sii.headline import headline
from benchmarks.papers.sii.table1 import table1
from benchmarks.papers.sii.table2 import table2
from benchmarks.papers.sii.table3 import table3

FIGURES = (
    Entry("fig4", "Figure 4", "Caustics", figure4),
    Entry("fig6", "Figure 6", "Splatting and instant radiosity", figure6),
    Entry("fig7", "Figure 7", "Importance warping", figure7),
    Entry("fig8", "Figure 8", "Overdraw", figure8),
    Entry("fig11", "Figure 11", "The cut-off I_low", figure11),
    Entry("fig12", "Figure 12", "Gathering and splatting", figure12),
    Entry("table1", "Table 1", "What a frame costs when light and camera move or rest", table1),
    Entry("table2", "Table 2", "What the warp costs", table2),
    Entry("table3", "Table 3", "Fluxes scaled by openness", table3),
    Entry("full", "Full sum", "Every light at every pixel", headline),
)
