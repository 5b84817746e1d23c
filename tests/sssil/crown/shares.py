"""Shares of texels that lie in a crown."""

import numpy as np


def share_inside(ox, oy, low, high, n=64):
    """Return the share of texel (ox, oy) whose points lie [low, high) from the middle of texel (0, 0), by n x n."""
    at = (np.arange(n) + 0.5) / n - 0.5
    length = np.hypot(ox + at[None, :], oy + at[:, None])
    return ((length >= low) & (length < high)).mean()
