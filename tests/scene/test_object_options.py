"""Objects whose reflectance counts as 0 for others, in every method; what scene files say of objects (HSS Sec. 4)."""

import dataclasses

import numpy as np
import pytest

from refgi.diagnostics import SamplingError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.lights.settings import LightSettings
from refgi.methods import METHODS
from refgi.pairs.estimates import with_seen_light
from refgi.pairs.irradiance import Receivers
from refgi.provenance.record import materials_digest
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import SiiSettings
from refgi.splat.sii.approximations import sii_ledger
from tests.scene.samples import SCENE, write_scene
from tests.wiring.cases import SCENES

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # reported: tests/pairs/test_loss

OPTIONS = {"width": 17, "height": 13, "rsm_resolution": 16}
FEW = {"sii": [{}, {"source": "walk", "source.bounces": 2}, {"half_resolution": True}], "multires": [{}],
       "val": [{"clusters.count": 3, "maps.resolution": 16}], "gather": [{}], "vpl": [{}, {"maps": "imperfect"}],
       "hssil": [{}, {"senders.downsample": "closest"}, {"senders.downsample": "average"}],
       "truth": [{"samples": 24}]}
CHOICES = [(method, how) for method, several in FEW.items() for how in several]
NAMES = [one.name for one in SCENES["lamps"]().materials]
BLACK = {"diffuse": (0.0, 0.0, 0.0), "specular": (0.0, 0.0, 0.0)}
WHOLE = 1e-6  # of the power of the lights: an account in float32


def painted(**changes):
    """The room whose wall, which is diffuse and glossy, is changed."""
    scene = SCENES["lamps"]()
    return dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, **changes) if one.name == "glossy" else one for one in scene.materials))


def of_wall(frame):
    """Which texels of a frame's maps show the wall, one a lamp."""
    return [rsm.covered & (frame.scene.geometry.material_of_face[rsm.triangle_id] == NAMES.index("glossy"))
            for rsm in frame.rsms]


@pytest.mark.feature("HSS-01", "HSS-21")
@pytest.mark.parametrize(("method", "how"), CHOICES, ids=str)
def test_it_lights_others_as_black_does_and_is_seen_as_it_is(method, how):
    """Oracle: the irradiance with a black object, to the bit; the picture with the object's own reflectance."""
    settings = of(METHODS[method].settings, **how)
    silent, black, plain = (Frame(painted(**changes), **OPTIONS) for changes in ({"sends": False}, BLACK, {}))
    light, expected, other = (METHODS[method].compute(frame, settings)[0] for frame in (silent, black, plain))
    np.testing.assert_array_equal(light, expected)
    assert light.mean() < other.mean()
    np.testing.assert_array_equal(silent.radiance(light), plain.radiance(light))
    lobes = METHODS[method].compute_lobes(silent, settings)[0]
    assert lobes is None or lobes[:, silent.gbuffer.material_id == NAMES.index("glossy")].any()


@pytest.mark.feature("HSS-21")
def test_its_light_is_absent_and_all_others_is_there_to_the_bit(evidence):
    silent, plain = (Frame(painted(**changes), **OPTIONS) for changes in ({"sends": False}, {}))
    shares = []
    for ours, theirs, wall in zip(silent.rsms, plain.rsms, of_wall(plain), strict=True):
        for kind in ("flux", "lobe_flux"):
            found, whole = getattr(ours, kind), getattr(theirs, kind)
            assert whole[:, wall].any()
            assert not found[:, wall].any()
            np.testing.assert_array_equal(found[:, ~wall], whole[:, ~wall])
        shares.append(theirs.flux[:, wall].sum() / theirs.flux.sum())
    evidence("flux of the object, absent: " + ", ".join(f"{share:.0%}" for share in shares)
             + " of the maps'; of all else 0 bits differ")


@pytest.mark.feature("HSS-21")
def test_stated_errors_know():
    """What lights lack of the light that visible surfaces send."""
    frames = [Frame(painted(**changes), **OPTIONS) for changes in ({"sends": False}, BLACK, {})]
    dim = choose_lights(frames[1], LightSettings())
    dim = dim._replace(flux=1e-6 * dim.flux, lobe_flux=None)
    receivers = Receivers(*frames[1].gbuffer.resolve("position", "normal", "covered"))
    stated = [with_seen_light(SamplingError(0.0, 0.0, 0.0, 1), frame, receivers, dim) for frame in frames]
    assert all(one.most == one.pixel for one in stated)
    silent, black, plain = (one.pixel for one in stated)
    assert silent == black < plain


@pytest.mark.feature("HSS-21")
def test_the_ledger_knows():
    frames = [Frame(painted(**changes), **OPTIONS) for changes in ({"sends": False}, BLACK)]
    silent, black = (sii_ledger(frame, SiiSettings()) for frame in frames)
    np.testing.assert_array_equal(silent.absorbed, black.absorbed)
    assert np.abs(silent.difference).max() < WHOLE * silent.emitted.max()


def test_scenes_without_such_objects_have_one_table():
    frame = Frame(painted(), **OPTIONS)
    assert frame.senders is frame.materials
    assert frame.sent_albedo is frame.gbuffer.albedo


@pytest.mark.feature("HSS-21")
def test_files_say_it_of_objects(tmp_path):
    square = SCENE["objects"][0]
    changes = [{}, {"sends": False}, {"rigid": True}, {"rigid": True, "sends": False}]
    scene = load_scene(write_scene(tmp_path, objects=[square | change for change in changes]))
    found = [scene.materials[k] for k in scene.geometry.material_of_face[::2]]
    assert [(one.sends, one.solid) for one in found] == [(True, 0), (False, 0), (True, 3), (False, 4)]
    assert {one.name for one in found} == {"paint"}


def test_records_tell_them_apart():
    digests = {materials_digest(painted(**changes)) for changes in ({}, {"sends": False}, {"solid": 1}, {"solid": 2})}
    assert len(digests) == 4
