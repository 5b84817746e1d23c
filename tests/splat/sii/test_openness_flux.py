"""Fluxes scaled by 1 - openness, as the method has them: fragments, lost energy and picture in closed form (Table 3).

A sun straight above lights a floor that ends at a wall. What the wall hides of the sky above a point of the floor is
the form factor from the point to the wall, so that 1 - O is known without a ray.
"""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.literal.pairs import irradiance
from refgi.scene import Camera, DirectionalLight, Scene, merge
from refgi.settings import of, replaced
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.sii.approximations import sii_ledger
from refgi.splat.sii.fragments import fragments
from tests.form_factors import polygon_form_factor
from tests.truth.scenes import rectangle

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

WALL = [(0, 0, 1), (0, 0, -1), (0, 1.5, -1), (0, 1.5, 1)]
SUN = DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0))
VIEW = Camera((3.0, 1.1, 0.4), (0.0, 0.7, 0.0), (0.0, 1.0, 0.0), math.radians(60))
LOW = 0.002  # W/m^2, I_low
SETTINGS = of(SiiSettings, lights=256, pattern="grid", openness_radius=100.0, openness_rays=4096, cut_irradiance=LOW,
              clamp="none")
SCALED = replaced(SETTINGS, {"openness_flux": "scale"})
RAYS = 1e-3  # 4096 rays of a low-discrepancy set for each of 256 lights
ONE_LIGHT = 4e-3  # the rays of the light that is nearest to a pixel
AT_THE_RIM = 2e-3  # of the fragments: those of lights whose share is a ray of 4096 off


def seen(*meshes):
    geometry, materials = merge([rectangle((0, 0, 1), (4, 0, 0), (0, 0, -2)), *meshes])
    return Frame(Scene("by hand", geometry, materials, VIEW, (SUN,)), width=24, height=18, rsm_resolution=64,
                 dtype=np.float64)


@pytest.fixture(scope="module")
def wedge():
    return seen(rectangle((0, 0, 1), (0, 0, -2), (0, 1.5, 0)))


@pytest.fixture(scope="module")
def hidden(wedge):
    """1 - O of each light of the method, in closed form."""
    lights = choose_lights(wedge, SETTINGS.lights)
    return np.array([polygon_form_factor(place, (0, 1, 0), WALL) for place in lights.position.T])


def receivers_of(frame):
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


def pairs_within(frame, lights):
    """Count pairs with Phi / pi cos / r^2 >= I_low, light by light."""
    x, count = frame.gbuffer.position[:, frame.gbuffer.covered], 0
    for p, n, flux in zip(lights.position.T, lights.normal.T, lights.flux.T, strict=True):
        away = x - p[:, None]
        square = (away**2).sum(axis=0)
        count += np.count_nonzero(flux.max() / math.pi * (n @ away) >= LOW * square**1.5)
    return count


@pytest.mark.feature("SII-16")
def test_energy_lost_is_the_share_of_the_sky(wedge, hidden, evidence):
    """Closed form: the method's account has lost sum Phi (1 - F), F the form factor from a light to the wall."""
    flux = choose_lights(wedge, SETTINGS.lights).flux
    lost, total = (flux * (1 - hidden)).sum(axis=1), flux.sum(axis=1)
    account = sii_ledger(wedge, SCALED)
    np.testing.assert_allclose(account.scaled, lost, rtol=RAYS)
    np.testing.assert_allclose(account.lights, total - lost, rtol=5 * RAYS)  # the smaller part of the two
    assert not sii_ledger(wedge, SETTINGS).scaled.any()
    evidence(f"floor beside a wall: {account.scaled[1] / total[1]:.2%} of the flux lost, sum Phi (1 - F) "
             f"{lost[1] / total[1]:.2%}; the paper says nothing of it")


@pytest.mark.feature("SII-16")
def test_fragments_saved_are_those_of_an_independent_count(wedge, hidden, evidence):
    """Count of the method's lights by loops, with the closed form's fluxes; Table 3: 27 to 37 and 63 to 85 frames."""
    lights = choose_lights(wedge, SETTINGS.lights)
    counted = {how: fragments(receivers_of(wedge), choose_lights(wedge, how.lights), how).total
               for how in (SETTINGS, SCALED)}
    before, after = (pairs_within(wedge, some) for some in (lights, lights._replace(flux=lights.flux * hidden)))
    assert counted[SETTINGS] == before
    assert counted[SCALED] == pytest.approx(after, rel=AT_THE_RIM)
    assert 1000 < after < 0.8 * before
    evidence(f"fragments {counted[SETTINGS]} become {counted[SCALED]} ({after} with F): a speed-up of "
             f"{before / after:.2f} if they were all of the time; Table 3: {37 / 27:.2f} at 512^2, {85 / 63:.2f} at "
             "256^2, of a scene that is not published")


@pytest.mark.feature("SII-16")
def test_the_picture_is_that_of_the_scaled_fluxes(wedge, hidden, evidence):
    """Twin: Eq. 2 summed literally with Phi F."""
    uncut, buffer = replaced(SCALED, {"cut": "none", "clamp": "none"}), wedge.gbuffer
    lights = choose_lights(wedge, SETTINGS.lights)
    scaled = lights._replace(flux=lights.flux * hidden)
    expected = irradiance(buffer.position, buffer.normal, np.where(buffer.covered, 0, -1), *scaled[:3])
    expected = expected[:, buffer.covered]
    off = np.abs(sii(wedge, uncut)[:, buffer.covered] - expected).max() / expected.max()
    assert off < ONE_LIGHT
    evidence(f"sii against Eq. 2 with Phi F: {off:.0e} of the brightest pixel off")


def test_in_the_open_nothing_is_left():
    floor = seen()
    account = sii_ledger(floor, SCALED)
    assert not sii(floor, SCALED).any()
    np.testing.assert_allclose(account.scaled, choose_lights(floor, SETTINGS.lights).flux.sum(axis=1), rtol=1e-12)
