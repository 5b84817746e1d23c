"""The figures and tables of adaptive multiresolution splatting (Nichols and Wyman 2009, in print 2010).

Of the paper's scenes the teapot is a name and the others are models that are not published with it; bodies of their
face counts and about their visual complexity stand in for them (`scenes`). The least distance of the clamp that the
paper always has it does not state: see `subjects`. The last entry goes beyond the paper.
"""

from benchmarks.papers.catalogue import Entry
from benchmarks.papers.multires.figure5 import figure5
from benchmarks.papers.multires.figure7 import figure7
from benchmarks.papers.multires.figure9 import figure9
from benchmarks.papers.multires.figure10 import figure10
from benchmarks.papers.multires.figure11 import figure11
from benchmarks.papers.multires.figure13 import figure13
from benchmarks.papers.multires.figure14 import figure14
from benchmarks.papers.multires.figure15 import figure15
from benchmarks.papers.multires.headline import headline
from benchmarks.papers.multires.table1 import table1
from benchmarks.papers.multires.table2 import table2

FIGURES = (
    Entry("fig5", "Figure 5", "Subsplats, pass by pass", figure5),
    Entry("fig7", "Figure 7", "Upsampling", figure7),
    Entry("fig9", "Figure 9", "A fly-through", figure9),
    Entry("fig10", "Figure 10", "The normal threshold", figure10),
    Entry("fig11", "Figure 11", "Fine surface and its detail", figure11),
    Entry("fig13", "Figure 13", "Beside gathering and path tracing", figure13),
    Entry("fig14", "Figure 14", "The number of lights", figure14),
    Entry("fig15", "Figure 15", "Edges that no cell holds", figure15),
    Entry("table1", "Table 1", "Subsplats of each light's own", table1),
    Entry("table2", "Table 2", "Four scenes, four resolutions", table2),
    Entry("error", "Error over speed-up", "Beyond the paper", headline),
)
