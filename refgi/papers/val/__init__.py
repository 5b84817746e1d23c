"""The figures and tables of clustered visibility (Dong et al. 2009).

The paper's horse, dragons and blob are not published with it; bodies of the same face counts stand in for them
(`scenes`), and the built-in atrium for Sponza. Figures 2, 3 and 7 are drawings of the method. The last entry goes
beyond the paper: which of its approximations costs how much.
"""

from refgi.papers.catalogue import Entry
from refgi.papers.val.figure4 import figure4
from refgi.papers.val.figure5 import figure5
from refgi.papers.val.figure6 import figure6
from refgi.papers.val.figure8 import figure8
from refgi.papers.val.figure9 import figure9
from refgi.papers.val.figure10 import figure10
from refgi.papers.val.figure11 import figure11
from refgi.papers.val.figure12 import figure12
from refgi.papers.val.figure13 import figure13
from refgi.papers.val.headline import headline
from refgi.papers.val.splitting import splitting
from refgi.papers.val.table1 import table1
from refgi.papers.val.table2 import table2

FIGURES = (
    Entry("fig1", "Figure 1", "One bounce, all moving", headline),
    Entry("fig4", "Figure 4", "Single soft shadows", figure4),
    Entry("fig5", "Figure 5", "What single soft shadows do wrong", figure5),
    Entry("fig6", "Figure 6", "Clustering by position and by normals", figure6),
    Entry("fig8", "Figure 8", "A spot on its way to the ceiling", figure8),
    Entry("fig9", "Figure 9", "Shadows of single area lights", figure9),
    Entry("fig10", "Figure 10", "The number of area lights", figure10),
    Entry("fig11", "Figure 11", "Bodies walking through an atrium", figure11),
    Entry("fig12", "Figure 12", "A blob that changes its topology", figure12),
    Entry("fig13", "Figure 13", "Soft and crisp", figure13),
    Entry("table1", "Table 1", "Four scenes", table1),
    Entry("table2", "Table 2", "Where the time goes", table2),
    Entry("error", "Error, split", "Beyond the paper", splitting),
)
