"""Samples of a crown around every texel, and what they send (Sec. 3.2, indirect lighting shader)."""
