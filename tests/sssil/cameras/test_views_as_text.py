"""`--set views=[...]`: cameras as a scene file writes them."""

import math

import pytest

from refgi.errors import InputError
from refgi.scene.model import Camera
from refgi.settings import from_text
from refgi.sssil import HssilSettings


def test_text_becomes_cameras_with_angles_in_degrees():
    text = 'views=[{"eye": [0, 1, 2], "target": [0, 0, 0], "vfov_deg": 60}, {"eye": [0, 1, 3], "target": [0, 0, 0]}]'
    assert from_text(HssilSettings(), [text]).cameras.views == (
        Camera((0, 1, 2), (0, 0, 0), vfov=math.radians(60)), Camera((0, 1, 3), (0, 0, 0)))
    assert from_text(HssilSettings(), ["views=[]"]).cameras.views == ()


@pytest.mark.parametrize(("entry", "reason"), [
    ('{"eye": [0, 1, 2]}', "target: field required"),
    ('{"eye": [0, 1, 2], "target": [0, 0, 0], "fov": 3}', "fov: unexpected"),
    ('{"eye": [0, 1, 2], "target": [0, 1, 2]}', "camera: target: expected a point away from eye"),
    ('{"eye": [0, 1, 2], "target": [0, 0, 0], "vfov_deg": 180}', "camera: vfov_deg"),
    ('{"eye": [0, 1, 2], "target": [0, 0, 0], "vfov_deg": "wide"}', "valid number"), ("3", "views"),
])
def test_what_is_wrong_with_a_camera_is_named(entry, reason):
    with pytest.raises(InputError, match=reason):
        from_text(HssilSettings(), [f"views=[{entry}]"])
