"""Which cells of the picture are subsplats (Nichols and Wyman 2009, Sec. 3.2 and 3.3).

`grid` names the cells, `ranges` and `changes` find discontinuities in mips of any size (`pyramid`), `criteria` says
which cells hold one, `cells` what neighbours across a corner do to that, `refine` lists the subsplats in one visit and
`published_list` pass by pass, `picture` draws them (Fig. 5).
"""
