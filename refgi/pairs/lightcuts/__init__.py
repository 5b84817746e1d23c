"""Lightcuts: groups of receivers sum clusters of pixel lights where a bound says that they may (Walter et al. 2005).

One cut serves up to 256 receivers, the SIMD lanes; the error is that of the whole sum, not of each cluster; the
representative is a mean, whose error is of second order.
"""
