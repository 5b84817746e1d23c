"""The stages of each method as functions of plain arrays, in the order in which a port writes them.

`buffers` (G-buffer, reflective shadow maps), `lights` (importance, points, warp, pixel lights), `pairs` (one light and
one receiver; sums), then one module a method. Each function adds its stages to a `Recipe`.
"""
