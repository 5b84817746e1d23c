"""`refgi render`: what it writes, what it refuses before computing, what it says aloud."""

import json
import os

import imageio.v3
import numpy as np
import pytest

from refgi.cli import view as memory
from refgi.cli.view import read_lights
from refgi.cluster import ValSettings
from refgi.errors import RefgiWarning
from refgi.image import read_exr, read_png_attributes
from refgi.literal import direct, pairs
from refgi.methods import Picture, find_method, render
from refgi.scene import Camera, PointLight, SpotLight, load_scene
from refgi.settings import of
from refgi.splat import SiiSettings
from refgi.vectors.rows import edited
from tests.cli.command import refused_in_a_line as refused
from tests.cli.command import runner
from tests.scene.test_emissive_lamps import room

TINY = ["--size", "12x10", "--rsm-resolution", "16", "--set", "lights=16"]
pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
run = runner("render")


@pytest.fixture
def never_computes(monkeypatch):
    def computing(*_, **__):
        pytest.fail("computed before the arguments were checked")

    monkeypatch.setattr("refgi.methods.render", computing)


@pytest.fixture
def plate(tmp_path):
    """A bare mesh: a floor of two triangles."""
    path = tmp_path / "plate.obj"
    path.write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 3 2\nf 1 4 3\n")
    return path


@pytest.mark.parametrize(("method", "asked", "used"), [
    ("vpl", [], "exact"), ("sii", [], "map"), ("vpl", ["--shadows", "map"], "map"),
    ("sii", ["--shadows", "exact"], "exact"), ("vpl", ["--shadows", "auto"], "exact")])
def test_shadows_are_exact_where_the_method_traces_rays(tmp_path, method, asked, used):
    assert run("cornell_box", *TINY, "--method", method, *asked, "--out", tmp_path / "a.exr").exit_code == 0
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    settings = of(find_method(method).settings, lights=16)
    picture = render(scene, method, settings, shadows=used, rsm_resolution=16)
    channels = read_exr(tmp_path / "a.exr")[0]
    np.testing.assert_array_equal(np.stack([channels[c] for c in "RGB"]), picture.radiance)


def test_an_exr_holds_what_python_computes(tmp_path):
    assert run("cornell_box", *TINY, "--out", tmp_path / "a.exr").exit_code == 0
    channels, attributes = read_exr(tmp_path / "a.exr")
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    picture = render(scene, "sii", of(SiiSettings, lights=16), rsm_resolution=16)
    for index, name in enumerate("RGB"):
        assert np.array_equal(channels[name], picture.radiance[index])
        assert np.array_equal(channels[f"irradiance.{name}"], picture.irradiance[index])
    assert attributes["method"] == "sii"
    assert attributes["settings"]["lights.count"] == 16
    assert attributes["versions"]["numpy"] == np.__version__


def test_a_folder_gets_both_and_a_png_one(tmp_path):
    assert run("cornell_box", *TINY, "--out", tmp_path / "new").exit_code == 0
    assert {p.name for p in (tmp_path / "new").iterdir()} == {"cornell_box_sii.exr", "cornell_box_sii.png"}
    assert run("cornell_box", *TINY, "--out", tmp_path / "a.png", "--exposure", "0.5").exit_code == 0
    assert imageio.v3.imread(tmp_path / "a.png").shape == (10, 12, 3)


@pytest.mark.skipif(os.name == "nt", reason="Windows knows neither name")
@pytest.mark.parametrize(("name", "stem"), [("a:b.obj", "a:b"), ("gr\udcffe.obj", "gr?e"), ("größe 1.obj", "größe 1")])
def test_files_in_a_folder_are_named_like_the_mesh(name, stem, plate, tmp_path):
    assert run(plate.rename(tmp_path / name), *TINY, "--out", tmp_path / "new").exit_code == 0
    assert {p.name for p in (tmp_path / "new").iterdir()} == {f"{stem}_sii.exr", f"{stem}_sii.png"}


def test_json_is_the_only_thing_on_stdout(tmp_path):
    result = run("cornell_box", *TINY, "--set", "clamp=none", "--out", tmp_path / "a.exr", "--json", "--seed",
                 "7")
    content = json.loads(result.stdout)
    assert content["settings"]["lights.seed"] == 7
    assert content["files"] == [str(tmp_path / "a.exr")]
    assert content["non_finite_pixels"] == 0
    assert content["warnings"] == [f"sii: {content['sampling_error']['statement']}; more pixel lights lower it"]
    assert {"rsm.gbuffer", "pairs.sum"} <= {line["name"] for line in content["stages"]}


def test_float64_and_threads(tmp_path):
    one = run("cornell_box", *TINY, "--out", tmp_path / "a.exr", "--dtype", "float64", "--threads", "1", "--json")
    assert json.loads(one.stdout)["dtype"] == "float64"
    assert run("cornell_box", *TINY, "--out", tmp_path / "b.exr", "--dtype", "float64").exit_code == 0
    a, b = (read_exr(tmp_path / name)[0] for name in ("a.exr", "b.exr"))
    assert all(np.array_equal(a[name], b[name]) for name in a)


@pytest.mark.usefixtures("never_computes")
def test_strict_refuses_what_a_mesh_lacks(tmp_path):
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    assert refused(run(mesh, "--strict", "--out", tmp_path / "a.exr"), "line 1: mtllib", "gone.mtl: no such file")


@pytest.mark.usefixtures("never_computes")
@pytest.mark.parametrize(("arguments", "words"), [
    (["cornel_box"], ["did you mean 'cornell_box'"]),
    (["no/such/file.json"], ["no/such/file.json"]), (["a" * 5000], ["expected one of cornell_box"]),
    (["cornell_box", "--method", "sij"], ["method", "sii"]),
    (["cornell_box", "--size", "12x"], ["12x"]), (["cornell_box", "--size", "0x9"], ["'0x9'"]),
    (["cornell_box", "--size", "9x0"], ["'9x0'"]), (["cornell_box", "--size", "99999x9"], ["65536"]),
    (["cornell_box", "--threads", "0"], ["--threads"]),
    (["cornell_box", "--dtype", "float16"], ["float32"]),
    (["cornell_box", "--exposure", "nan"], ["--exposure"]), (["cornell_box", "--exposure", "-1"], ["--exposure"]),
    (["cornell_box", "--eye", "1,2"], ["1,2"]), (["cornell_box", "--eye", "nan,0,0"], ["eye"]),
    (["cornell_box", "--vfov-deg", "180"], ["vfov_deg"]),
    (["cornell_box", "--light", "lamp:x=1"], ["lamp", "spot"]),
    (["cornell_box", "--light", "point:position=0,1,0"], ["intensity", "none"]),
    (["cornell_box", "--light", "point:postion=0,1,0:intensity=1"], ["did you mean 'position'"]),
    (["cornell_box", "--light", "spot:position=0,1,0:target=0,1,0:intensity=1"], ["direction"]),
    (["cornell_box", "--light", "spot:position=0,1,0:target=0,0,0:outer_deg=91:intensity=1"], ["outer_half_angle"]),
    (["cornell_box", "--light", "spot:position=0,1,0:target=0,0,0:falloff=linear:intensity=1"], ["light: falloff"]),
    (["cornell_box", "--light", "point:position=0,1,0:intensity=many"], ["many"]),
    (["cornell_box", "--set", "lights"], ["key=value"]),
])
def test_unusable_options_are_named_before_anything_is_computed(arguments, words, tmp_path):
    assert refused(run(*arguments, "--out", tmp_path / "a.exr"), *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("never_computes")
def test_all_errors_of_a_scene_file_are_told_a_line_each(tmp_path):
    path = tmp_path / "bad.json"
    path.write_text('{"camera": {"eye": [0, 0], "fov": 3}}')
    result = run(path, "--out", tmp_path / "a.exr")
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    assert len(lines) > 2
    assert all(line.startswith(f"refgi: {path}: ") for line in lines)
    assert any("camera.fov" in line for line in lines)


@pytest.mark.usefixtures("never_computes")
def test_all_wrong_settings_are_told_at_once(tmp_path):
    result = run("cornell_box", "--out", tmp_path / "a.exr", "--set", "light=5", "--set", "lights=many", "--set",
                 "pattern=spiral", "--set", "offset=nan")
    assert refused(result, "'light'", "did you mean 'lights'", "'many'", "'spiral'", "offset")


@pytest.mark.usefixtures("never_computes")
@pytest.mark.parametrize("name", ["a.jpg", "file/a.exr", "file/folder/", "a" * 300 + ".png", "a\udcff.exr"])
def test_an_out_that_cannot_be_written_is_refused_before_anything_is_computed(name, tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert refused(run("cornell_box", "--out", f"{tmp_path}/{name}"), "--out")


@pytest.mark.usefixtures("never_computes")
def test_a_size_that_does_not_fit_is_refused_with_both_figures(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 10**9)
    assert refused(run("cornell_box", "--size", "8000x8000", "--out", tmp_path / "a.exr"), "size: 8000x8000",
                   "1,000,000,000 are available")


@pytest.mark.usefixtures("never_computes")
@pytest.mark.parametrize("how", [
    ("maps.resolution=4096", "clusters.count=30"), ("maps.resolution=4096", "clusters.count=1", "terms=64"),
    ("maps.resolution=2048", "clusters.count=40", "behind=dual_paraboloid"), ("pattern=all", "clusters.count=5000"),
    ("maps.resolution=4096", "clusters.count=2", "prefilter=brute"),
], ids=str)
def test_maps_of_area_lights_that_do_not_fit_are_refused(how, tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 2 * 10**9)
    pairs = [text for pair in how for text in ("--set", pair)]
    assert refused(run("cornell_box", "--method", "val", *pairs, "--size", "24x24", "--out", tmp_path / "a.exr"),
                   "for the settings of val", "2,000,000,000 are available")


def test_what_fits_is_not_refused_for_its_maps(monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 10**9)
    scene = load_scene("cornell_box").with_camera(width=24, height=24)
    memory.require_memory(scene, "float32", 512, settings={
        "val": of(ValSettings, maps_resolution=4096, visibility="rays_vpls")})


def test_where_memory_cannot_be_told_nothing_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: None)
    memory.require_memory(load_scene("cornell_box").with_camera(width=65536, height=65536), "float64", 16384)


def test_the_estimate_grows_with_everything():
    scene = load_scene("cornell_box")
    base = memory.needed_bytes(scene, 100, 100)
    assert memory.needed_bytes(scene, 200, 100) > base
    assert memory.needed_bytes(scene, 100, 100, float_bytes=8) > base
    assert memory.needed_bytes(scene, 100, 100, rsm_resolution=1024) > base
    assert memory.needed_bytes(scene, 100, 100, traced=True) > base
    point = scene.with_lights(PointLight((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
    assert memory.needed_bytes(point, 100, 100) > base
    assert (memory.available_bytes() or 1) > 0


def test_camera_and_light_options_replace_the_scenes_own(tmp_path, monkeypatch):
    seen = []

    def spy(scene, *arguments, **options):
        seen.append(scene)
        return render(scene, *arguments, **options)

    monkeypatch.setattr("refgi.methods.render", spy)
    run("cornell_box", *TINY, "--out", tmp_path / "a.png", "--eye", "0,0.3,1.2", "--vfov-deg", "30", "--light",
        "spot:position=0,0.5,0:direction=0,-1,0:inner_deg=20:outer_deg=30:intensity=1,2,3", "--light",
        "point:position=0.1,0.2,0.3:intensity=2")
    scene, = seen
    own = load_scene("cornell_box").camera
    assert scene.camera == Camera((0.0, 0.3, 1.2), own.target, own.up, np.radians(30.0), 12, 10)
    assert scene.lights == (SpotLight((0.0, 0.5, 0.0), (0.0, -1.0, 0.0), np.radians(20.0), np.radians(30.0),
                                      (1.0, 2.0, 3.0)), PointLight((0.1, 0.2, 0.3), (2.0, 2.0, 2.0)))


def test_a_spot_shines_from_its_position_to_its_target():
    light, = read_lights(["spot:position=1,2,3:target=1,0,0:outer_deg=30:intensity=5"])
    assert light.direction == (0.0, -2.0, -3.0)
    assert light.outer_half_angle == pytest.approx(np.radians(30))
    assert light.inner_half_angle == pytest.approx(np.radians(27))
    assert light.falloff == "smoothstep"
    light, = read_lights(["spot:position=1,2,3:target=1,0,0:falloff=squared_ramp:intensity=5"])
    assert light.falloff == "squared_ramp"


def test_a_bare_mesh_gets_a_view_and_says_so(plate, tmp_path):
    result = run(plate, *TINY, "--out", tmp_path / "a.png")
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    assert len([line for line in lines if line.startswith("refgi: warning: ")]) == 1
    assert "camera" in lines[0]


def test_a_bare_mesh_with_camera_and_light_needs_no_warning(plate, tmp_path):
    result = run(plate, *TINY, "--out", tmp_path / "a.png", "--eye", "0,3,3", "--target", "0,0,0", "--light",
                 "directional:direction=0,-1,0:irradiance=3")
    assert result.exit_code == 0
    assert "warning" not in result.stderr


def test_a_camera_that_sees_nothing_is_refused_unless_one_wants_it(tmp_path):
    """A batch may have empty views; else it is a wrong camera, and a black picture would hide that."""
    away = ["cornell_box", *TINY, "--eye", "0,0,50", "--target", "0,0,100", "--out", tmp_path / "new"]
    assert refused(run(*away), "camera: expected a view of some surface", "--allow-empty")
    assert not list(tmp_path.iterdir())
    result = run(*away, "--allow-empty")
    assert result.exit_code == 0
    assert "wholly black: the camera sees no surface" in result.stderr
    assert not any(plane.any() for plane in read_exr(tmp_path / "new" / "cornell_box_sii.exr")[0].values())
    assert run("--again", tmp_path / "new" / "cornell_box_sii.exr").exit_code == 0


def test_a_picture_without_indirect_light_is_said_aloud(plate, tmp_path):
    result = run(plate, *TINY, "--out", tmp_path / "a.png", "--eye", "0,3,3", "--target", "0,0,0", "--light",
                 "directional:direction=0,-1,0:irradiance=3")
    assert "no indirect light" in result.stderr


def test_non_finite_pixels_are_said_aloud_and_fail(tmp_path, monkeypatch):
    def broken(*arguments, **options):
        picture = render(*arguments, **options)
        radiance = picture.radiance.copy()
        radiance[1, 2, 3] = np.nan
        return Picture(picture.frame, picture.irradiance, radiance)

    monkeypatch.setattr("refgi.methods.render", broken)
    result = run("cornell_box", *TINY, "--out", tmp_path)
    assert result.exit_code == 1
    assert "1 pixels of the picture are NaN or infinite" in result.stderr
    assert imageio.v3.imread(tmp_path / "cornell_box_sii.png")[2, 3].tolist() == [255, 0, 255]
    assert np.isnan(read_exr(tmp_path / "cornell_box_sii.exr")[0]["G"][2, 3])


def test_a_warning_is_one_line_and_said_once():
    from refgi.cli.session import Session

    session = Session()
    for _ in range(2):
        session.warn("two\nlines", UserWarning, "file", 1)
    assert session.warnings == ["UserWarning: two lines"]


def test_warnings_that_differ_in_percentages_are_one_with_their_range(capsys):
    from refgi.cli.session import Session

    session = Session()
    for share, other in ((5, 40), (12, 40), (9, 40), (12, 40)):
        session.warn(f"radius 3 takes {share} % of {other} %", RefgiWarning)
    session.warn("radius 4 takes 7 % of 40 %", RefgiWarning)
    assert session.warnings == ["radius 3 takes 5 to 12 % of 40 %", "radius 4 takes 7 % of 40 %"]
    session.result("done", {})
    assert capsys.readouterr().err.splitlines() == [
        "refgi: warning: radius 3 takes 5 % of 40 %", "refgi: warning: radius 4 takes 7 % of 40 %",
        "refgi: warning, over the whole run: radius 3 takes 5 to 12 % of 40 %"]


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


SMALL = ["cornell_box", "--size", "20x15", "--rsm-resolution", "24", "--set"]
SETTINGS = {"sii": ["lights=40"], "hssil": ["samples=12"]}


def rendered(tmp_path, method, engine):
    out = tmp_path / f"{method}-{engine}.exr"
    done = run(*SMALL, *SETTINGS[method], "--method", method, "--engine", engine, "--json", "--out", out)
    assert done.exit_code == 0, done.output
    return read_exr(out)[0], json.loads(done.stdout), out


@pytest.mark.parametrize(("method", "stages"), [
    ("sii", {"pairs.sum", "rsm.direct_irradiance"}), ("hssil", {"sssil.blur", "sssil.upsample"})])
def test_the_picture_is_that_of_the_kernels(tmp_path, method, stages):
    expected, plain, _ = rendered(tmp_path, method, "kernels")
    found, said, _ = rendered(tmp_path, method, "literal")
    assert "literal" not in plain
    assert stages <= {one["stage"] for one in said["literal"]}
    assert all(one["literal"] > 0 for one in said["literal"])
    assert min(expected[name].max() for name in ("R", "irradiance.R")) > 0
    for name, plane in expected.items():
        assert np.abs(found[name] - plane).max() <= 2e-6 * np.abs(plane).max(), name


def test_it_is_the_literal_text_that_ran(tmp_path, monkeypatch):
    right, _, _ = rendered(tmp_path, "sii", "literal")
    doubled = edited(pairs.irradiance, (("flux / np.pi * term", "2 * flux / np.pi * term"),))
    monkeypatch.setattr(pairs, "irradiance", doubled)
    dark = edited(direct.direct_irradiance, (("strength.reshape(3, 1, 1) *", "0 * strength.reshape(3, 1, 1) *"),))
    monkeypatch.setattr(direct, "direct_irradiance", dark)
    wrong, _, _ = rendered(tmp_path, "sii", "literal")
    np.testing.assert_allclose(wrong["irradiance.G"], 2 * right["irradiance.G"], rtol=1e-6)
    direct_light = right["G"] - wrong["G"] / 2
    assert direct_light.max() > 0.1 * right["G"].max()


def test_such_a_picture_is_not_made_again(tmp_path):
    _, _, out = rendered(tmp_path, "sii", "literal")
    done = run("--again", out)
    assert done.exit_code == 2
    assert "made by the literal engine" in done.output
