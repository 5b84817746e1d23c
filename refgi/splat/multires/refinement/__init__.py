"""Which cells of the picture are subsplats (Nichols and Wyman 2009, Sec. 3.2 and 3.3).

`grid` names the cells and draws them (Fig. 5), `changes` and `criteria` find those that hold a discontinuity, by mips
of pictures of any size (`pyramid`), `cells` says what neighbours across a corner do to that, `refine` lists the
subsplats, in one visit or pass by pass.
"""
