"""`refgi sequence`: the frames it writes, how it goes on after an interruption, what it refuses before computing."""

import dataclasses
import json
import re

import imageio.v3
import numpy as np
import OpenEXR
import pytest

from refgi.image import read_exr
from refgi.methods import find_method, render
from refgi.scene import load_scene
from refgi.scene.path import scenes_along
from refgi.scene.pathfile import read_path
from refgi.settings import of
from refgi.splat import SiiSettings
from refgi.splat.sii.sii import sii
from refgi.sssil import PRESETS
from refgi.sssil.temporal import Sequence, TemporalSettings
from tests.cli.command import TINY, refused, runner

PATH = """
frames = 4
objects = [{material = "red", keys = [{at = 0.0}, {at = 1.0, move = [0.02, 0.0, 0.0]}]}]
camera = [{at = 0.0, eye = [0.278, 0.273, -0.8]}, {at = 1.0, eye = [0.3, 0.28, -0.8]}]
"""
pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
# a method that compiles fast and draws random numbers
SII = ["--method", "sii", "--set", "lights=16", "--temporal", "weight=0.5"]
run = runner("sequence")


@pytest.fixture
def way(tmp_path):
    path = tmp_path / "way.toml"
    path.write_text(PATH)
    return path


def lights(folder, numbers):
    channels = [read_exr(folder / f"way_{number:05d}.exr")[0] for number in numbers]
    return [np.stack([own[f"irradiance.{c}"] for c in "RGB"]) for own in channels]


def test_frames_are_what_python_computes(way, tmp_path):
    result = run("cornell_box", way, *TINY, *SII, "--out", tmp_path / "new", "--json", "--seed", "7")
    assert result.exit_code == 0, result.output
    assert {p.name for p in (tmp_path / "new").iterdir()} == {f"way_{i:05d}.{k}" for i in range(4) for k in
                                                              ("exr", "png")}
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    path, frames = read_path(way, scene)
    steps = Sequence(scenes_along(scene, path, frames), of(SiiSettings, lights=16, seed=7),
                     TemporalSettings(weight=0.5), method=sii, rsm_resolution=16)
    told = json.loads(result.stdout)
    assert told["temporal"]["weight"] == 0.5
    for number, (step, light) in enumerate(zip(steps, lights(tmp_path / "new", range(4)), strict=True)):
        assert np.array_equal(light, step.irradiance)
        assert told["frames"][number]["reused"] == step.reused
    assert imageio.v3.imread(tmp_path / "new" / "way_00003.png").shape == (10, 12, 3)
    attributes = read_exr(tmp_path / "new" / "way_00003.exr")[1]
    assert (attributes["frame"], attributes["of"], attributes["settings"]["lights.count"]) == (3, 4, 16)


@pytest.mark.parametrize(("method", "asked", "used"), [("vpl", [], "exact"), ("vpl", ["--shadows", "map"], "map")])
def test_frames_have_exact_shadows_where_the_method_traces_rays(way, tmp_path, method, asked, used):
    result = run("cornell_box", way, *TINY, "--method", method, "--set", "lights=4", *asked, "--frames", 1, "--format",
                 "exr", "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["shadows"] == used
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    settings = of(find_method(method).settings, lights=4)
    picture = render(scene, method, settings, shadows=used, rsm_resolution=16)
    radiance = read_exr(tmp_path / "out" / "way_00000.exr")[0]
    np.testing.assert_array_equal(np.stack([radiance[c] for c in "RGB"]), picture.radiance)


@pytest.mark.parametrize("filtering", ["form=recursive", "form=printed", "weight=0.9"])
def test_an_interrupted_sequence_goes_on_to_the_bit(way, tmp_path, filtering):
    """With a weight of 0.9 three frames are still warming up: how many there were is in the files."""
    arguments = ["cornell_box", way, *TINY, *SII, "--temporal", filtering, "--format", "exr", "--out",
                 tmp_path / "out"]
    assert run(*arguments).exit_code == 0
    whole = lights(tmp_path / "out", range(4))
    (tmp_path / "out" / "way_00002.exr").unlink()
    last = tmp_path / "out" / "way_00003.exr"
    last.write_bytes(last.read_bytes()[:-40])  # cut short, and still known by its header to be refgi's
    result = run(*arguments, "--resume")
    assert result.exit_code == 0, result.output
    assert "2 of 4 frames rendered" in result.stdout
    assert all(map(np.array_equal, whole, lights(tmp_path / "out", range(4))))
    assert "0 of 4 frames rendered" in run(*arguments, "--resume").stdout
    assert refused(run(*arguments, "--resume", "--set", "lights=32"), "way_00000.exr", "one of other settings",
                   "(settings.lights.count)")


@pytest.mark.parametrize("left", [b"", b"\x76\x2f\x31\x01", bytes(500)], ids=["empty", "cut", "zeros"])
def test_a_frame_whose_header_is_damaged_is_rendered_again_on_resuming(way, tmp_path, left):
    arguments = ["cornell_box", way, *TINY, *SII, "--out", tmp_path / "out"]
    assert run(*arguments).exit_code == 0
    whole = lights(tmp_path / "out", range(4))
    damaged = tmp_path / "out" / "way_00002.exr"
    damaged.write_bytes(left)
    assert refused(run(*arguments), "way_00002.exr is there and not from refgi", "--force")
    assert damaged.read_bytes() == left
    result = run(*arguments, "--resume")
    assert result.exit_code == 0, result.output
    assert "2 of 4 frames rendered" in result.stdout
    assert all(map(np.array_equal, whole, lights(tmp_path / "out", range(4))))


def test_files_of_other_programs_are_not_taken_for_damaged_frames(way, tmp_path):
    arguments = ["cornell_box", way, *TINY, *SII, "--out", tmp_path / "out", "--resume"]
    (tmp_path / "out").mkdir()
    foreign = tmp_path / "out" / "way_00001.exr"
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
                      {"Y": np.ones((10, 12), np.float32)}) as file:
        file.write(str(foreign))
    assert refused(run(*arguments), "way_00001.exr is there and not from refgi")
    foreign.unlink()
    (tmp_path / "out" / "way_00001.png").write_text("precious")
    assert refused(run(*arguments), "way_00001.png is there and not from refgi")


def test_frames_without_their_png_are_rendered_again(way, tmp_path):
    arguments = ["cornell_box", way, *TINY, *SII, "--out", tmp_path / "out"]
    assert run(*arguments, "--format", "exr", "--frames", "2").exit_code == 0
    before = lights(tmp_path / "out", range(2))
    assert "2 of 2 frames rendered" in run(*arguments, "--frames", "2", "--resume").stdout
    assert all(map(np.array_equal, before, lights(tmp_path / "out", range(2))))
    (tmp_path / "out" / "way_00001.png").unlink()
    assert "1 of 2 frames rendered" in run(*arguments, "--frames", "2", "--resume").stdout
    assert (tmp_path / "out" / "way_00001.png").exists()


def test_frames_of_other_shapes_are_not_gone_on_from(tmp_path):
    still = tmp_path / "way.toml"
    still.write_text("frames = 2\ncamera = [{at = 0.0, vfov_deg = 30.0}]")
    arguments = [still, *TINY, "--method", "sii", "--set", "lights=16", "--out", tmp_path / "out"]
    assert run("metaballs:t=0.1,resolution=8", *arguments).exit_code == 0
    (tmp_path / "out" / "way_00001.exr").unlink()
    result = run("metaballs:t=0.100001,resolution=8", *arguments, "--resume")
    assert refused(result, "way_00000.exr", "one of other settings")


def test_another_method_is_not_filtered_unless_asked(way, tmp_path):
    plain = [*TINY, "--method", "sii", "--set", "lights=16", "--format", "exr", "--json"]
    assert json.loads(run("cornell_box", way, *plain, "--out", tmp_path).stdout)["temporal"] is None
    told = json.loads(run("cornell_box", way, *plain, "--temporal", "weight=0.25", "--frames", "1", "--out",
                          tmp_path).stdout)
    assert told["temporal"]["weight"] == 0.25
    assert len(told["frames"]) == 1


@pytest.mark.feature("HSS-13")
def test_the_papers_filter_goes_by_the_cameras_speed(way, tmp_path):
    """New pixels of the preset have an a by the camera's speed, and its first frames are as all others (Sec. 3.3)."""
    asked = [*TINY, "--method", "hssil", "--preset", "paper", "--frames", "2", "--json", "--out", tmp_path]
    told = json.loads(run("cornell_box", way, *asked, "--temporal", "weight=0.6").stdout)
    expected = TemporalSettings(weight=0.6, warm_up=False, entering_speed=16.0)
    assert told["temporal"] == dataclasses.asdict(expected)
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    along = scenes_along(scene, read_path(way, scene)[0], 2)
    for step, light in zip(Sequence(along, PRESETS["paper"], expected, rsm_resolution=16),
                           lights(tmp_path, range(2)), strict=True):
        assert np.array_equal(light, step.irradiance)


@pytest.mark.parametrize(("arguments", "words"), [
    (["--temporal", "weight=2"], ["weight: expected a number, 0 to 0.9999"]),
    (["--temporal", "wieght=0.5"], ["is not a setting of TemporalSettings", "weight"]),
    (["--temporal", "weight=0.5", "--no-temporal"], ["--no-temporal"]),
    (["--set", "samplse=3"], ["samples"]),
    (["--resume", "--format", "png"], ["--resume"]),
    (["--method", "truth", "--set", "seconds=0.7"], ["seconds: expected none", "say samples", "got 0.7"]),
    (["--method", "truth", "--set", "checkpoint=ck"], ["checkpoint: expected none", "got 'ck'"]),
    (["--exposure", "0"], ["--exposure"]),
    (["--method", "nothing"], ["method: expected one of"]),
])
def test_what_is_refused_before_anything_is_computed(way, tmp_path, arguments, words):
    assert refused(run("cornell_box", way, *TINY, *arguments, "--out", tmp_path / "out"), *words)
    assert not list(tmp_path.glob("out/*"))


def test_all_faults_of_a_path_are_told_in_a_line_each(way, tmp_path):
    way.write_text('frames = 0\ncurve = "straight"\nlights = [{keys = []}]')
    result = run("cornell_box", way, *TINY, "--out", tmp_path / "out")
    assert refused(result, "frames: ", "curve: ", "lights[0].keys: ")
    assert result.stderr.count("\n") == 3


def test_how_many_frames_must_be_said(way, tmp_path):
    way.write_text("camera = [{at = 0.0, vfov_deg = 30.0}]")
    assert refused(run("cornell_box", way, *TINY, "--out", tmp_path / "out"), "--frames", "how many")


def test_hssil_renders_and_filters(way, tmp_path):
    result = run("cornell_box", way, *TINY, "--set", "radius=none", "--frames", "2", "--out", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["method"] == "hssil"
    assert told["temporal"]["weight"] == 0.9
    assert told["frames"][1]["reused"] > 0.8
    assert told["frames"][1]["mean_indirect_irradiance"] > 0


def test_a_sequence_that_sees_nothing_is_refused_unless_one_wants_it(way, tmp_path):
    way.write_text("frames = 4\ncamera = [{at = 0.0, target = [0.0, 0.0, -99.0]}]")
    arguments = ["cornell_box", way, *TINY, *SII, "--format", "exr", "--out", tmp_path / "out"]
    assert refused(run(*arguments), "camera: expected a view of some surface", "--allow-empty")
    assert not (tmp_path / "out").exists()
    result = run(*arguments, "--allow-empty", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["warnings"] == ["frames 0-3 of 4 see no surface"]
    assert [frame["covered_pixels"] for frame in told["frames"]] == [0] * 4
    assert not any(light.any() for light in lights(tmp_path / "out", range(4)))


def test_frames_that_see_nothing_are_told_in_one_warning(way, tmp_path):
    """The camera looks at the box in the second frame alone."""
    way.write_text("""frames = 5
camera = [{at = 0.0, eye = [0.0, 0.0, 50.0], target = [0.0, 0.0, 100.0]},
          {at = 0.25, eye = [0.278, 0.273, -0.8], target = [0.278, 0.273, 0.0]},
          {at = 0.5, eye = [0.0, 0.0, 50.0], target = [0.0, 0.0, 100.0]},
          {at = 1.0, eye = [0.0, 0.0, 50.0], target = [0.0, 0.0, 100.0]}]
""")
    result = run("cornell_box", way, *TINY, *SII, "--format", "exr", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    warned = [line for line in result.stderr.splitlines() if "no surface" in line]
    assert warned == ["refgi: warning: frames 0, 2-4 of 5 see no surface"]


def test_a_loss_that_changes_along_the_path_is_warned_of_once(way, tmp_path):
    """The gathering radius takes another share in each of these views."""
    way.write_text(PATH.replace("[0.3, 0.28, -0.8]", "[0.4, 0.28, -0.8]"))
    result = run("cornell_box", way, "--size", "16x12", "--rsm-resolution", "64", "--method", "gather", "--format",
                 "exr", "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    (warning,) = json.loads(result.stdout)["warnings"]
    assert re.fullmatch(r"gather: disc\.radius .* takes \d+ to \d+ % of the indirect light", warning)
    assert result.stderr.count("refgi: warning: ") == 1
    assert result.stderr.count("refgi: warning, over the whole run: ") == 1
