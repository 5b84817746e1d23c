"""The whole method, from the picture to its indirect light, against a slow twin that knows the paper alone."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import PointLight, SpotLight
from refgi.settings import of, replaced
from refgi.sssil.crown.pattern import samples_at
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import HssilSettings
from tests.naive import hssil as naive
from tests.truth.scenes import corner_room

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
LIGHTS = (SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.4, 0.8, (2.0, 1.5, 1.0)),
          PointLight((0.2, 0.9, 0.3), (0.3, 0.3, 0.3)))
# rolled: the nearest of two texels at one depth would be anyone's choice
VIEW = {"eye": (1.7, 1.4, 1.5), "target": (-0.4, 0.35, -0.5), "up": (0.1, 1.0, 0.0), "vfov": math.radians(70)}


@pytest.fixture(scope="module")
def frame():
    """A corner with a plate in front of it and the void behind: 17 x 13, so that levels end in half texels."""
    return Frame(corner_room(*LIGHTS).with_camera(**VIEW), width=17, height=13, dtype=np.float64, shadows="exact")


def twin(frame, settings):
    """Return the twin's irradiance with the samples that the settings draw."""
    buffer, printed = frame.gbuffer, settings.as_published
    depth, normal, albedo = buffer.resolve("depth", "normal", "albedo")
    view = buffer.projection
    texels = naive.first_texels(depth, normal, albedo * frame.direct / math.pi, view.frame[0], view.half,
                                "hss_tan_f" in printed)
    sampling, senders, upsampling = settings.sampling, settings.senders, settings.upsampling
    weights = {} if upsampling.name() != "bilateral" else {
        "sigma": upsampling.depth_sigma, "power": upsampling.normal_power}
    return naive.hssil(texels, first=sampling.first_level, count=sampling.levels, offsets=samples(settings),
                       mode=senders.downsample, form=senders.form_factor, kind=upsampling.name(),
                       only=senders.only_level, **weights,
                       disc_pi="hss_disc_pi" in printed, level_factor="hss_level_factor" in printed,
                       seed=sampling.seed, share=senders.disc_share)


def samples(settings):
    """Return the function that lists (ox, oy, w) for a receiver of a level."""
    def listed(index, level, row, column):
        if settings.sampling.pattern == "all":
            return naive.everything(settings.sampling.radius, index, (13, 17))
        offsets, weight = samples_at(settings.sampling, index, level, row, column)
        return [(ox, oy, w) for (ox, oy), w in zip(offsets.tolist(), weight.tolist(), strict=True)]
    return listed


SETTINGS = {
    "every pixel": of(HssilSettings, pattern="all", start="full", levels=1, radius=11.0),
    "every texel of four levels": of(HssilSettings, pattern="all", start="full", levels=4, radius=2.0),
    "from half resolution": of(HssilSettings, pattern="all", levels=3, radius=2.0),
    "from quarter resolution": of(HssilSettings, pattern="all", start="quarter", levels=2, radius=2.0),
    "a row's samples": of(HssilSettings, levels=3, radius=2.0, samples=9),
    "a pixel's samples": of(HssilSettings, pattern="pixel", start="full", levels=3, radius=3.0, samples=8, seed=4),
    "fixed samples": of(HssilSettings, pattern="fixed", levels=3, radius=2.0, samples=11, inner_samples=5),
    "no inner samples": of(HssilSettings, pattern="pixel", levels=3, radius=2.0, samples=8, inner_samples=0),
    "averages": of(HssilSettings, levels=3, radius=2.0, pattern="all", start="full", downsample="average"),
    "closest places, average light": of(HssilSettings, levels=3, radius=2.0, downsample="closest_average"),
    "the closest": of(HssilSettings, levels=3, radius=2.0, downsample="closest"),
    "the disc of all": of(HssilSettings, levels=3, radius=2.0, disc_share=1.0),
    "points": of(HssilSettings, levels=3, radius=2.0, form_factor="point"),
    "bilinear": of(HssilSettings, levels=3, radius=2.0, upsampling="bilinear"),
    "nearest": of(HssilSettings, levels=3, radius=2.0, upsampling="nearest"),
    "wide weights": of(HssilSettings, levels=3, radius=2.0, depth_sigma=0.3, normal_power=1.5),
    "the second level alone": of(HssilSettings, levels=3, radius=2.0, only_level=1),
    "as printed": of(HssilSettings, levels=3, radius=2.0, as_published=HssilSettings.SWITCHES),
    "tan f alone": of(HssilSettings, levels=3, radius=2.0, as_published={"hss_tan_f"}),
}


@pytest.mark.feature("HSS-12")
@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.filterwarnings("ignore:radius")
def test_the_twin(frame, name, evidence):
    settings = SETTINGS[name]
    light, expected = hssil(frame, replaced(settings, {"blur": None})), twin(frame, settings)
    off = np.abs(light - expected).max() / expected.max()
    evidence(f"{name}: off by {off:.0e} of the brightest pixel")
    assert off < ROUNDING
