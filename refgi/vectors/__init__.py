"""Conformance kit: stage-by-stage test vectors for ports, and the checker that names the first wrong stage.

A kit is a folder of cases. A case is one method on one small scene as a graph of stages: each stage reads arrays that
the kit holds and writes arrays that the kit holds too, so that a port can start at any stage with the kit's inputs
(isolated) or run through on its own (chained). `export` makes kits with refgi; `check` judges a port's arrays with
NumPy alone, by the bounds in the kit.
"""
