"""Mip levels of what a camera sees (Sec. 4, hierarchical maps)."""
