"""Light lists of kernels change no bit: of many lights, of glossy receivers, of every bound."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.methods import METHODS
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import LANES, reached, sum_pairs_in_range
from refgi.scene import load_scene
from refgi.settings import from_text
from refgi.skips import count_skips, without_skip
from refgi.splat.sii.sii import glossy_in_range
from tests.pairs.sets import random_directions

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

CUT = ("lights=300", "reach.cut=relative", "reach.cut.reference_length=1")


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_sums_over_many_groups_do_not_depend_on_lists(real):
    """2300 lights: groups and what is listed at once end anywhere, lists hold odd and even numbers of lights."""
    rng = np.random.default_rng(2)
    count, lamps = 5 * LANES - 9, 2300
    position, normal = rng.uniform(-1, 1, (3, count)).astype(real), random_directions(rng, count).astype(real)
    lights = np.zeros((9, lamps + 1), real)
    lights[:3], lights[3:6] = rng.uniform(-3, 3, (3, lamps + 1)), random_directions(rng, lamps + 1)
    lights[6:, :-1] = rng.random((3, lamps))
    square = np.append(rng.uniform(0, 4, lamps), 1).astype(real)
    reach, tiles = Range(square, np.ones(lamps + 1, real), False), -(-count // LANES)
    exact = np.zeros((tiles, lamps), bool)
    for tile in range(tiles):
        for lane in range(tile * LANES, min(count, (tile + 1) * LANES)):
            for k in range(lamps):
                d = lights[:3, k] - position[:, lane]
                exact[tile, k] |= exact[tile, k] or reached(*d, *lights[3:6, k], square[k])
    exact[2] = False  # a tile without lights is 0
    sums = [np.full((3, count), 7, real) for _ in range(2)]
    for listed, irradiance in zip((exact, np.ones_like(exact)), sums, strict=True):
        sum_pairs_in_range(position, normal, lights, None, reach, listed, irradiance)
    some = np.arange(count) // LANES != 2
    assert np.array_equal(sums[0][:, some], sums[1][:, some])
    assert not sums[0][:, ~some].any()
    assert 0.02 < exact.mean() < 0.9
    assert (sums[0] > 0).any()


@pytest.mark.feature("SII-18")
@pytest.mark.parametrize("changes", [("reach.cut.share=0.05",), ("reach.cut.share=0.01", "reach.stochastic=true"),
                                     ("reach.cut.share=0.3", "pairs.lobe.widening=0.1")], ids=str)
def test_radiance_of_lobes_is_that_of_every_bound(changes):
    """And that without any list or cull."""
    scene, pictures = load_scene("ring:faces=2000"), []
    frame = Frame(scene, width=96, height=72, rsm_resolution=64)
    for bound in ("tangent", "ellipsoid", "quad", "full"):
        settings = from_text(METHODS["sii"].settings(), (*CUT, *changes, f"reach.bound={bound}"))
        lights, points = choose_lights(frame, settings.lights), frame.glossy_points
        areas = footprints(frame, settings.lights, settings.pairs)
        with count_skips() as counts:
            pictures.append(glossy_in_range(points, lights, settings, areas, frame.width))
        if bound != "full":
            assert counts["sii.bounds"].left_out > 0
    with without_skip("sii.bounds", "pairs.tiles", "pairs.lobe_tiles", "pairs.receiver_lobes"):
        plain = glossy_in_range(points, lights, settings, areas)
    for picture in pictures:
        assert np.array_equal(picture, plain)
    assert (plain > 0).any()
