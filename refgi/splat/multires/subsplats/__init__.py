"""Evaluation of subsplats and upsampling to pixels (Nichols and Wyman 2009, Sec. 3.4, 3.5 and 4.3).

`evaluate` sums Eq. 2 at subsplats, with shadow rays or without. `upsample` turns the layers of the illumination buffer
into a picture, by the masked filter of `tent`, as the authors' demo does or naively. `detail` is Eq. 3.
"""
