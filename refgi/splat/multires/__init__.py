"""Adaptive multiresolution splatting (Nichols and Wyman 2009): pixel lights evaluated where the picture changes.

`multires` evaluates the lights of `sii` at subsplats, large where nothing changes. `refinement` lists subsplats,
`subsplats` lights them and makes a picture of them, `light_lists` refines for each light by itself and `error_target`
until an error is met. Unlike in the paper subsplats keep what was evaluated for them.
"""

from refgi.method import Method
from refgi.splat.multires.multires import multires, shared_subsplats
from refgi.splat.multires.settings import MultiresSettings

__all__ = [
    "MultiresSettings",
    "multires",
    "shared_subsplats",
]

METHOD = Method(
    "multires", "Adaptive Multiresolution Splatting (2009): the same lights, evaluated where the picture changes",
    multires, MultiresSettings, visibility=False)
