"""How far a pixel light reaches (SII Sec. 3.4 and appendix): threshold, bounds, lists of lights for tiles, counts.

`threshold` turns settings into I_low and ranges, `bounds` and `screen_bounds` enclose what a light may reach, `bins`
and `lists` say which tiles that touches, and `fragments` counts what came of it.
"""
