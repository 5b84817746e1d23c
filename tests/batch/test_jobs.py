"""Names of jobs: what they depend on, and nothing else; frames of a path."""

import pytest

from refgi.batch import jobs as module
from refgi.batch.jobs import jobs_of, key_of_scene, scene_at
from refgi.batch.plan import read_plan
from refgi.bench.measure import REFERENCE_SEED
from refgi.errors import InputError
from refgi.scene import load_scene
from tests.batch.made import PLAN

PATH = """
[[camera]]
at = 0.0
eye = [0.278, 0.273, -0.8]
[[camera]]
at = 1.0
eye = [0.278, 0.273, -0.7]
"""


def jobs(tmp_path, text=PLAN):
    (tmp_path / "plan.toml").write_text(text)
    (tmp_path / "way.toml").write_text(PATH)
    return jobs_of(read_plan(tmp_path / "plan.toml"))


def names(found):
    return {(job.choice.method, job.choice.label): job.name for job in found}


def test_a_job_for_each_choice_and_for_the_path_tracer_stopped(tmp_path):
    found = jobs(tmp_path)
    assert [(job.choice.method, job.choice.label) for job in found] == [
        ("sii", "lights=16"), ("sii", "lights=64"), ("hssil", "default"), ("truth", "samples=48")]
    assert len({job.name for job in found}) == 4
    assert all(job.seeds == (0, 1) and job.before is None and job.temporal is None for job in found)
    assert found[0].label == "cornell_box sii (lights=16)"
    assert found[0].picture == f"pictures/cornell_box/sii_{found[0].name}.exr"


@pytest.mark.parametrize("change", [
    ('"cornell_box"', '"cornell_sphere:faces=80"'), ("[24, 18]", "[24, 20]"), ("rounds = 2", "rounds = 3"),
    ("resolution = 32", "resolution = 64"), ("{samples = 48}", "{samples = 96}"), ("{samples = 48}", "{bounces = 2}")])
def test_whatever_a_result_depends_on_names_it(tmp_path, change):
    before, after = jobs(tmp_path), jobs(tmp_path, PLAN.replace(*change))
    assert not {job.name for job in before} & {job.name for job in after}


def test_another_setting_or_other_code_changes_the_jobs_that_it_reaches(tmp_path, monkeypatch):
    before = names(jobs(tmp_path))
    other = names(jobs(tmp_path, PLAN.replace("[16, 64]", "[16, 65]") + '[expect]\n"cornell_box.sii.rmse" = "< 9"\n'))
    assert {key for key in before if before[key] == other.get(key)} == set(before) - {("sii", "lights=64")}
    code = module._code
    monkeypatch.setattr(module, "_code", lambda method: "other" if method == "hssil" else code(method))
    other = names(jobs(tmp_path))
    assert {key for key in before if before[key] != other[key]} == {("hssil", "default")}


def test_a_name_of_a_scene_in_the_plan_is_no_part_of_it(tmp_path):
    other = jobs(tmp_path, PLAN.replace('["cornell_box"]', '{box = "cornell_box"}'))
    assert [job.name for job in other] == [job.name for job in jobs(tmp_path)]
    assert other[0].shot.name == "box"


def test_frames_of_a_path(tmp_path):
    found = jobs(tmp_path, PLAN.replace("rounds = 2", 'rounds = 2\npath = "way.toml"\nframes = 3\ntemporal = {}'))
    assert len(found) == 12
    assert [job.shot.name for job in found[::4]] == ["cornell_box@0", "cornell_box@1", "cornell_box@2"]
    scenes = [scene_at(job.shot) for job in found[::4]]
    assert [scene.camera.eye[2] for scene in scenes] == pytest.approx([-0.8, -0.75, -0.7])
    assert [(scene.camera.width, scene.camera.height) for scene in scenes] == [(24, 18)] * 3
    assert scenes[0].geometry is scenes[2].geometry
    assert [key_of_scene(scene) for scene in scenes] == [job.scene_key for job in found[::4]]
    assert [job.seeds for job in found[::4]] == [(0, 1), (2, 3), (4, 5)]
    filtered = [job for job in found if job.choice.method == "hssil"]
    assert [job.seeds for job in filtered] == [(0,), (1,), (2,)]
    assert [job.before for job in filtered] == [None, filtered[0].name, filtered[1].name]
    assert all(job.temporal is None and job.before is None for job in found if job not in filtered)
    truth = [module.reference_settings(read_plan(tmp_path / "plan.toml").truth, job.shot) for job in found[::4]]
    assert [one.seed for one in truth] == [REFERENCE_SEED, REFERENCE_SEED + 1, REFERENCE_SEED + 2]


def test_how_many_frames_there_are(tmp_path):
    text = PLAN.replace("rounds = 2", 'rounds = 2\npath = "way.toml"')
    with pytest.raises(InputError, match=r"batch\.frames"):
        jobs(tmp_path, text)
    (tmp_path / "way.toml").write_text("frames = 2\n" + PATH)
    assert len(jobs_of(read_plan(tmp_path / "plan.toml"))) == 8


def test_all_of_a_scene_is_in_its_key():
    box = load_scene("cornell_box")
    others = [box.with_camera(width=9), box.with_lights(*box.lights, *box.lights), load_scene("cornell_sphere")]
    assert len({key_of_scene(scene) for scene in (box, *others)}) == 4
    assert key_of_scene(box) == key_of_scene(load_scene("cornell_box"))
