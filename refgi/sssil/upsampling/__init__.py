"""Upsampling of irradiance from level to level (Sec. 3.2): joint bilateral, bilinear, nearest."""
