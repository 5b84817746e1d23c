"""A refusal of a value that is too large says how large it may be."""

import re

import pytest

from refgi.errors import InputError
from refgi.scene import Camera, DirectionalLight
from refgi.scene.motion import rotation_about
from refgi.settings import of
from refgi.splat.gather.gather import GatherSettings
from refgi.splat.sii.settings import SiiSettings
from refgi.truth.vpl import VplSettings


@pytest.mark.parametrize(("make", "said"), [
    (lambda: of(GatherSettings, samples=10**9), "samples: expected a whole number, 1 to 268,435,456, got"),
    (lambda: of(VplSettings, batch=2**31), "batch: expected a whole number, 1 to 1,073,741,824, got 2147483648"),
    (lambda: of(SiiSettings, cut_share=1e10), "share: expected a number, 0 < x <= 1e+09, got"),
    (lambda: DirectionalLight((1e200, 0, 0), (1, 1, 1)), "direction: expected a finite vector, not zero, up to 1e+100"),
    (lambda: Camera((0, 0, 0), (0, 0, 1), (0, 1e200, 0)), "up: expected a finite vector, not zero, up to 1e+100"),
    (lambda: rotation_about((0, 1e200, 0), 1.0), "axis: expected a finite vector, not zero, up to 1e+100"),
])
def test_the_upper_end_is_in_the_message(make, said):
    with pytest.raises(InputError, match=re.escape(said)):
        make()
