"""Refinement of subsplats by geometry (Nichols and Wyman 2009, Sec. 3.2 and 3.3).

`grid` defines cells, subsplats and their representative pixels (Fig. 5), and min-max and max mipmaps of pictures of any
size; `derivatives` builds those of depth slopes and of curvatures (Eq. 1), `criteria` builds those of depth and normal
ranges and compares all of them with their thresholds. `refine` adds the rules for diagonal neighbours and lists the
subsplats, in a single pass or pass by pass as published.
"""
