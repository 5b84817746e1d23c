"""Pixel lights with ray-traced visibility: the sum that `vpl` takes at every pixel and `multires` at its subsplats."""

from refgi.shadowed.receivers import Receivers, receivers
from refgi.shadowed.shadow_rays import BATCH, add_free, shadowed_sum

__all__ = ["BATCH", "Receivers", "add_free", "receivers", "shadowed_sum"]
