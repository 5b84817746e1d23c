"""Pictures that are nearly black or white are named, `--exposure auto` fits them; `--light-unit` and `--emissive`."""

import json

import imageio.v3
import numpy as np
import pytest

from refgi.image import read_exr, read_png_attributes
from tests.cli.test_render import TINY, run
from tests.scene.test_emissive_lamps import room

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
LAMP = "point:position=0.278,0.3,-0.2796:intensity="


@pytest.mark.parametrize(("intensity", "named"), [("1e-6", "nearly black"), ("1e7", "nearly white"), ("1", None)])
def test_a_brightest_radiance_far_from_1_is_named(tmp_path, intensity, named):
    result = run("cornell_box", *TINY, "--light", LAMP + intensity, "--json", "--out", tmp_path / "a.exr")
    content = json.loads(result.stdout)
    found = [text for text in content["warnings"] if "brightest radiance" in text]
    assert len(found) == (named is not None)
    if named:
        assert f"brightest radiance is {content['brightest_radiance']:.3g} W/m^2/sr" in found[0]
        assert "at the exposure of 1.5" in found[0]  # the scene's own
        assert f"a PNG of it is {named}" in found[0]
        assert "--exposure auto" in found[0]
        assert "--light-unit" not in found[0]
    fitted = run("cornell_box", *TINY, "--light", LAMP + intensity, "--exposure", "auto", "--json", "--out",
                 tmp_path / "b.exr")
    assert not [text for text in json.loads(fitted.stdout)["warnings"] if "brightest radiance" in text]


def test_auto_exposure_makes_the_98th_percentile_white_and_is_in_the_record(tmp_path):
    assert run("cornell_box", *TINY, "--light", LAMP + "1e-6", "--exposure", "auto", "--out", tmp_path).exit_code == 0
    exr, = tmp_path.glob("*.exr")
    png, = tmp_path.glob("*.png")
    channels, record = read_exr(exr)
    brightest = np.max([channels[name] for name in "RGB"], axis=0)
    lit = brightest[brightest > 0]
    assert record["exposure"] == pytest.approx(1 / np.percentile(lit, 98), rel=1e-6)
    assert record["auto_exposure"] == {"percentile": 98}
    assert read_png_attributes(png)["exposure"] == record["exposure"]
    codes = imageio.v3.imread(png).max(axis=2)
    assert 0.005 < (codes == 255).sum() / len(lit) < 0.05
    again = run("--again", exr)
    assert again.exit_code == 0
    assert "the same to the bit" in again.stdout


def test_another_exposure_is_refused():
    result = run("cornell_box", "--exposure", "bright", "--out", "a.png")
    assert result.exit_code == 2
    assert "expected a number or auto, got 'bright'" in result.stderr


def test_emissive_lamps_are_in_the_record_and_made_again(tmp_path):
    path = room(tmp_path)
    result = run(path, *TINY, "--emissive", "lamps", "--json", "--out", tmp_path / "a.exr")
    content = json.loads(result.stdout)
    assert any("1 lamp(s), each in place of an emissive part" in text for text in content["warnings"])
    record = read_exr(tmp_path / "a.exr")[1]
    assert record["scene"]["emissive_lamps"]["count"] == 1
    assert record["scene"]["lights"][0]["falloff"] == "ramp"
    again = run("--again", tmp_path / "a.exr", "--out", tmp_path / "b.exr")
    assert "the same to the bit" in again.stdout
    assert read_exr(tmp_path / "b.exr")[1]["scene"] == record["scene"]


def test_a_gltf_lamp_of_1000_w_that_is_taken_for_cd_is_named(tmp_path):
    """79.577 is 1000 W / 4 pi; 2 m above a white square E = 79.577 / 683 / 4 and L = E / pi = 0.0093 at most."""
    from tests.scene.samples import glb_bytes, gltf_tree

    tree = gltf_tree()
    tree["extensions"]["KHR_lights_punctual"]["lights"] = [{"type": "point", "intensity": 79.577}]
    del tree["meshes"][0]["primitives"][0]["material"]
    tree["nodes"][2]["translation"] = [1.5, 2.5, 5]
    (tmp_path / "a.glb").write_bytes(glb_bytes(tree))
    view = ["--vfov-deg", "30", "--eye", "1.5,2.5,6", "--target", "1.5,2.5,3"]
    for unit, said in (("cd", True), ("W/sr", False)):
        result = run(tmp_path / "a.glb", *TINY, *view, "--light-unit", unit, "--json", "--out",
                     tmp_path / f"{unit[0]}.png")
        texts = json.loads(result.stdout)["warnings"]
        assert any("--light-unit says what the file's lights are in" in text for text in texts) == said


def test_the_light_unit_of_gltf_scales_the_picture(tmp_path):
    from tests.scene.samples import glb_bytes, gltf_tree

    (tmp_path / "a.glb").write_bytes(glb_bytes(gltf_tree()))
    pictures = {}
    for unit in ("cd", "W/sr"):
        out = tmp_path / f"{unit[0]}.exr"
        result = run(tmp_path / "a.glb", *TINY, "--light-unit", unit, "--vfov-deg", "60", "--eye", "1.5,2.5,5",
                     "--target", "1.5,2.5,3", "--up", "0,1,0", "--json", "--out", out)
        assert result.exit_code == 0, result.output
        pictures[unit] = read_exr(out)[0]["R"].max()
    assert pictures["W/sr"] == pytest.approx(683 * pictures["cd"], rel=1e-5)
