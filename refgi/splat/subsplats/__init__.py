"""What becomes of subsplats (Nichols and Wyman 2009, Sec. 3.4, 3.5 and 4.3).

`evaluate` lights them, `visible` by shadow rays; `upsample` makes a picture of them by the masked filter of `tent`, as
the authors' `demo` does or naively, from the `layers` of the illumination buffer; `detail` darkens it by Eq. 3.
"""
