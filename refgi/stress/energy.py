"""The most that one bounce can bring: nowhere more irradiance than the largest radiosity of what is lit."""

import numpy as np

from refgi.frame import Frame
from refgi.scene import DirectionalLight
from refgi.scene.values import Array


def largest_bounce(frame: Frame) -> Array | None:
    """Return what irradiance of one bounce exceeds nowhere, (3,), W/m^2.

    Largest radiosity at texels of all lamps' maps, the lamps added; None where a lobe or glass sends light, as it may
    send all of it one way. A hemisphere filled with the radiance B / pi gives the irradiance B. A texel of solid angle
    w, seen at distance r and cosine c, has the area w r^2 / c, so B = flux c / (w r^2).
    """
    if frame.materials.specular.any() or frame.materials.ior.any():
        return None
    bound = np.zeros(3)
    for light, rsm in zip(frame.scene.lights, frame.rsms, strict=True):
        lit = rsm.covered & (rsm.solid_angle > 0)
        flux, angle = rsm.flux[:, lit].astype(np.float64), rsm.solid_angle[lit].astype(np.float64)
        normal = rsm.normal[:, lit].astype(np.float64)
        if isinstance(light, DirectionalLight):
            towards = -np.array(light.direction)[:, None] / np.linalg.norm(light.direction)
            square = np.ones_like(angle)
        else:
            towards = np.array(light.position)[:, None] - rsm.position[:, lit]
            square = (towards**2).sum(axis=0)
            towards /= np.sqrt(square)
        cosine = np.abs((normal * towards).sum(axis=0))
        bound += (flux * (cosine / (angle * square))).max(axis=1, initial=0.0)
    return bound
