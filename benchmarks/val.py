"""Clustered visibility: error against a shadow ray for each pair, at equal lights; rates of frames: topic frames.

The paper's scenes are used where REFGI_DATA names their folder, built-in ones of as many faces elsewhere.
"""

from collections.abc import Iterator

import numpy as np

from benchmarks.harness import Row, paper_scene
from refgi import Frame
from refgi.cluster import ValSettings, val
from refgi.compare.metrics import relmse
from refgi.settings import of
from refgi.splat import MultiresSettings, multires
from refgi.truth.vpl import VplSettings, vpl

SCENES = ("cornell_horse", "sponza", "kitchen")
LIGHTS = 1024
KINDS = {"every light": {"interleaving": 1}, "8 x 8": {"interleaving": 8},
         "8 x 8, lights assigned by cluster": {"interleaving": 8, "assignment": "cluster"},
         "PCF": {"interleaving": 1, "visibility": "pcf"}, "PCSS": {"interleaving": 1, "visibility": "pcss"}}


def rows(quick: bool) -> Iterator[Row]:
    size = 96 if quick else 192
    for name in SCENES:
        frame = Frame(paper_scene(name), width=size, height=size)
        covered = frame.gbuffer.covered
        truth = vpl(frame, of(VplSettings, lights=LIGHTS)).astype(np.float64)
        found = {"no visibility": vpl(frame, of(VplSettings, lights=LIGHTS, visibility=False))}
        found |= {f"30 area lights, {kind}": val(frame, of(ValSettings, lights=LIGHTS, **how))
                  for kind, how in KINDS.items()}
        found["30 area lights, every light at subsplats"] = multires(
            frame, of(MultiresSettings, lights=LIGHTS, pattern="halton", visibility="val"))
        for kind, light in found.items():
            yield Row(f"{name}: {kind}", relmse(light, truth, covered), "relMSE")
