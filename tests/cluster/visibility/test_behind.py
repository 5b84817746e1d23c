"""What receivers behind an area light's plane see of it (Sec. 5.1, Fig. 7)."""

import numpy as np
import pytest

from refgi.cluster.maps import shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.shadow import visibility
from refgi.errors import InputError
from refgi.rays import Tracer
from refgi.settings import of
from tests.cluster.maps.lights import hard_visibility
from tests.cluster.visibility.plates import lit_by, map_of_plates, on_plane
from tests.rsm.shapes import geometry


def room_with_blocker():
    """A wall at x = 3 that looks towards -x, and a plate at x = 1 that crosses the plane z = 0."""
    def quad(x, half):
        return [[x, -half, -half], [x, half, -half], [x, half, half], [x, -half, half]]

    vertices = np.array(quad(3.0, 4.0) + quad(1.0, 0.8) + [[-1.0, -4.0, -4.0], [-1.0, 4.0, -4.0], [-1.0, 4.0, 4.0]])
    return geometry(vertices, np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]]))


@pytest.mark.feature("VAL-21")
def test_shadow_breaks_off_at_the_light_s_plane(evidence):
    scene = room_with_blocker()
    areas, _ = lit_by(map_of_plates(4, []), 0.3, 1.0)
    z = np.linspace(-2.0, 2.0, 41)
    points = np.stack([np.full(41, 3.0), np.zeros(41), z])
    facing = np.repeat([[-1.0], [0.0], [0.0]], 41, axis=1)
    seen = {}
    for behind in ("visible", "dual_paraboloid", "raytrace"):
        settings = of(ValSettings, behind=behind, visibility="pcss", maps_resolution=128)
        maps = shadow_maps(scene, areas, settings.maps, np.float64)
        tracer = Tracer(scene) if behind == "raytrace" else None
        seen[behind] = visibility(maps, areas, 0, points, facing, settings, tracer)
    middle = slice(18, 23)
    assert (seen["visible"][z <= 0] == 1).all()
    assert (seen["visible"][z > 0][:3] == 0).all()
    for behind in ("dual_paraboloid", "raytrace"):
        assert (seen[behind][middle] == 0).all()
        assert np.abs(seen[behind] - seen[behind][::-1]).max() < 0.25  # a scene that is its own mirror image
    steps = {name: float(np.abs(np.diff(v[middle])).max()) for name, v in seen.items()}
    assert steps == {"visible": 1.0, "dual_paraboloid": 0.0, "raytrace": 0.0}
    evidence("jump of V across the plane: " + ", ".join(f"{name} {step:.2f}" for name, step in steps.items()))


@pytest.mark.feature("VAL-21")
def test_no_light_leaks_in_over_the_rim(evidence):
    """Near the plane half of a filter lies beyond the hemisphere, where the square of the map mirrors it."""
    scene, points = room_with_blocker(), np.array([[3.0], [0.0], [0.02]])
    areas, _ = lit_by(map_of_plates(4, []), 0.3, 1.0)
    half = np.sqrt(0.5)  # the map's corners, not its edges, lie that way
    areas = areas._replace(frame=np.array([[[half, half, 0.0], [-half, half, 0.0], [0.0, 0.0, 1.0]]]))
    seen = {}
    for prefilter, dtype in (("brute", np.float64), ("mip", np.float32)):
        settings = of(ValSettings, behind="dual_paraboloid", prefilter=prefilter, maps_resolution=128,
                      depth_scale="scene")
        maps = shadow_maps(scene, areas, settings.maps, np.float64)
        maps = maps._replace(depth=maps.depth.astype(dtype), behind=maps.behind.astype(dtype))
        seen[prefilter] = float(visibility(maps, areas, 0, points, -points, settings)[0])
    assert max(seen.values()) < 0.02
    evidence("V just before the plane, in full shadow: " + ", ".join(f"{name} {v:.2f}" for name, v in seen.items()))


def test_rays_are_asked_for():
    areas, maps = lit_by(map_of_plates(8, [], 2.0), 0.5, 4.0)
    points, normals = on_plane(2.0, 1.0, 2)
    with pytest.raises(InputError, match="tracer"):
        visibility(maps, areas, 0, points, normals, of(ValSettings, behind="raytrace"))
    with pytest.raises(InputError, match="m: expected an area light"):
        visibility(maps, areas, 1, points, normals, ValSettings())
    with pytest.raises(InputError, match="visibility"):
        visibility(maps, areas, 0, points, normals, of(ValSettings, visibility="rays_vpls"))


def test_light_without_extent_casts_the_hard_shadow():
    plates = [(-0.5, 0.2, -0.4, 0.4, 1.0)]
    points, normals = on_plane(3.0, 2.0, 30)
    areas, maps = lit_by(map_of_plates(64, plates, 3.0), 0.0, 6.4)
    hard = hard_visibility(maps, areas, 0, points, normals)
    assert set(np.unique(hard)) == {0.0, 1.0}
    for mode in ("csm", "pcss", "pcf", "hard"):
        assert np.array_equal(visibility(maps, areas, 0, points, normals, of(ValSettings, visibility=mode)), hard)
    none = visibility(maps, areas, 0, points, normals, of(ValSettings, visibility="none"))
    unmapped = visibility(maps._replace(map_of=np.array([-1])), areas, 0, points, normals, ValSettings())
    assert (none == 1).all()
    assert (unmapped == 1).all()
