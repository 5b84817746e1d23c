"""How far a pixel light reaches (SII Sec. 3.4 and appendix): threshold, bounds, lists of lights for tiles, counts.

`threshold` turns settings into I_low and ranges, `bounds` encloses what a light may reach, `lists` says which tiles
that touches, and `fragments` counts what came of it.
"""
