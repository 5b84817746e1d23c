"""The whole method against plain loops, from the pixel lights to the blurred picture, on a picture of a few pixels."""


import numpy as np
import pytest

from refgi.cluster.settings import Hard, Pcf, Pcss, ValSettings
from refgi.cluster.val import val
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.rsm import facing_normals
from refgi.scene import load_scene
from refgi.settings import of, replaced
from tests.naive import val as naive

SIDE, MAP = 8, 16
SETTINGS = of(ValSettings, lights=40, clusters_count=5, maps_resolution=MAP, interleaving=1, prefilter="brute",
              clamp="none", near_distance=naive.NEAR)
HULL = 1e-6  # of the diagonal: what lies beyond a plane by less is not beyond it
# Sums of some dozen positive terms round by a few 1e-16. Whether a texel belongs to a disc could turn on the last bit
# and change V by a texel's share: no such tie occurs here.
ROUNDING = 1e-14
SINGLE = 2e-6  # the same with the unit of float32, 6e-8


@pytest.fixture(scope="module", params=[np.float64, np.float32])
def box(request):
    return Frame(load_scene("cornell_box"), width=SIDE, height=SIDE, rsm_resolution=32, dtype=request.param)


def pixels_of(frame):
    """Return (row, column) -> position, normal, normal of the triangle; of pixels that see one."""
    buffer = frame.gbuffer
    facing = facing_normals(frame.scene.geometry, buffer.triangle_id, buffer.normal)
    return {(i, j): [a[:, i, j].astype(float).tolist() for a in (buffer.position, buffer.normal, facing)]
            for i, j in np.argwhere(buffer.covered).tolist()}


def lit_points(frame):
    """Return the places that lights reach, at all texels."""
    return [place for rsm in frame.rsms for place in rsm.position[:, rsm.flux.any(axis=0)].T.astype(float).tolist()]


def twin(frame, settings, block=1):
    """Return the picture by loops, (3, h, w)."""
    lights, geometry = choose_lights(frame, settings.lights), frame.scene.geometry
    positions, normals, fluxes = (a.T.astype(float).tolist() for a in (lights.position, lights.normal, lights.flux))
    triangles = geometry.vertices[geometry.faces].tolist()
    pixels, corners = pixels_of(frame), geometry.vertices[geometry.faces]
    lit, seen = lit_points(frame), [place for place, _, _ in pixels.values()]
    across = naive.diagonal_of(naive.box_of(lit))
    areas = naive.area_lights(positions, *naive.k_means(positions, normals, settings.clusters.count, across))
    box = naive.box_of(lit + seen)
    above = [naive.lifted(area, naive.box_of(lit)) for area in areas]
    ends = corners[np.unique(frame.gbuffer.triangle_id[frame.gbuffer.covered])].reshape(-1, 3).tolist() + positions
    maps = [naive.depth_map(area, triangles, MAP, ends, box, HULL * naive.diagonal_of(box)) for area in above]

    def visible(m, x, facing):
        kind = settings.visibility
        if isinstance(kind, Hard) or areas[m].delta == 0:
            return naive.hard(above[m], maps[m], x, facing)
        if isinstance(kind, Pcss):
            return naive.pcss(above[m], maps[m], x, facing)
        if isinstance(kind, Pcf):
            return naive.pcf(above[m], maps[m], x, facing, kind.texels)
        if kind is None:
            return 1.0
        return naive.csm(above[m], maps[m], x, kind.terms, kind.depth_scale)

    light = naive.irradiance(pixels, (positions, normals, fluxes), areas, visible, block)
    if block > 1:
        extent = settings.blur.extent * naive.diagonal_of(naive.box_of(seen))
        light = naive.blurred(light, pixels, block, SIDE, extent, settings.blur.cosine)
    picture = np.zeros((3, SIDE, SIDE))
    for (row, column), value in light.items():
        picture[:, row, column] = value
    return picture


@pytest.mark.feature("REF-15", "VAL-01", "VAL-12")
@pytest.mark.parametrize("mode", ["csm", "pcss", "pcf", "hard", "none"])
def test_every_pixel_is_that_of_the_loops(box, mode, evidence):
    settings = replaced(SETTINGS, {"visibility": mode})
    expected, got = twin(box, settings), val(box, settings)
    off = np.abs(got - expected).max() / expected.max()
    shadows = 1 - expected.sum() / twin(box, replaced(settings, {"visibility": "none"})).sum()
    evidence(f"{mode}, {box.dtype}: {off:.1e} of the maximum off a picture by plain loops; shadows take {shadows:.0%}")
    assert (shadows > 0.03) == (mode != "none")
    assert off < (ROUNDING if box.dtype == np.float64 else SINGLE)


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("scale", ["map", "scene"])
def test_other_scales_of_depth_as_well(box, scale, evidence):
    settings = replaced(SETTINGS, {"depth_scale": scale})
    expected, got = twin(box, settings), val(box, settings)
    off, other = (np.abs(got - picture).max() / expected.max() for picture in (expected, val(box, SETTINGS)))
    evidence(f"depths on the scale {scale!r}, {box.dtype}: {off:.1e} of the maximum off a picture by plain loops, "
             f"{other:.2f} off the default")
    assert other > 0.01
    assert off < (ROUNDING if box.dtype == np.float64 else SINGLE)


@pytest.mark.feature("VAL-23", "VAL-24")
def test_interleaved_and_blurred_as_well(box, evidence):
    settings = replaced(SETTINGS, {"interleaving": 4, "assignment": "index", "every_subset": False})
    expected, got = twin(box, settings, 4), val(box, settings)
    off = np.abs(got - expected).max() / expected.max()
    evidence(f"4 x 4 interleaved, blurred, {box.dtype}: {off:.1e} of the maximum off a picture by plain loops")
    assert off < (ROUNDING if box.dtype == np.float64 else SINGLE)
