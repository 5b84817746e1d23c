"""What becomes of subsplats (Nichols and Wyman 2009, Sec. 3.4, 3.5 and 4.3).

`evaluate` lights them, by shadow rays or without; `upsample` makes a picture of the illumination buffer's layers by the
masked filter of `tent`, as the authors' demo does or naively; `detail` darkens it by Eq. 3.
"""
