"""Changes of a scene's triangles take their texture coordinates along."""

import dataclasses

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.stress import promises
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


def test_paths_among_images_are_judged_as_estimates() -> None:
    """A place that is read is rounded with the hit: other senders are picked, of the same light."""
    painted = floor(size=(32, 24))
    plain = dataclasses.replace(painted, materials=tuple(
        dataclasses.replace(one, texture=None) for one in painted.materials))
    for change in CHANGES:
        if change.name == "cropped":  # nothing is promised
            continue
        kept, drawn = (promises.asked("truth", change, scene).promise for scene in (plain, painted))
        moved = change.name.startswith(("moved", "faces"))
        assert (drawn == "estimate") == (moved or kept == "estimate"), change.name
        assert not moved or kept in ("bits", "rounding")
        if moved:
            assert promises.asked("gather", change, painted).promise == kept
