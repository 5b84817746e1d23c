"""What indirect light adds to the picture (Sec. 4: C = C_direct + C_indirect * albedo, with the 1/pi it leaves out)."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import load_scene

ROUNDING = 4e-15  # a few roundings of float64


@pytest.mark.feature("HSS-16")
def test_direct_and_indirect_light_leave_by_the_same_albedo(evidence):
    frame = Frame(load_scene("cornell_box"), width=24, height=18, dtype=np.float64, rsm_resolution=32)
    indirect = np.random.default_rng(1).random((3, 18, 24)) * frame.gbuffer.covered
    without, with_light = frame.radiance(), frame.radiance(indirect)
    # what is added is albedo/pi E, channel by channel
    np.testing.assert_allclose(with_light - without, frame.gbuffer.albedo / np.pi * indirect, rtol=0,
                               atol=ROUNDING * with_light.max())
    # and the power that leaves a surface, pi L over all directions, is the albedo's share of all that arrives
    arrives = frame.direct + indirect
    leaves = np.pi * (with_light - frame.radiance(-frame.direct))  # less what it emits
    error = float(np.max(np.abs(leaves - frame.gbuffer.albedo * arrives)) / leaves.max())
    assert error < ROUNDING
    evidence(f"pi L - emission = albedo (direct + indirect) within {error:.0e} of the largest")
