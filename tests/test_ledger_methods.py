"""Ledgers of `multires` and `val`: they balance, and what shadows, subsplats and Eq. 3 take is on lines of its own."""

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.cluster.val import val_ledger
from refgi.frame import Frame
from refgi.ledger import pixel_areas
from refgi.lights.selection import choose_lights
from refgi.literal.pairs import pair
from refgi.scene import SpotLight, load_scene
from refgi.settings import of
from refgi.splat.multires import MultiresSettings, multires
from refgi.splat.multires.approximations import multires_ledger
from tests.naive.crossings import corners_of, free
from tests.truth.scenes import corner_room, rectangle, scene

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

WHOLE = 1e-5  # of emitted: what a float32 account may be off by (REF-04)
TWIN = 1e-12  # of emitted: float64 sums in another order
RAYS = 1e-8  # of emitted: the pairs of `vpl` are those of float32 receivers
METHODS = {"multires": (multires_ledger, multires, MultiresSettings), "val": (val_ledger, val, ValSettings)}
CASES = [
    ("multires", {}), ("multires", {"supersampled": True}),
    ("multires", {"clamp": "geometry", "clamp_value": 30.0, "detail": 0.5}),
    ("multires", {"visibility": "rays"}), ("multires", {"visibility": "val"}),
    ("multires", {"subsplats": "irradiance"}),
    ("multires", {"as_published": {"ams_disc", "ams_filter_all", "ams_rho_in_splat"}}),
    ("multires", {"source": "walk", "bounces": 2}), ("multires", {"ambient_occlusion": "openness", "detail": 0.5}),
    ("val", {}), ("val", {"interleaving": 4, "blur": "box"}), ("val", {"visibility": "none"}),
    ("val", {"visibility": "rays_vpls", "clamp": "distance", "clamp_value": 0.05}),
]


def ledger_of(method, frame, **settings):
    account, _, kind = METHODS[method]
    return account(frame, of(kind, **{"lights": 100} | settings))


@pytest.mark.feature("REF-04")
@pytest.mark.parametrize(("method", "settings"), CASES)
def test_lines_sum_to_what_is_emitted(method, settings, evidence):
    frame = Frame(load_scene("stage:faces=1000"), width=40, height=32, rsm_resolution=96)
    ledger = ledger_of(method, frame, **settings)
    off = float(np.abs(ledger.difference).max() / ledger.emitted.max())
    picture = METHODS[method][1](frame, of(METHODS[method][2], **{"lights": 100} | settings))
    arrived = np.einsum("chw,hw->c", picture, pixel_areas(frame.gbuffer, frame.scene.geometry), dtype=np.float64)
    np.testing.assert_allclose(ledger.arrived, arrived, rtol=1e-12)
    evidence(f"{method} {settings}: emitted - sum of lines is {off:.0e} of emitted")
    assert off < WHOLE


@pytest.mark.feature("REF-04")
@pytest.mark.parametrize(("method", "settings", "limit"), [
    ("multires", {"visibility": "rays", "coarsest": 64}, RAYS),
    ("val", {"visibility": "rays_vpls", "clamp": "none"}, TWIN)])
def test_what_is_blocked_is_that_of_the_twin(method, settings, limit, evidence):
    """Oracle: a ray for each pair of pixel and light against every triangle; nothing else is lost at every pixel."""
    lamp = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.4, 0.8, (2.0, 1.5, 1.0))
    room = corner_room(lamp).with_camera(eye=(1.7, 1.4, 1.5), target=(-0.4, 0.35, -0.5))
    frame = Frame(room, width=13, height=11, rsm_resolution=32, dtype=np.float64)
    ledger = ledger_of(method, frame, **settings | {"lights": 25})
    lights = choose_lights(frame, of(METHODS[method][2], lights=25).lights)
    geometry, buffer = frame.scene.geometry, frame.gbuffer
    areas, blocked = pixel_areas(buffer, geometry), np.zeros(3)
    for i, j in zip(*np.nonzero(buffer.covered), strict=True):
        x, normal = buffer.position[:, i, j], buffer.normal[:, i, j]
        for p, n, flux in zip(lights.position.T, lights.normal.T, lights.flux.T, strict=True):
            share = pair(x, normal, p, n, flux)
            if share.any() and is_blocked(geometry, x, p):
                blocked += areas[i, j] * share
    off = np.abs(ledger.shadowed - blocked).max() / ledger.emitted.max()
    evidence(f"{method}: {ledger.shadowed[1] / ledger.emitted[1]:.2%} of what is emitted is blocked, {off:.0e} off the "
             "twin")
    assert blocked.min() > 1e-3 * ledger.emitted.max()
    assert off < limit
    assert np.abs(ledger.interpolated).max() < TWIN * ledger.emitted.max()


def is_blocked(geometry, start, end):
    """Return whether a triangle lies between two points on surfaces."""
    way = np.subtract(end, start)
    return not free(corners_of(geometry), (start + 1e-6 * way)[None], (end - 1e-6 * way)[None])[0]


@pytest.mark.feature("REF-04")
def test_each_loss_is_on_its_line(evidence):
    """Property: without shadows, subsplats or detail their lines are 0; each alone moves its own."""
    frame = Frame(load_scene("cornell_box"), width=40, height=32, rsm_resolution=96)
    lost = ("shadowed", "interpolated", "darkened")

    def lines(method, **settings):
        ledger = ledger_of(method, frame, **settings)
        return {line: float(getattr(ledger, line)[1] / ledger.emitted[1]) for line in lost
                if getattr(ledger, line) is not None}

    nothing = dict.fromkeys(lost, 0.0)
    assert lines("multires", coarsest=64) == nothing
    assert lines("multires")["interpolated"] != 0
    detail = lines("multires", coarsest=64, detail=0.5)
    assert detail.pop("darkened") > 1e-3
    assert not any(detail.values())
    occluded = lines("multires", coarsest=64, ambient_occlusion="openness")
    assert occluded.pop("shadowed") > 1e-3
    assert not any(occluded.values())
    none = lines("val", visibility="none", interleaving=1)
    assert set(none) == {"shadowed", "interpolated"}
    assert max(map(abs, none.values())) < WHOLE
    shadows = lines("val", interleaving=1)
    assert shadows["shadowed"] > 1e-2
    assert shadows["interpolated"] == 0
    assert lines("val", interleaving=4)["interpolated"] != 0
    evidence(f"cornell_box: val blocks {shadows['shadowed']:.1%} of what is emitted")


@pytest.mark.parametrize("method", METHODS)
def test_a_view_of_nothing_balances(method):
    lamp = SpotLight((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), 0.4, 0.8, (1.0, 1.0, 1.0))
    alone = scene([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))], lamp)
    away = alone.with_camera(eye=(0.0, 0.0, 50.0), target=(0.0, 0.0, 60.0))
    ledger = ledger_of(method, Frame(away, width=16, height=16, rsm_resolution=32))
    assert np.abs(ledger.difference).max() < WHOLE * ledger.emitted.max()
    assert not np.any([ledger.arrived, ledger.behind])
    assert np.array_equal(ledger.off_screen, ledger.lights)
