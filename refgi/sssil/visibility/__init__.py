"""Visibility of samples, which the paper ignores: by rays or by a bitmask of the depth map."""
