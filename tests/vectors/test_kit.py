"""The kit on disk: schemas, hashes, axes, scenes, what makes it again to the byte, and what is refused."""

import json
import re
import shutil

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import SiiSettings, sii
from refgi.vectors import export
from refgi.vectors.bounds import isolated_bounds, stored_budgets
from refgi.vectors.cases import kit_cases
from refgi.vectors.cases.scenes import SPOT, room
from refgi.vectors.check import Asked, Kit, check_output
from refgi.vectors.export import export_kit
from refgi.vectors.manifest import CASE, SCHEMAS, UNSEEN, VERSION, CaseManifest, KitManifest, read_model, schema_text
from refgi.vectors.spec import Bug, Recipe, Spec, axes_of, expected_of, kind_of, outputs_of
from tests.vectors import kit_hashes

LARGEST = 15e6  # bytes of the quick kit
UNITS = {"m": "position depth vertices origin place near far delta side radius ball point z_avg scene_far",
         "m^2": "area footprints", "sr": "solid_angle", "rad": "half_angles", "W": "flux lobe_flux importance",
         "W/m^2": "irradiance light direct_irradiance parts shadowed gather_samples upsample blur disc_sum all_maps",
         "W/m^2/sr": "radiance emission leaving_radiance",
         "1": "normal vertex_normals facing albedo diffuse specular exponent lobe_exponent lobe_axis axis axes frame "
              "weight region texel row column level pixel faces of"}  # of arrays, by the ends of their names


def test_every_file_is_what_its_schema_says_and_the_schemas_lie_beside_them(kit):
    for name, model in SCHEMAS.items():
        assert (kit.folder / "schema" / name).read_text() == schema_text(model)
    assert read_model(KitManifest, kit.folder / "kit.json").vectors == VERSION
    assert (kit.folder / "VERSION").read_text().strip() == VERSION
    assert {entry.id for entry in kit.manifest.cases} == set(kit_cases("quick"))
    for entry in kit.manifest.cases:
        assert read_model(CaseManifest, kit.folder / entry.manifest).id == entry.id


def test_every_array_is_there_in_its_type_and_shape_with_axes_and_units(kit):
    for case in kit.cases(Asked()):
        for name, entry in case.arrays.items():
            array = kit.array(case, name)
            assert (array.shape, array.dtype) == (entry.shape, np.dtype(entry.dtype)), name
            assert array.flags.c_contiguous
            axes = re.sub(r"\(.*?\)", "components", entry.axes).split(",")
            assert len(axes) == array.ndim, (name, entry.axes)
            assert not re.search(r"axis \d|value", entry.axes), (name, entry.axes)
            assert entry.unit, name
            assert entry.what, name
            assert (entry.tier == "T0") == (entry.dtype != "<f4" and not name.startswith("truth.")), name
        written = [name for step in case.stages for name in step.writes]
        assert sorted([*case.given, *written]) == sorted(case.arrays)
        for number, step in enumerate(case.stages):
            before = {*case.given, *(name for one in case.stages[:number] for name in one.writes)}
            assert set(step.reads) <= before, step.name


def test_the_quick_kit_is_small(kit, evidence):
    size = sum(file.stat().st_size for file in kit.folder.rglob("*") if file.is_file())
    assert size < LARGEST
    evidence(f"{len(kit.manifest.cases)} cases, {size / 1e6:.1f} MB")


def test_equal_bounds_and_masks_are_kept_once_and_bugs_to_a_share_of_their_bounds(kit):
    kept = [file.read_bytes() for file in kit.folder.glob("bounds/*.npy")]
    assert len(set(kept)) == len(kept) > 1000
    case, step = next(kit.cases(Asked(cases=("sii-three-lamps",)))), "pairs.sum"
    made = next(one for one in kit_cases("quick")[case.id]().stages if one.name == step)
    known = {name: kit.array(case, name) for name in (*made.reads, *made.writes)}
    limit, kept = kit.extra(case, case.arrays[step].bound).reshape(-1), kit.bugs(case)
    compared = 0
    for bug in (one for one in made.bugs if one.cause in {entry.cause for entry in kept.of(step) if entry.arrays}):
        told = kept.told(next(one for one in kept.of(step) if one.cause == bug.cause), step, known[step])
        wrong = outputs_of(made, known, np.float64, bug.run)[step].reshape(-1)[told.places]
        assert (np.diff(np.sort(told.places)) > 0).all()
        assert (np.abs(told.values.astype(float) - wrong) <= UNSEEN * limit[told.places]).all(), bug.cause
        compared += 1
    assert compared > 5


def test_the_same_bytes_each_time(kit, tmp_path):
    once, again = (export_kit("quick", tmp_path / name, only="sii-warp-b") for name in ("once", "again"))
    assert once == again
    (entry,) = once.cases
    for file in (tmp_path / "once" / "cases" / entry.id).rglob("*.*"):
        content, where = file.read_bytes(), file.relative_to(tmp_path / "once")
        assert content == (tmp_path / "again" / where).read_bytes(), file.name
        if file.parent.name in ("in", "out"):  # who knows a likely bug or keeps a bound depends on the cases before
            assert content == (kit.folder / where).read_bytes(), file.name
    own, whole = (next(one.cases(Asked(cases=(entry.id,)))) for one in (Kit(tmp_path / "once"), kit))
    for name, array in ((name, array) for name, array in own.arrays.items() if array.bound is not None):
        bounds = Kit(tmp_path / "once").extra(own, array.bound), kit.extra(whole, whole.arrays[name].bound)
        np.testing.assert_array_equal(*bounds, err_msg=name)


def test_processes_write_the_same_bytes(tmp_path):
    """Methods in two processes, whose progress the first tells."""
    cases, told = {id: kit_cases("quick")[id] for id in ("pairs-diffuse", "sii-range-bounds", "gather-border")}, []
    for name, processes in (("one", 1), ("two", 2)):
        export._write_kit("quick", cases, tmp_path / name, lambda *said: told.append(said), whole=False,
                          processes=processes)
    files = [{file.relative_to(tmp_path / name): file.read_bytes() for file in (tmp_path / name).rglob("*.*")
              if file.is_file()} for name in ("one", "two")]
    assert files[0] == files[1]
    assert len(files[0]) > 80
    half = len(told) // 2
    assert sorted(what for what, _ in told[:half]) == sorted(what for what, _ in told[half:])
    assert [done for _, done in told[half:]] == sorted(done for _, done in told[half:])
    assert told[-1] == ("done", 1.0)


def test_an_error_in_a_process_leaves_no_kit(tmp_path):
    with pytest.raises(KeyError, match="no-such-case"):
        export._write_kit("quick", dict.fromkeys(("no-such-case", "pairs-diffuse")), tmp_path / "kit",
                          lambda *_: None, whole=False, processes=2)
    assert not list(tmp_path.iterdir())


def test_scenes_are_those_of_the_cases(kit):
    for case in kit.cases(Asked()):
        if case.scene is None:
            continue
        scene = load_scene(kit.folder / case.scene / "scene.json")
        vertices, faces = kit.array(case, "scene.vertices"), kit.array(case, "scene.faces")
        loaded = scene.geometry.vertices[scene.geometry.faces].astype(np.float32).reshape(-1, 9)  # by material
        assert sorted(loaded.tolist()) == sorted(vertices[faces].reshape(-1, 9).tolist())
        lines = (kit.folder / case.scene / "scene.obj").read_text().splitlines()
        written = [[int(corner.partition("/")[0]) - 1 for corner in line.split()[1:]]
                   for line in lines if line[0] == "f"]
        np.testing.assert_array_equal(written, faces)  # in the order of the ids
        size = case.facts.get("camera", {"columns": 1, "rows": 1})
        assert (scene.camera.width, scene.camera.height) == (size["columns"], size["rows"])
        assert len(scene.lights) >= sum(bool(re.fullmatch(r"rsm\.reflected_flux\d", key)) for key in case.facts)


def test_the_last_stage_is_the_method(kit):
    case = next(one for one in kit.cases(Asked(cases=("sii-halton",))))
    frame = Frame(room(SPOT, matte=True), width=24, height=18, rsm_resolution=13, dtype=np.float64)
    picture = sii(frame, of(SiiSettings, lights=40, pattern="halton", clamp="none"))
    np.testing.assert_allclose(kit.array(case, "pairs.sum"), picture, rtol=2e-5, atol=1e-6)  # stored in float32


def test_a_bug_that_no_case_tells_is_refused(monkeypatch, tmp_path):
    def twice():
        recipe = Recipe("x-blind", "x", "a likely bug that changes nothing")
        recipe.give("x.in", np.arange(4.0), Spec("number", "1", "numbers"))
        recipe.add("x", "twice", lambda arrays, _: {"x.out": 2 * arrays["x.in"]}, ("x.in",),
                   {"x.out": Spec("number", "1", "twice")},
                   bugs=(Bug("added to itself", lambda arrays, _: {"x.out": arrays["x.in"] + arrays["x.in"]}),))
        return recipe.case()

    monkeypatch.setattr(export, "kit_cases", lambda _: {"x-blind": twice})
    with pytest.raises(InputError, match="got none for x: added to itself"):
        export_kit("quick", tmp_path / "kit")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_full_kit_is_made_and_every_case_of_it_is_exact(tmp_path):
    made = export_kit("full", tmp_path / "kit")
    assert sorted(entry.id for entry in made.cases) == sorted(kit_cases("full"))
    assert check_output(Kit(tmp_path / "kit"), tmp_path / "kit", Asked()).exit_code == 0


def test_folders_of_others_are_kept(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="folder of other files"):
        export_kit("quick", tmp_path)
    with pytest.raises(InputError, match="expected the start of one of"):
        export_kit("quick", tmp_path / "new", only="none")
    assert [file.name for file in tmp_path.iterdir()] == ["mine.txt"]


def test_a_kit_is_replaced_whole(kit, tmp_path):
    shutil.copytree(kit.folder, tmp_path / "kit")
    export_kit("quick", tmp_path / "kit", only="pairs-diffuse")
    assert [entry.id for entry in Kit(tmp_path / "kit").manifest.cases] == ["pairs-diffuse"]
    assert [file.name for file in tmp_path.iterdir()] == ["kit"]


def test_bounds_are_near_rounding(kit, evidence):
    """Of values that are not tiny beside others of their array; what conditions them worse is said by the bound."""
    worst = {}
    for case in kit.cases(Asked(cases=("sii-",))):
        for name, entry in case.arrays.items():
            if entry.bound is None:
                continue
            expected, limit = kit.array(case, name), kit.extra(case, entry.bound)
            large = np.abs(expected[np.isfinite(expected)]).max(initial=0.0)
            if large and not case.id.startswith("sii-one"):
                worst[name] = max(worst.get(name, 0.0), float(np.median(limit) / large))
    assert max(worst.values()) < 1e-5
    told = ", ".join(f"{name} {value:.0e}" for name, value in worst.items())
    evidence(f"median bound over the largest value: {told}")


def test_what_rounding_flips_is_masked_and_nothing_else():
    """A stage that cuts at 1: numbers beside it are masked, others bounded by a few roundings."""
    recipe = Recipe("x-cut", "x", "a decision")
    recipe.give("x.in", np.array([0.5, 1.0 - 2**-24, 1.0, 2.0]), Spec("number", "1", "numbers"))

    def cut(arrays, real):
        return {"x.out": np.where(arrays["x.in"] > 1, arrays["x.in"], 0).astype(real)}

    recipe.add("x", "what is above 1", cut, ("x.in",), {"x.out": Spec("number", "1", "cut")})
    case = recipe.case()
    bound = isolated_bounds(case, case.stages[0], expected_of(case), 0)["x.out"]
    assert bound.masked.tolist() == [False, True, True, False]
    assert 2**-23 < bound.limit[3] < 2**-18  # of 2: 1 to 32 roundings


def test_a_large_number_is_masked_by_its_own_size():
    """Beside ones, 10^4 whose rounding is magnified a thousandfold moves by 1: much for them, little for itself."""
    recipe = Recipe("x-large", "x", "one large number")
    recipe.give("x.in", np.ones(100), Spec("number", "1", "numbers"))
    recipe.add("x", "magnified", lambda arrays, _: {"x.out": np.where(
        np.arange(100) == 17, 1e4 * (1 + 1e3 * (arrays["x.in"] - 1)), arrays["x.in"])}, ("x.in",), {
            "x.out": Spec("number", "1", "numbers")})
    case = recipe.case()
    bound = isolated_bounds(case, case.stages[0], expected_of(case), 0)["x.out"]
    assert not bound.masked.any()
    assert 0.1 < bound.limit[17] < 10
    assert bound.limit[16] < 1e-5


def test_four_times_the_outliers_of_the_worst_run_are_allowed():
    """One number of a hundred lies where a change of half floats decides: one is out in a run, or none."""
    recipe, numbers = Recipe("x-cut", "x", "a decision"), np.linspace(2, 3, 100)
    numbers[17] = 1.0
    recipe.give("x.in", numbers, Spec("number", "1", "numbers"))
    recipe.add("x", "what is above 1", lambda arrays, _: {"x.out": arrays["x.in"] > 1}, ("x.in",), {
        "x.out": Spec("number", "1", "whether")})
    case = recipe.case()
    for budgets in stored_budgets(case, case.stages[0], expected_of(case), 0):
        assert budgets["x.out"].outliers == pytest.approx(0.04)
        assert budgets["x.out"].masked is None


def test_manifests_speak_plainly(kit):
    """No name of a module, class or function: a port's author has not read the source."""
    for case in kit.cases(Asked()):
        text = json.dumps(case.model_dump(mode="json"))
        assert "refgi." not in text
        assert "lambda" not in text
    assert CASE in {file.name for file in kit.folder.rglob("*.json")}


def test_every_array_has_a_sentence_names_of_its_axes_and_its_unit(kit):
    units = {leaf: unit for unit, leaves in UNITS.items() for leaf in leaves.split()}
    faults, judged = [], set()
    for case in kit.cases(Asked()):
        for name, entry in case.arrays.items():
            leaf = kind_of(name).rpartition(".")[2]
            axes = axes_of(entry.axes) if entry.shape else []
            if entry.what in ("", name, leaf) or len(axes) != len(entry.shape) or any(
                    re.match(r"axis \d", one) for one in axes) or units.get(leaf, entry.unit) != entry.unit:
                faults.append((case.id, name, entry.what, entry.axes, entry.unit))
            judged |= {leaf} & units.keys()
    assert not faults
    assert units.keys() == judged


def test_stages_without_libm_have_the_recorded_bytes(kit):
    """A change on purpose is a new version of the vectors: CHANGES.md, VERSION, and kit_hashes.json written anew."""
    recorded, made = json.loads(kit_hashes.FILE.read_text()), kit_hashes.hashes(kit)
    assert {name for name in recorded.keys() | made.keys() if recorded.get(name) != made.get(name)} == set()
    assert len(recorded) > 300
