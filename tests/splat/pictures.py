"""Pixel lights of the published kind, and small pictures of them that compare with the truth pixel by pixel."""

import math

import numpy as np

from refgi.frame import Frame
from refgi.ledger import pixel_areas
from refgi.lights import choose_pixel_lights
from refgi.lights.importance import importance
from refgi.lights.warp import Warp
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.scene import load_scene
from refgi.settings import of
from refgi.truth import TruthSettings, trace_truth

PUBLISHED = Warp("B", 3)  # SII Table 1: 4096 lights, 3 levels, method B


def published_lights(rsms, count=4096, seed=0, **importances):
    """Choose lights by flux times lobe peak."""
    worth = [importance(rsm, "peak", **importances) for rsm in rsms]
    return choose_pixel_lights(rsms, count=count, pattern="halton", seed=seed, warp=PUBLISHED, importance=worth)


def on_floor(lights, x, z, height=0.0, **settings):
    """Return the irradiance (first channel) at points (x, height, z) that look up."""
    x, z = np.broadcast_arrays(x, z)
    position = np.stack([x, np.full(x.shape, height), z]).astype(np.float32)
    normal = np.zeros_like(position)
    normal[1] = 1
    shape = (3, -1, x.shape[-1])
    covered = np.ones(x.shape, np.bool_).reshape(shape[1:])
    return irradiance(Receivers(position.reshape(shape), normal.reshape(shape), covered), lights,
                      of(PairSettings, **settings))[0].reshape(x.shape)


class Picture:
    """A small picture whose pixels hold means over their footprints, as the truth's do."""

    def __init__(self, source, width=80, height=60, inside=4):
        self.frame = Frame(load_scene(source), width=width, height=height)
        fine = Frame(self.frame.scene, width=inside * width, height=inside * height)
        self._receivers = Receivers(fine.gbuffer.position, fine.gbuffer.normal, fine.gbuffer.covered)
        self._areas = pixel_areas(fine.gbuffer, fine.scene.geometry)
        self._blocks = (height, inside, width, inside)
        self.area, self.position = self._sum(self._areas), self.frame.gbuffer.position

    def _sum(self, values):
        return values.reshape(self._blocks).sum(axis=(1, 3))

    def lit_by(self, lights):
        lit = irradiance(self._receivers, lights, PairSettings())[0]
        return self._sum(lit * self._areas) / np.maximum(self.area, 1e-30)

    def truth(self, photons):
        settings = TruthSettings(samples=2 * 6, picks=1, directions=1, caustics=True, photons=photons)
        result = trace_truth(self.frame, settings)
        return result.mean[0], np.sqrt(result.variance_of_mean[0])

    def place(self, lit, mask):
        """Return the centre of the flux on a part of the floor: x and z, m."""
        weight = (lit * self.area)[mask]
        return np.array([(weight * self.position[k][mask]).sum() for k in (0, 2)]) / weight.sum()

    def compare(self, lit, traced, mask):
        """Return relative RMSE, ratio of flux, and distance between the centres, m."""
        error = math.sqrt(((lit - traced)[mask] ** 2).mean() / (traced[mask] ** 2).mean())
        flux = (lit * self.area)[mask].sum() / (traced * self.area)[mask].sum()
        return error, flux, np.linalg.norm(self.place(lit, mask) - self.place(traced, mask))
