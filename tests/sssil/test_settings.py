"""Settings of `hssil`: each wrong value is refused by name, and the tree of keys."""

import math

import pytest

from refgi.errors import InputError
from refgi.scene import load_scene
from refgi.scene.model import Camera
from refgi.settings import flat, from_text, leaves, of, replaced
from refgi.sssil import HssilSettings
from refgi.sssil.settings import PRESETS, Bilateral, Bitmask, GeometryBlur, Rays, TemporalSettings

NAN = float("nan")


@pytest.mark.parametrize(("key", "value"), [
    ("radius", 0.5), ("radius", NAN), ("radius", 1e9), ("levels", 0), ("levels", 17), ("samples", 0), ("samples", 2.5),
    ("inner_samples", -1), ("start", "eighth"), ("pattern", "spiral"), ("seed", -1), ("downsample", "nearest"),
    ("form_factor", "sphere"), ("disc_share", -0.1), ("disc_share", 1.1),
    ("only_level", 4), ("only_level", -1), ("upsampling", "cubic"), ("depth_sigma", 0.0),
    ("depth_sigma", NAN), ("normal_power", -1.0), ("visibility", "maybe"), ("slices", 0), ("slices", 257),
    ("thickness", -0.1), ("thickness", NAN), ("cameras", -1), ("views", ("left",)),
    ("depth_tolerance", 1.5), ("normal_cosine", -2.0), ("as_published", {"hss_everything"}),
])
def test_a_wrong_value_is_refused_by_name(key, value):
    with pytest.raises(InputError, match=key):
        of(HssilSettings, **{key: value})


@pytest.mark.parametrize("values", [
    {"upsampling": "bilinear", "depth_sigma": 0.1}, {"visibility": "rays", "thickness": 0.1},
    {"visibility": "rays", "slices": 4}, {"visibility": "bitmask", "pattern": "all"},
])
def test_combinations_that_mean_nothing_are_refused(values):
    with pytest.raises(InputError):
        of(HssilSettings, **values)


def test_choices_hold_their_own_settings():
    settings = of(HssilSettings, visibility="bitmask", thickness=0.1, depth_sigma=0.3)
    assert settings.visibility == Bitmask(thickness=0.1)
    assert settings.upsampling == Bilateral(depth_sigma=0.3)
    assert of(HssilSettings, visibility="rays") == HssilSettings(visibility=Rays())


@pytest.mark.parametrize("kind", [HssilSettings, TemporalSettings])
def test_a_page_shows_few_keys_and_says_what_each_is(kind):
    shown = [leaf for leaf in leaves(kind) if not leaf.is_for_study]
    assert len(shown) <= 12
    assert all(leaf.about for leaf in leaves(kind))


@pytest.mark.feature("HSS-04", "HSS-06", "HSS-07", "HSS-18")
def test_the_papers_values_are_the_defaults_but_for_noise():
    """The paper says neither where samples lie nor who shares them; it blurs no level, and draws no sender."""
    changed = {"sampling.pattern": "interleaved", "sampling.density": "inverse_distance", "blur": GeometryBlur(),
               "senders.downsample": "resampled", "senders.disc_share": 0.25}
    printed = flat(PRESETS["paper"])
    assert [printed[key] for key in changed] == ["row", "uniform", None, "closest", 1.0]
    assert replaced(PRESETS["paper"], changed) == HssilSettings()


def test_settings_compare_by_value_and_serve_as_keys():
    camera = load_scene("cornell_box").camera
    one, other = (of(HssilSettings, views=[camera], as_published=["hss_tan_f"]) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)


@pytest.mark.parametrize(("start", "first"), [("full", 0), ("half", 1), ("quarter", 2)])
def test_the_start_is_a_level(start, first):
    assert of(HssilSettings, start=start).sampling.first_level == first


@pytest.mark.feature("HSS-05")
@pytest.mark.parametrize(("samples", "inner"), [(64, 21), (256, 85), (1, 1), (3, 1)])
def test_the_first_disc_is_as_dense_as_its_crown(samples, inner):
    """A disc of radius r has a third of the area of the crown from r to 2 r."""
    sampling = of(HssilSettings, samples=samples, density="uniform").sampling
    assert sampling.counts(0) == (inner, samples)
    assert sampling.counts(1) == (0, samples)
    assert of(HssilSettings, samples=samples, inner_samples=7).sampling.counts(0) == (7, samples)


@pytest.mark.feature("HSS-05", "HSS-19")
@pytest.mark.parametrize(("samples", "disc", "crown"), [(64, 32, 32), (9, 5, 4), (1, 1, 1)])
def test_disc_and_crown_share_samples_whose_density_falls_with_distance(samples, disc, crown):
    """Rings of equal width get equally many: r of them lie within r, and r from there to 2 r."""
    sampling = of(HssilSettings, samples=samples).sampling
    assert sampling.counts(0) == (disc, crown)
    assert sampling.counts(2) == (0, samples)


def test_tiles_are_powers_of_two():
    assert of(HssilSettings, tile=8).sampling.tile == 8
    with pytest.raises(InputError, match="tile"):
        of(HssilSettings, tile=6)


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
