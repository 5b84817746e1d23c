"""The four papers as plain NumPy: one function for each stage, arrays and numbers in, arrays out.

This is what each equation says; kernels say how it is fast, and never import it. Read in the order of the papers:
`buffers`, `lights`, `warp`, `pairs`, `gather`, `sii`, `vpl`, `imperfect`, `multires`, `val_areas`, `val_maps`,
`val_visibility`, `hssil_levels`, `hssil_crown`, `upsampling`, `temporal`. Vectors are arrays whose first axis is x, y,
z (or red, green, blue); metres, watts, radians, linear RGB. Arithmetic is in the type of the arrays.

Beside each file lie its likely bugs, `*.bugs`: one row each, an edit of one line (`refgi.vectors.rows`).
"""
