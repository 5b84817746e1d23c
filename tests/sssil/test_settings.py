"""What `hssil` can be set to: each wrong value is refused by name."""

import pytest

from refgi.errors import InputError
from refgi.scene import load_scene
from refgi.sssil import HssilSettings

NAN = float("nan")


@pytest.mark.parametrize(("key", "value"), [
    ("radius", 0.5), ("radius", NAN), ("radius", 1e9), ("levels", 0), ("levels", 17), ("samples", 0), ("samples", 2.5),
    ("inner_samples", -1), ("start", "eighth"), ("pattern", "spiral"), ("seed", -1), ("downsample", "nearest"),
    ("form_factor", "sphere"), ("only_level", 4), ("only_level", -1), ("upsampling", "cubic"), ("depth_sigma", 0.0),
    ("depth_sigma", NAN), ("normal_power", -1.0), ("visibility", "maybe"), ("slices", 0), ("slices", 257),
    ("thickness", -0.1), ("thickness", NAN), ("cameras", -1), ("cameras", 17), ("views", ("left",)),
    ("depth_tolerance", 1.5), ("normal_cosine", -2.0), ("as_published", {"hss_everything"}),
])
def test_a_wrong_value_is_refused_by_name(key, value):
    with pytest.raises(InputError, match=key):
        HssilSettings(**{key: value})


def test_settings_compare_by_value_and_serve_as_keys():
    camera = load_scene("cornell_box").camera
    one, other = (HssilSettings(views=[camera], as_published=["hss_tan_f"]) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)


@pytest.mark.parametrize(("start", "first"), [("full", 0), ("half", 1), ("quarter", 2)])
def test_the_start_is_a_level(start, first):
    assert HssilSettings(start=start).first_level == first


@pytest.mark.parametrize(("samples", "inner"), [(64, 21), (256, 85), (1, 1), (3, 1)])
def test_the_first_disc_is_as_dense_as_its_crown(samples, inner):
    """A disc of radius r has a third of the area of the crown from r to 2 r."""
    assert HssilSettings(samples=samples).inner == inner
    assert HssilSettings(samples=samples, inner_samples=7).inner == 7
