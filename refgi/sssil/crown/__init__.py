"""Crown sampling around every texel of a level (Sec. 3.2, indirect lighting shader)."""
