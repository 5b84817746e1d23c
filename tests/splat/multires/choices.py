"""Settings and pictures of `multires` in the words of its tests."""

import dataclasses
import math
from functools import partial

import numpy as np

from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import Receivers, irradiance
from refgi.splat.multires.settings import MultiresSettings


@dataclasses.dataclass
class FakeBuffer:
    """A picture with the channels of a G-buffer, without a camera."""

    depth: np.ndarray
    normal: np.ndarray
    covered: np.ndarray
    position: np.ndarray | None = None

    @property
    def dtype(self):
        return self.depth.dtype

    def resolve(self, *names):
        return tuple(getattr(self, name) for name in names)


def ids(buffer):
    """Return triangles of a picture: one, where there is any."""
    return np.where(buffer.covered, 0, -1)


FORMS = {"depth": "range", "derivative": "slope", "normal": "range", "curvature": "chord"}

unclamped = partial(of, MultiresSettings, clamp=None)  # near pairs as they are, to be summed pair by pair
by_irradiance = partial(unclamped, subsplats="irradiance")


def by_error(target, **values):
    return unclamped(**{"subsplats": "error", "subsplats.target": target} | values)


def only(*criteria):
    """Values that choose some of the criteria."""
    return {f"subsplats.criteria.{name}": form if name in criteria else None for name, form in FORMS.items()}


def frame_of(name="cornell_box", width=120, height=90, **options):
    return Frame(load_scene(name), width=width, height=height, **{"rsm_resolution": 64} | options)


def full_sum(buffer, lights, settings, area=None):
    """Return the sum of all pairs at every pixel."""
    receivers = Receivers(*buffer.resolve("position", "normal", "covered"))
    return irradiance(receivers, lights, settings.effective_pairs, area)


def relative_error(picture, full, covered):
    """Return the RMSE over the mean."""
    difference = (picture - full.astype(float))[:, covered]
    return math.sqrt((difference**2).mean()) / full[:, covered].mean(dtype=float)
