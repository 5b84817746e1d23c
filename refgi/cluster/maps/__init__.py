"""Depth maps around area lights (Sec. 4.2, 6), without what cannot occlude anything."""
