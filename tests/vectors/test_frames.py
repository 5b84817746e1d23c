"""A frame of a sequence as a kit: the literal text is a port of it, a wrong step of its filter is named."""

from itertools import islice

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.diagnostics import diagnosing
from refgi.errors import InputError
from refgi.methods import find_method
from refgi.scene import load_scene
from refgi.scene.path import scenes_along
from refgi.scene.pathfile import read_path
from refgi.settings import of, replaced
from refgi.sssil.settings import HssilSettings, TemporalSettings
from refgi.sssil.temporal import Sequence
from refgi.testing import stages
from refgi.vectors.bounds import large_value
from refgi.vectors.check import ALL_WITHIN, Asked, check_output
from refgi.vectors.frames import frame_case
from refgi.vectors.kit import Kit
from refgi.vectors.spec import expected_of, outputs_of, stored
from tests.vectors.literal_port import written

PATH = """
frames = 5
[[camera]]
at = 0.0
eye = [0.278, 0.273, -0.2]
[[camera]]
at = 1.0
eye = [0.238, 0.313, -0.4]
target = [0.298, 0.273, 0.0]
[[objects]]
faces = [10, 20]
keys = [{at = 0.0}, {at = 1.0, move = [0.1, 0.0, 0.1], turn_deg = 20.0}]
"""
SIZE, NUMBER = {"width": 32, "height": 24, "rsm_resolution": 16}, 3
SETTINGS = {"samples": 8, "radius": 3.0, "levels": 2, "downsample": "closest"}  # no sender is drawn by chance
FILTER = {"clamp": 1.0, "clamp_radius": 2, "entering_speed": 6.0}
CHAIN = 2e-5  # of large values: as of the kit's own cases (test_hssil_stages)
FLIPPED = 0.05  # of elements: slopes of flat walls, of which float32 decides the smaller one in upsampling
STEPS = {"sssil.motion", "sssil.reprojection", "sssil.entering", "sssil.clamp", "sssil.blend"}


def export(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), ["vectors", "export", *map(str, arguments)])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("path") / "path.toml"
    file.write_text(PATH)
    return file


@pytest.fixture(scope="module")
def scenes(path):
    scene = load_scene("cornell_box")
    way, count = read_path(path, scene)
    return [*islice(scenes_along(scene, way, count), NUMBER + 1)]


@pytest.fixture(scope="module")
def case(scenes):
    return frame_case("hssil-cornell_box", scenes, "hssil", of(HssilSettings, **SETTINGS),
                      of(TemporalSettings, **FILTER), **SIZE)


@pytest.fixture(scope="module")
def kit(path, tmp_path_factory):
    """Return the kit that the command line makes of the same frame."""
    out = tmp_path_factory.mktemp("frames") / "kit"
    pairs = [one for option, some in (("--set", SETTINGS), ("--temporal", FILTER)) for key, value in some.items()
             for one in (option, f"{key}={value}")]
    done = export("cornell_box", "--method", "hssil", "--frames", path, "--frame", NUMBER, "--size", "32x24",
                  "--rsm-resolution", 16, *pairs, "--out", out)
    assert done.exit_code == 0, done.output
    assert f"frame {NUMBER} of 0 to 4" in done.stdout
    return Kit(out)


@pytest.fixture
def port(kit, case, tmp_path):
    """Return what writes a port's arrays, by the literal text where a stage has one, with some changed; and judges."""
    def judged(*, chained=False, wrong=None, stage=""):
        own = {name: stored(array) for name, array in case.given.items()}
        known = {name: kit.array(next(iter(kit.cases(Asked()))), name) for name in case.specs}
        (tmp_path / case.id).mkdir(exist_ok=True)
        for step in case.stages:
            read = own if chained else known
            made = written(step, read) or outputs_of(step, read, np.float32)
            made |= wrong(step, made, read) if step.name == stage else {}
            own |= {name: stored(array) for name, array in made.items()}
            for name in step.writes:
                np.save(tmp_path / case.id / f"{name}.npy", own[name])
        return check_output(kit, tmp_path, Asked(chained=chained))

    return judged


@pytest.mark.feature("REF-33")
def test_the_kit_of_a_path_is_its_frame_after_those_before(kit, case, scenes):
    manifest, = kit.cases(Asked())
    known = expected_of(case)
    assert manifest.arrays.keys() == known.keys()
    for name, array in known.items():
        np.testing.assert_array_equal(kit.array(manifest, name), array)
    with diagnosing(False):
        *_, before, _ = Sequence(scenes, of(HssilSettings, **SETTINGS), of(TemporalSettings, **FILTER),
                                 dtype=np.float64, **SIZE)
        *_, another, alone = Sequence(scenes, of(HssilSettings, **SETTINGS), None, dtype=np.float64, **SIZE)
    np.testing.assert_array_equal(known["sssil.reprojection.irradiance"], stored(before.irradiance))
    light = known[case.stages[[step.name for step in case.stages].index("sssil.blend")].reads[0]]
    off, other = ((np.abs(light - one.irradiance) > CHAIN * large_value(light)).mean() for one in (alone, another))
    assert off <= FLIPPED < 0.5 < other
    assert {step.name for step in case.stages} >= STEPS
    assert known["sssil.motion.speed"].any()
    assert known["sssil.entering.share"].any()
    assert manifest.scene is not None


@pytest.mark.feature("REF-33")
@pytest.mark.parametrize("chained", [False, True])
def test_the_literal_text_passes(port, chained):
    result = port(chained=chained)
    assert result.exit_code == ALL_WITHIN, result.findings
    assert not [one for one in result.stages if one.verdict == "not-run"]


def wrong_camera(step, _, read):
    """Return the look-up by this frame's camera: that of the ids that the step reads."""
    now = next(name for name in step.reads if name.startswith("rsm.visible_triangles") and "projection" not in name)
    cameras = {name: read[f"{now}.projection.{name.rpartition('.')[2]}"] for name in step.reads
               if ".projection." in name}
    return outputs_of(step, {**read, **cameras}, np.float32)


def unclamped(step, _, read):
    return {"sssil.clamp": read[step.reads[0]]}


def wrong_weight(step, made, read):
    """Return F = (1 - a) W(F) + a I."""
    new, earlier = (read[name].astype(float) for name in step.reads[:2])
    share = made["sssil.blend.share"]
    return {"sssil.blend.irradiance": (1 - share) * earlier + share * new}


@pytest.mark.feature("REF-33")
@pytest.mark.parametrize("chained", [False, True])
@pytest.mark.parametrize(("stage", "wrong", "said"), [
    ("sssil.reprojection", wrong_camera, "this frame's camera in place of that of the frame before"),
    ("sssil.clamp", unclamped, ""), ("sssil.blend", wrong_weight, "")])
def test_a_wrong_step_is_named(port, stage, wrong, said, chained):
    result = port(chained=chained, wrong=wrong, stage=stage)
    assert result.first == ("hssil-cornell_box", stage)
    assert any(said in one.cause for one in result.findings[0].causes), result.findings[0].causes


@pytest.mark.feature("REF-33")
def test_a_method_without_a_filter_gives_the_frame_alone_and_says_so(path, scenes, tmp_path):
    done = export("cornell_box", "--frames", path, "--size", "12x9", "--rsm-resolution", 8, "--stage", "pairs.",
                  "--frame", NUMBER, "--out", tmp_path / "kit")
    assert "frame 3 of 0 to 4 by itself: the frames before leave nothing to it; --temporal blends" in done.stdout
    kit = Kit(tmp_path / "kit")
    manifest, = kit.cases(Asked())
    settings = replaced(find_method("sii").settings(), {"seed": NUMBER})
    alone = stages(scenes[-1], "sii", settings, folder=tmp_path / "alone", only="pairs.", width=12, height=9,
                   rsm_resolution=8)
    np.testing.assert_array_equal(kit.array(manifest, "pairs.sum"), alone["pairs.sum"])


@pytest.mark.feature("REF-33")
@pytest.mark.parametrize("form", ["recursive", "printed"])
def test_scenes_of_frames_are_given_to_a_suite(scenes, tmp_path, form):
    """F = a W + (1 - a) I, a share of the frame before, of the light that is given."""
    data = stages(scenes[:2], "hssil", of(HssilSettings, **SETTINGS), folder=tmp_path / "kit", only="sssil.blend",
                  temporal=TemporalSettings(form=form), **SIZE)
    new, earlier = data["sssil.blend.new"].astype(float), data["sssil.blend.earlier"].astype(float)
    share = data["sssil.blend.share"].astype(float)
    data.assert_close(share * earlier + (1 - share) * new, "sssil.blend.irradiance")
    with pytest.raises(AssertionError, match=r"sssil\.blend"):
        data.assert_close(new, "sssil.blend.irradiance")


@pytest.mark.parametrize(("text", "options", "said"), [
    (None, (), "no such file"), (PATH.replace("frames = 5", ""), (), "has no line such as frames = 24"),
    (PATH.replace("frames = 5", "frames = 1"), (), "--frames: expected 2 frames or more"),
    (PATH.replace("eye", "eyes", 1), (), "eyes"),
    (PATH, ("--frame", 0), "--frame: expected 1 to 4, a frame that follows on others, got 0"),
    (PATH, ("--frame", 5, "--no-temporal"), "--frame: expected 0 to 4, got 5")])
def test_what_is_no_frame_is_refused(tmp_path, text, options, said):
    file = tmp_path / "path.toml"
    if text is not None:
        file.write_text(text)
    done = export("cornell_box", "--method", "hssil", "--frames", file, *options, "--out", tmp_path / "kit")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "kit").exists()


@pytest.mark.parametrize(("options", "said"), [
    (("--frame", 1), "--frames PATH, which is absent"),
    (("--temporal", "weight=0.5"), "--frames PATH, which is absent"),
    (("--method", "sii", "--stage", "nothing."), "--stage: expected the start of a stage's name"),
    (("--method", "sii", "--stage", "pairs.", "--most", "nan"), "most: expected a number of bytes above 0, got nan")])
def test_what_would_be_no_kit_is_refused(tmp_path, options, said):
    done = export("cornell_box", "--size", "12x9", "--rsm-resolution", 8, *options, "--out", tmp_path / "kit")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "kit").exists()


def test_a_scene_s_own_kit_is_not_searched(tmp_path):
    stages("cornell_box", "sii", folder=tmp_path / "kit", only="pairs.", width=12, height=9, rsm_resolution=8)
    done = CliRunner().invoke(VerbGroup.refgi(), ["vectors", "check", *[str(tmp_path / "kit")] * 2, "--search", "9"])
    assert done.exit_code == 2
    assert "--search: expected a kit of ready cases" in done.stderr


def test_a_file_in_the_kit_s_place_stays(tmp_path):
    (tmp_path / "kit").write_text("mine")
    done = export("cornell_box", "--method", "sii", "--size", "12x9", "--rsm-resolution", 8, "--stage", "pairs.",
                  "--out", tmp_path / "kit")
    assert (done.exit_code, (tmp_path / "kit").read_text()) == (2, "mine")
    assert "expected a new folder or a kit, got a file" in done.stderr


def test_stages_takes_a_sequence_of_names_and_no_empty_one(tmp_path):
    whole = {"folder": tmp_path / "kit", "only": "pairs.", "width": 12, "height": 9, "rsm_resolution": 8}
    assert "pairs.sum" in stages(["cornell_box"], "sii", **whole)
    with pytest.raises(InputError, match="one or more of a sequence"):
        stages([], "sii", **whole)
    with pytest.raises(InputError, match="two frames or more"):
        stages("cornell_box", "hssil", temporal=TemporalSettings(), **whole)
