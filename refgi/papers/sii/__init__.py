"""The figures and tables of Splatting Indirect Illumination (Dachsbacher and Stamminger 2006).

The paper's own scenes are not published. Built-in ones stand in for them, and for its "I_low = x % of I_0", whose
unit of length is not stated, a reference length is chosen under which the splats of 5 % overdraw the picture as often
as in the paper's Figure 8 (125 of 768). The colour plates are cited by the text as Figures 11 to 13.
"""

from refgi.papers.catalogue import Entry
from refgi.papers.sii.figure6 import figure6
from refgi.papers.sii.figure12 import figure12
from refgi.papers.sii.headline import headline
from refgi.papers.sii.table1 import table1

FIGURES = (
    Entry("fig6", "Figure 6", "Splatting and instant radiosity", figure6),
    Entry("fig12", "Figure 12", "Gathering and splatting", figure12),
    Entry("table1", "Table 1", "What a frame costs when light and camera move or rest", table1),
    Entry("full", "Full sum", "Every light at every pixel", headline),
)
