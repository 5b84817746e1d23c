"""`refgi render --again`: a picture made again to the bit from what its file says, and what stands in the way of it."""

import json
import math
import shutil
from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.image import read_exr, read_png_attributes, write_exr
from refgi.methods import METHODS, render
from refgi.provenance import Job
from refgi.provenance import plain as as_json
from refgi.provenance.frames import SequenceFrame, render_frame
from refgi.scene import load_scene
from refgi.settings import flat, of, replaced
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import HssilSettings, TemporalSettings
from refgi.truth import TruthSettings, trace_truth
from tests.cli.command import TINY, invoke, refused
from tests.literal.whole.temporal import filtered

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
VIEW = ["--eye", "0.278,0.3,-0.7", "--vfov-deg", "43.7", "--light",
        "spot:position=0.278,0.5,-0.2796:target=0.1,0,-0.3:outer_deg=37:intensity=5,4,3",
        "--light", "point:position=0.4,0.3,-0.1:intensity=0.7"]
SETTINGS = {
    "sii": ["lights=24", "pattern=halton", "seed=3"],
    "multires": ["lights=49", "coarsest=8", "normal_threshold=0.3"],
    "val": ["lights=32", "clusters.count=3", "maps.resolution=16", "near_distance=0.35"],
    "hssil": ["samples=8", "levels=3", "radius=none", "depth_sigma=0.03"],
    "gather": ["samples=24", "radius=0.2", "seed=5"],
    "vpl": ["lights=8", "seed=2"],
    "truth": ["samples=72", "light_grid=8", "bound=0.2", "seed=9"],
}
SII = ["--set", "lights=16"]
SINGLE = 1e-6  # of the brightest pixel: blended in float32


def run(*arguments, verb="render"):
    return invoke(verb, *arguments)


def pairs(method):
    return [text for pair in SETTINGS[method] for text in ("--set", pair)]


def made_again(file, *arguments):
    """The file made again under another name, whole: every channel and the record."""
    again = file.with_name(f"again_{file.name}")
    result = run("--again", file, "--out", again, "--json", *arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["again"] == {"file": str(file), "same": True, "differs": []}
    return again.read_bytes()


def rewritten(file, **changes):
    planes, record = read_exr(file)
    write_exr(file, planes, record | changes)


@pytest.fixture
def room(tmp_path):
    """The example's scene file and mesh in a folder of their own."""
    folder = tmp_path / "room"
    shutil.copytree(EXAMPLES, folder)
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    made = tmp_path_factory.mktemp("plain") / "a.exr"
    assert run("cornell_box", *TINY, *SII, "--out", made).exit_code == 0
    return made


@pytest.fixture
def file(plain, tmp_path):
    """A picture that may be changed."""
    return Path(shutil.copy(plain, tmp_path))


def test_the_cases_are_all_methods():
    assert set(SETTINGS) == set(METHODS)


@pytest.mark.parametrize("method", SETTINGS)
def test_every_method_is_made_again_to_the_bit(method, tmp_path):
    file = tmp_path / "a.exr"
    result = run("cornell_box", *TINY, *VIEW, "--method", method, *pairs(method), "--exposure", "2.5", "--out", file)
    assert result.exit_code == 0, result.output
    record = read_exr(file)[1]
    assert set(record["settings"]) == set(flat(METHODS[method].settings()))
    assert read_exr(file)[0]["irradiance.R"].any()
    assert made_again(file) == file.read_bytes()


def test_options_of_the_frame_are_made_again(plain, tmp_path):
    file, options = tmp_path / "b.exr", {"dtype": "float64", "shadows": "exact", "rsm_resolution": 24}
    words = [word for key, value in options.items() for word in (f"--{key.replace('_', '-')}", value)]
    assert run("cornell_box", *TINY, *SII, *words, "--out", file).exit_code == 0
    planes, record = read_exr(file)
    assert record["options"] == options
    assert not np.array_equal(planes["G"], read_exr(plain)[0]["G"])
    assert made_again(file) == file.read_bytes()


def test_a_truth_that_ended_by_its_error_is_made_again_by_its_passes(tmp_path):
    """Also where its record asks for an error that takes more of them."""
    file = tmp_path / "a.exr"
    sets = [text for pair in ("target_error=0.6", "samples=1000000", "light_grid=8") for text in ("--set", pair)]
    assert run("cornell_box", *TINY, "--method", "truth", *sets, "--out", file).exit_code == 0
    record = read_exr(file)[1]
    assert record["settings"]["target_error"] == 0.6
    assert record["estimate"]["passes"] >= 2
    assert made_again(file) == file.read_bytes()
    rewritten(file, settings=record["settings"] | {"target_error": 0.01})
    assert made_again(file)


def test_only_passes_end_a_picture_that_is_made_again():
    """7 passes of 16 picks and 8 directions, and neither clock nor target that could end it before."""
    asked = TruthSettings(seconds=1.0, target_error=0.1, checkpoint="passes.npz", picks=16, directions=8, seed=4)
    again = TruthSettings(samples=7 * 24, picks=16, directions=8, seed=4)
    assert Job(None, "truth", asked, {}, 1.0, passes=7).repeatable == again
    assert Job(None, "sii", asked, {}, 1.0).repeatable is asked


def test_a_checkpoint_is_not_gone_on_from(tmp_path):
    file = tmp_path / "a.exr"
    truth = ["cornell_box", *TINY, "--method", "truth", "--set", "light_grid=8", "--set",
             f"checkpoint={tmp_path / 'passes.npz'}"]
    assert run(*truth, "--set", "samples=48", "--out", file).exit_code == 0
    assert run(*truth, "--set", "samples=96", "--out", tmp_path / "more.exr").exit_code == 0
    assert made_again(file) == file.read_bytes()


@pytest.mark.parametrize("scene", ["cornell_sphere:faces=300", "room.json", "room.obj"])
def test_built_in_scenes_scene_files_and_meshes_with_options(scene, room, monkeypatch):
    monkeypatch.chdir(room)
    view = ["--eye", "0.1,0.5,2", "--target", "0,0.4,0.1", "--light", "point:position=0.2,0.45,0.3:intensity=1,2,3"]
    assert run(scene, *TINY, *SII, *view, "--out", room / "a.exr").exit_code == 0
    record = read_exr(room / "a.exr")[1]["scene"]
    assert record["source"] == scene
    assert set(record["files"]) == {"room.json": {"room.json", "room.obj"}, "room.obj": {"room.obj"}}.get(scene, set())
    assert record["camera"]["eye"] == [0.1, 0.5, 2.0]
    assert record["lights"] == [{"type": "point", "position": [0.2, 0.45, 0.3], "intensity": [1.0, 2.0, 3.0]}]
    assert made_again(room / "a.exr") == (room / "a.exr").read_bytes()


def test_a_mesh_that_got_its_camera_and_light_keeps_them(room, monkeypatch):
    monkeypatch.chdir(room)
    assert "was placed to fit" in run("room.obj", *TINY, *SII, "--out", "a.exr").stderr
    result = run("--again", "a.exr")
    assert result.exit_code == 0
    assert "was placed" not in result.stderr
    assert "the same to the bit" in result.stdout


def test_a_scene_is_found_from_here_above_the_picture_or_where_one_says(room, tmp_path, monkeypatch):
    monkeypatch.chdir(room)
    assert run("room.json", *TINY, *SII, "--out", "out/a.exr").exit_code == 0
    shutil.move(room, tmp_path / "elsewhere")
    monkeypatch.chdir(tmp_path)
    picture = tmp_path / "elsewhere" / "out" / "a.exr"
    assert run("--again", picture).exit_code == 0
    shutil.move(picture, tmp_path / "a.exr")
    assert refused(run("--again", "a.exr"), "a.exr: room.json: not there", "--scene")
    assert run("--again", "a.exr", "--scene", "elsewhere/room.json").exit_code == 0


def test_camera_and_lights_of_a_changed_scene_file_do_not_matter(room, monkeypatch):
    monkeypatch.chdir(room)
    run("room.json", *TINY, *SII, "--out", "a.exr")
    scene = json.loads(Path("room.json").read_text())
    scene["camera"]["vfov_deg"] = 20
    scene["lights"][0]["intensity_w_per_sr"] = [1, 1, 1]
    Path("room.json").write_text(json.dumps(scene))
    assert run("--again", "a.exr").exit_code == 0


def test_a_texture_is_made_again_and_a_changed_image_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    codes = np.full((4, 4, 3), 200, np.uint8)
    imageio.v3.imwrite("wood.png", codes)
    Path("floor.obj").write_text("mtllib floor.mtl\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\n"
                                 "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3 4/4\n")
    Path("floor.mtl").write_text("newmtl wood\nKd 1 1 1\nmap_Kd wood.png\n")
    view = ["--eye", "0,1,2", "--target", "0,0,0", "--light", "point:position=0,1,0:intensity=1,2,3"]
    assert run("floor.obj", *TINY, *SII, *view, "--out", "a.exr").exit_code == 0
    assert made_again(Path("a.exr")) == Path("a.exr").read_bytes()
    codes[3, 3] = 201
    imageio.v3.imwrite("wood.png", codes)
    assert refused(run("--again", "a.exr"), "got other materials (changed: wood.png)")


def test_a_scene_of_other_content_is_refused_by_what_changed(room, monkeypatch):
    monkeypatch.chdir(room)
    run("room.json", *TINY, *SII, "--out", "a.exr")
    text = Path("room.json").read_text()
    Path("room.json").write_text(text.replace("[0.6, 0.06, 0.05]", "[0.6, 0.06, 0.06]"))
    assert refused(run("--again", "a.exr"), "got other materials (changed: room.json)")
    Path("room.json").write_text(text)
    mesh = Path("room.obj").read_text()
    Path("room.obj").write_text(mesh.replace("v -2 0 2", "v -2 0 2.001", 1))
    result = run("--again", "a.exr", "--json")
    told = json.loads(result.stdout)["error"]
    assert "got other geometry (changed: room.obj)" in told["message"]
    assert (told["file"], told["key"]) == ("a.exr", "scene")


def test_what_is_no_picture_of_refgi_is_refused_by_name(tmp_path):
    import OpenEXR

    plane = np.ones((2, 2), np.float32)
    foreign, bare, damaged, newer = (tmp_path / f"{name}.exr" for name in ("foreign", "bare", "damaged", "newer"))
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"R": plane}).write(str(foreign))
    write_exr(bare, {"R": plane}, {"n": 1})
    write_exr(newer, {"R": plane}, {"provenance": 3, "method": "sii"})
    damaged.write_bytes(newer.read_bytes()[:-20])
    assert refused(run("--again", foreign), "foreign.exr", "refgi wrote", "another program's")
    assert refused(run("--again", bare), "bare.exr", "the record of how a picture was made")
    assert refused(run("--again", damaged), "damaged.exr")
    assert refused(run("--again", newer), "newer.exr: provenance", "version 2", "3")
    assert refused(run("--again", tmp_path / "none.exr"), "none.exr")


def test_another_version_is_warned_of_and_a_setting_it_does_not_know_refused(file):
    record = read_exr(file)[1]
    rewritten(file, refgi={"version": "0.0.1", "git": "abc"}, versions=record["versions"] | {"numpy": "1.9"})
    result = run("--again", file)
    assert result.exit_code == 0
    for word in ("made by refgi 0.0.1", "git abc", "numpy 1.9", "bits may differ"):
        assert word in result.stderr
    rewritten(file, settings=record["settings"] | {"sparkle": 1})
    assert refused(run("--again", file), "SiiSettings", "sparkle")
    rewritten(file, settings=record["settings"] | {"lights": "many"})
    assert refused(run("--again", file), "SiiSettings")
    rewritten(file, settings=record["settings"], options={})
    assert refused(run("--again", file), "options.dtype: Field required", "options.rsm_resolution: Field required")


@pytest.mark.parametrize(("changes", "words"), [
    ({"sparkle": 1}, "sparkle: Extra inputs are not permitted"),
    ({"provenance": 1}, "expected version 2 of the record, got 1"),
    ({"exposure": -1}, "exposure: Input should be greater than 0"),
    ({"method": ["sii"]}, "method: Input should be a valid string"),
    ({"method": "magic"}, "magic"),
    ({"versions": []}, "versions: Input should be a valid dictionary"),
    ({"refgi": {}}, "refgi.version: Field required"),
    ({"frames": 0}, "frames: Input should be greater than or equal to 1"),
    ({"frames": 2, "temporal": None}, "a whole record"),
    ({"estimate": {"passes": 1e30}}, "estimate.passes"),
    ({"options": {"dtype": "int8", "rsm_resolution": 16}}, "options.dtype"),
])
def test_a_record_of_other_keys_or_kinds_is_an_input_error(file, changes, words):
    rewritten(file, **changes)
    assert refused(run("--again", file), words)


@pytest.mark.parametrize("changes", [
    {"options": {"dtype": "float32", "rsm_resolution": 65536}}, {"camera": {"width": 65536, "height": 65536}},
    {"source": "cornell_sphere:faces=100000000000"}])
def test_sizes_of_a_record_are_judged_before_they_are_made(file, changes):
    record = read_exr(file)[1]
    if "camera" in changes:
        changes = {"scene": record["scene"] | {"camera": record["scene"]["camera"] | changes["camera"]}}
    elif "source" in changes:
        changes = {"scene": record["scene"] | changes}
    rewritten(file, **changes)
    result = run("--again", file)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert "needs about" in result.stderr or "faces" in result.stderr


@pytest.mark.parametrize("bounded", [True, False])
def test_a_stranger_s_record_writes_to_out_alone(tmp_path, bounded):
    file, ours = tmp_path / "a.exr", tmp_path / "ours" / "notes.truth"
    ours.parent.mkdir()
    run("cornell_box", *TINY, "--method", "truth", "--set", "light_grid=8", "--set", "samples=48", "--out", file)
    record = read_exr(file)[1]
    estimate = record["estimate"] if bounded else {key: value for key, value in record["estimate"].items()
                                                   if key != "passes"}
    rewritten(file, settings=record["settings"] | {"checkpoint": str(ours)}, estimate=estimate)
    result = run("--again", file, "--out", tmp_path / "b.exr")
    assert result.exit_code == 0, result.output
    assert f"checkpoint '{ours}': neither read nor written" in result.stderr
    assert list(ours.parent.iterdir()) == []


def test_pixels_that_are_not_the_same_are_told_and_fail(file):
    planes, record = read_exr(file)
    planes["G"][3, 4] = np.nextafter(planes["G"][3, 4], np.float32(9))
    write_exr(file, planes, record)
    result = run("--again", file, "--json")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["again"]["differs"] == ["G in 1 of 120 pixels"]
    assert "other: G in 1 of 120 pixels" in run("--again", file).stdout


@pytest.mark.parametrize(("arguments", "words"), [
    (["cornell_box", "--again", "a.exr"], ["takes no SCENE"]),
    (["--again", "a.exr", "--set", "lights=3", "--method", "val"], ["--set", "--method"]),
    (["--again", "a.exr", "--size", "3"], ["--size"]), (["cornell_box", "--scene", "x", "--out", "a.exr"], ["--scene"]),
])
def test_a_picture_is_made_again_as_it_was(arguments, words):
    assert refused(run(*arguments), *words)


@pytest.mark.slow
def test_pictures_of_a_comparison_are_made_again(tmp_path):
    out = tmp_path / "out"
    result = run("cornell_box", *TINY, "--methods", "sii,vpl", "--set", "sii.lights=16", "--set", "vpl.lights=8",
                 "--set", "truth.samples=48", "--out", out, verb="compare")
    assert result.exit_code == 0, result.output
    for name in ("truth", "unoccluded"):
        assert made_again(out / f"{name}.exr") == (out / f"{name}.exr").read_bytes()
    for name in ("sii", "vpl"):  # a comparison judges by the truth; a picture by itself states its sampling error
        made_again(out / f"{name}.exr")
        record = read_exr(out / f"again_{name}.exr")[1]
        assert record.pop("sampling_error")["samples"] == {"sii": 16, "vpl": 8}[name]
        assert record == read_exr(out / f"{name}.exr")[1]
    record, content = read_exr(out / "sii.exr")[1], json.loads((out / "results.json").read_text())
    shared = content["provenance"]
    assert {key: record[key] for key in shared} == shared
    assert record["settings"] == content["methods"]["sii"]["settings"]
    assert read_png_attributes(out / "sii.png") == record
    assert content["refgi"] == record["refgi"]


STILL = ["--frames", "3", "--temporal", "weight=0.6"]
HSSIL = ["samples=8", "levels=3", "radius=none", "seed=4"]


def still(scene, seed, temporal):
    """Light of three frames of other random numbers, assembled by hand from those of each alone."""
    frames = [Frame(scene, rsm_resolution=16) for _ in range(3)]
    settings = of(HssilSettings, samples=8, levels=3, radius=None)
    lights = [hssil(frame, replaced(settings, {"seed": seed + k})) for k, frame in enumerate(frames)]
    return filtered(frames, [light.astype(float) for light in lights], temporal)[-1]


def test_frames_of_a_resting_scene_are_blended_and_made_again(tmp_path):
    sets = [text for pair in HSSIL for text in ("--set", pair)]
    result = run("cornell_box", *TINY, "--method", "hssil", *sets, *STILL, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    channels, record = read_exr(tmp_path / "cornell_box_hssil.exr")
    light = np.stack([channels[f"irradiance.{c}"] for c in "RGB"])
    expected = still(load_scene("cornell_box").with_camera(width=12, height=10), 4, TemporalSettings(weight=0.6))
    assert np.abs(light - expected).max() < SINGLE * expected.max()
    assert record["frames"] == 3
    assert record["temporal"] == as_json(TemporalSettings(weight=0.6))
    assert channels["frames"].max() == 3
    assert read_png_attributes(tmp_path / "cornell_box_hssil.png") == record
    assert made_again(tmp_path / "cornell_box_hssil.exr") == (tmp_path / "cornell_box_hssil.exr").read_bytes()


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of few samples: tests/test_diagnostics
def test_a_comparison_blends_frames_of_methods_with_a_filter(tmp_path):
    sets = [text for pair in HSSIL for text in ("--set", f"hssil.{pair}")]
    result = run("cornell_box", *TINY, "--methods", "sii,hssil", *sets, "--set", "sii.lights=16", "--set",
                 "truth.samples=48", *STILL, "--json", "--out", tmp_path / "out", verb="compare")
    assert result.exit_code == 0, result.output
    channels, record = read_exr(tmp_path / "out" / "hssil.exr")
    light = np.stack([channels[f"irradiance.{c}"] for c in "RGB"])
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    alone = [render(scene, "hssil", of(HssilSettings, samples=8, levels=3, radius=None, seed=4 + k), shadows="exact",
                    rsm_resolution=16).irradiance for k in range(3)]
    expected = alone[0]
    for new, a in zip(alone[1:], (0.5, 0.6), strict=True):  # min(a, n / (n + 1))
        expected = a * expected + (1 - a) * new
    assert np.abs(light - expected).max() < SINGLE * expected.max()
    assert record["frames"] == 3
    assert "frames" not in read_exr(tmp_path / "out" / "sii.exr")[1]
    assert made_again(tmp_path / "out" / "hssil.exr") == (tmp_path / "out" / "hssil.exr").read_bytes()


@pytest.mark.parametrize(("verb", "arguments", "words"), [
    ("render", ["--method", "sii", "--frames", "3", "--out", "a.exr"], ["frames", "temporal filter (hssil)", "sii"]),
    ("render", ["--method", "hssil", "--temporal", "weight=0.3", "--out", "a.exr"], ["--temporal", "--frames"]),
    ("render", ["--method", "hssil", "--frames", "0", "--out", "a.exr"], ["--frames"]),
    ("render", ["--method", "hssil", "--frames", "2", "--temporal", "wait=1", "--out", "a.exr"], ["wait"]),
    ("compare", ["--methods", "sii,gather", "--frames", "3"], ["frames", "temporal filter (hssil)", "sii, gather"]),
])
def test_frames_that_no_method_blends_are_refused(verb, arguments, words):
    assert refused(run("cornell_box", *TINY, *arguments, verb=verb), *words)


@pytest.mark.parametrize("settings", [{"seconds": 0.5}, {"checkpoint": "passes"}], ids=lambda pair: next(iter(pair)))
def test_a_frame_that_would_not_repeat_is_not_made_again(settings):
    """Frames of earlier versions may say so."""
    with pytest.raises(InputError, match="expected none, as") as caught:
        render_frame(load_scene("cornell_box"), "truth", TruthSettings(**settings),
                     SequenceFrame(0, 1, "no_such.toml", None), {})
    assert caught.value.key in settings


@pytest.mark.parametrize("temporal", [False, True])
def test_frames_of_truth_hold_how_sure_they_are_unless_blended(temporal, room, monkeypatch):
    """Seed 9 + 1 in the second frame: what `render` gives of the frame's camera by that seed."""
    monkeypatch.chdir(room)
    Path("still.toml").write_text("frames = 2\ncamera = [{at = 0.0, vfov_deg = 30.0}]")
    sets = ["--method", "truth", "--set", "samples=72", "--set", "light_grid=8", "--seed"]
    filtered = ["--temporal", "weight=0.5"] if temporal else []
    result = run("room.json", "still.toml", *TINY, *sets, 9, *filtered, "--out", "frames", verb="sequence")
    assert result.exit_code == 0, result.output
    assert run("room.json", *TINY, "--vfov-deg", 30, *sets, 10, "--out", "alone.exr").exit_code == 0
    frame, alone = Path("frames", "still_00001.exr"), Path("alone.exr")
    planes, record = read_exr(frame)
    expected, its = read_exr(alone)
    if temporal:
        alone = expected.keys() - {"variance.R", "variance.G", "variance.B", "samples"}
        assert planes.keys() == alone | {"frames"}
        assert "estimate" not in record
    else:
        assert planes.keys() == expected.keys()
        assert all(np.array_equal(planes[name], expected[name]) for name in planes)
        assert planes["variance.R"].any()
        assert record["estimate"] == its["estimate"] == read_png_attributes(frame.with_suffix(".png"))["estimate"]
    assert made_again(frame) == frame.read_bytes()
    resumed = run("room.json", "still.toml", *TINY, *sets, 9, *filtered, "--out", "frames", "--resume", verb="sequence")
    assert "0 of 2 frames rendered" in resumed.stdout, resumed.output


@pytest.mark.parametrize("temporal", [["--temporal", "weight=0.5"], ["--no-temporal"]], ids=str)
def test_a_frame_of_a_sequence_is_made_again(temporal, room, monkeypatch):
    monkeypatch.chdir(room)
    result = run("room.json", "path.toml", *TINY, "--method", "sii", *SII, *temporal, "--frames", "3", "--format",
                 "exr", "--out", "frames", verb="sequence")
    assert result.exit_code == 0, result.output
    last = room / "frames" / "path_00002.exr"
    record = read_exr(last)[1]
    assert record["at_frame"]["camera"]["eye"] == [0.6, 1.5, 5.5]
    assert record["at_frame"]["lights"][0]["direction"] == [2.4, -1.8, -1.0]
    assert record["path"]["source"] == "path.toml"
    assert made_again(last) == last.read_bytes()
    Path("path.toml").write_text("frames = 3\ncamera = [{at = 0.0, vfov_deg = 30.0}]")
    assert refused(run("--again", last), "path.toml: expected the path of the sequence")


def test_the_record_says_everything(tmp_path):
    """By hand: the light and camera of the options, in rad, and the settings that nobody gave."""
    file = tmp_path / "a.exr"
    run("cornell_box", *TINY, *SII, *VIEW, "--seed", "7", "--exposure", "0.5", "--out", file)
    record = read_exr(file)[1]
    assert (record["provenance"], record["method"], record["exposure"]) == (2, "sii", 0.5)
    assert record["options"] == {"dtype": "float32", "rsm_resolution": 16, "shadows": "map"}
    assert (record["settings"]["lights.count"], record["settings"]["lights.seed"]) == (16, 7)
    scene = record["scene"]
    assert (scene["source"], scene["faces"], scene["files"]) == ("cornell_box", 30, {})
    assert (scene["camera"]["width"], scene["camera"]["height"]) == (12, 10)
    assert scene["camera"]["vfov"] == math.radians(43.7)
    spot, point = scene["lights"]
    assert spot["type"] == "spot"
    assert (spot["outer_half_angle"], spot["intensity"]) == (math.radians(37), [5.0, 4.0, 3.0])
    assert point == {"type": "point", "position": [0.4, 0.3, -0.1], "intensity": [0.7, 0.7, 0.7]}
    assert {len(scene["geometry_sha256"]), len(scene["materials_sha256"])} == {64}


def test_a_truth_writes_its_variance_and_the_error_of_the_picture(tmp_path):
    """Against `trace_truth`: the variance of the mean, and the picture's own mean and standard error."""
    file = tmp_path / "a.exr"
    result = run("cornell_box", *TINY, "--method", "truth", "--set", "samples=48", "--set", "light_grid=8", "--json",
                 "--out", file)
    channels, record = read_exr(file)
    scene = load_scene("cornell_box").with_camera(width=12, height=10)
    own = trace_truth(Frame(scene, rsm_resolution=16), TruthSettings(samples=48, light_grid=8))
    for index, name in enumerate("RGB"):
        assert np.array_equal(channels[f"variance.{name}"], own.variance_of_mean[index].astype(np.float32))
    assert np.array_equal(channels["samples"], own.samples.astype(np.float32))
    estimate = json.loads(result.stdout)["estimate"]
    assert estimate == record["estimate"]
    assert estimate["passes"] == own.passes
    assert estimate["picture_mean"] == own.picture_mean.tolist()
    assert estimate["picture_standard_error"] == np.sqrt(own.picture_variance).tolist()
    assert {name: estimate[name] for name in own.errors} == own.errors
    again = run("--again", file)
    assert again.stdout.splitlines()[1] == own.error_statement
