"""Form factor of a receiver and a sample (Sec. 3.1, Eq. 3 and 4).

Symbols: d vector from receiver to sample; m = -n_j ds_j / pi of the sample; c = max(0, n . d) = r cos(theta);
s = max(0, m . d) = r R^2, with the radius R of the disc that has the sample's projected area; |d| = r.
"""

import math
from typing import Any, NamedTuple

from refgi.jit import kernel
from refgi.sssil.settings import SenderSettings

POINT, TEXEL, DISC = 0, 1, 2  # form factors
LEAST = 1e-37  # stands in for a denominator of 0, where the numerator is 0 as well


class SampleForm(NamedTuple):
    """What of a sample its disc covers."""

    kind: int  # POINT, TEXEL or DISC
    share: float  # of what the sample stands for, of a DISC


@kernel
def form_factor(c: Any, s: Any, disc: Any, square: Any) -> Any:
    """Return c s / (r^4 + d r): Eq. 4 where the disc d is all that the sample stands for, Eq. 3 where it is 0.

    That is cos(theta) R^2 / (r^2 + D^2), without pi. `s` is r R^2 of all texels that the sample stands for, `disc` d of
    those that its disc covers, `square` r^2. 0 where c or s is 0, and where receiver and sample coincide.
    """
    least = type(c)(LEAST)
    # Eq. (4): cos(theta) R^2 / (r^2 + R^2); Eq. (3): cos(theta) cos(theta') ds / r^2
    below = square * square + disc * math.sqrt(square)
    return c * s / (below if below > least else least)


@kernel
def disc_texels(weight: float, form: SampleForm) -> float:
    """Return how many texels the disc of a sample covers that stands for `weight`: a share, but no less than a texel.

    One (TEXEL) or none (POINT) by other form factors. A sample that stands for less than a texel has all of that.
    """
    if form.kind == DISC:
        return max(form.share * weight, min(1.0, weight))
    return 1.0 if form.kind == TEXEL else 0.0


def form_of(senders: SenderSettings) -> SampleForm:
    """Return the form factor of samples as kernels know it."""
    return SampleForm({"point": POINT, "texel": TEXEL, "disc": DISC}[senders.form_factor], senders.disc_share)


class Facing(NamedTuple):
    """A point and a vector there."""

    x: Any
    y: Any
    z: Any
    nx: Any
    ny: Any
    nz: Any


@kernel
def term(receiver: Facing, sample: Facing, weight: Any, disc: Any) -> Any:
    """Return the form factor of one receiver and one sample that stands for `weight` texels, its disc for `disc`.

    The receiver's vector is its normal, the sample's its reversed normal times area / pi.
    """
    px, py, pz, nx, ny, nz = receiver
    qx, qy, qz, mx, my, mz = sample
    zero = type(px)(0.0)
    dx, dy, dz = qx - px, qy - py, qz - pz
    square = dx * dx + dy * dy + dz * dz
    c = nx * dx + ny * dy + nz * dz
    s = mx * dx + my * dy + mz * dz
    c = c if c > zero else zero
    texel = s if s > zero else zero
    return form_factor(c, texel * weight, texel * disc, square)
