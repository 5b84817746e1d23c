"""Changes of a scene's triangles take their texture coordinates along."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.stress.changes import CHANGES
from tests.textured import floor

SEEN = {"faces permuted": 0.0, "faces unwelded": 0.0, "faces doubled": 0.0, "faces split": 1e-6, "hidden plane": 0.0}


@pytest.mark.parametrize("name", SEEN)
def test_the_albedo_stays(name: str) -> None:
    scene = floor(size=(32, 24))
    change = next(one for one in CHANGES if one.name == name)
    made = change.apply(scene, 32, 24).scene
    assert len(made.geometry.faces) >= len(scene.geometry.faces)
    assert made.geometry.uv is not None
    one, other = (Frame(each, dtype=np.float64).gbuffer.albedo for each in (scene, made))
    assert np.abs(one - other).max() <= SEEN[name]
    assert one.std() > 0.1
