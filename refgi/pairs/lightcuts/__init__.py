"""Lightcuts: groups of receivers sum clusters of pixel lights where a bound says that they may (Walter et al. 2005).

`tree` sorts lights by a k-d tree, joins neighbours to clusters and says of each what its bound needs, `nodes` keeps and
refines lists of them, `bounds` bounds the error of a cluster for a group of receivers, `cuts` finds a cut through the
tree for each group and sums over it. It differs from the paper: one cut serves up to 256 receivers, which are the SIMD
lanes; the error is that of the whole sum, not of each cluster; the representative is a mean, whose error is of second
order.
"""
