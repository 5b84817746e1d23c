"""Stage data of any scene and settings: own arrays pass, a wrong one fails at its stage."""

import inspect
import re
from functools import cache

import numpy as np
import pytest

from refgi import stages
from refgi.diagnostics import diagnosing
from refgi.errors import InputError
from refgi.methods import find_method, render
from refgi.scene import Camera, Material, Mesh, PointLight, Scene, SpotLight
from refgi.scene.model import merge
from refgi.settings import replaced
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.check import Asked, check_output
from refgi.vectors.docstrings import returned, taken
from refgi.vectors.export import export_case
from refgi.vectors.kit import Kit
from refgi.vectors.leaves import leaves
from refgi.vectors.recorded import recorded_case
from refgi.vectors.rows import Form
from refgi.vectors.spec import expected_of, kind_of, outputs_of

SETTINGS = {"sii": {}, "gather": {}, "hssil": {"sampling.samples": 12}, "vpl": {},
            "multires": {"lights.count": 32}, "val": {"lights.count": 64}}
EDGES = 0.01  # share of elements that rounding decides
SIZE = {"width": 24, "height": 18, "rsm_resolution": 16}


def heap(seed=7):
    """Return a scene that no other test has: tilted sheets of several materials under two lamps."""
    random = np.random.default_rng(seed)
    meshes = []
    for number in range(5):
        corners = random.uniform(-0.4, 0.4, (4, 3)) + random.uniform(-0.5, 0.5, 3)
        glossy = number == 3
        meshes.append(Mesh(corners, np.array([[0, 1, 2], [1, 3, 2]]), material=Material(
            diffuse=tuple(random.uniform(0.2, 0.8, 3)), specular=(0.2, 0.1, 0.15) if glossy else (0.0, 0.0, 0.0),
            exponent=12.0 if glossy else 0.0)))
    floor = np.array([[-2.0, -1, -2], [2, -1, -2], [-2, -1, 2], [2, -1, 2]])
    meshes.append(Mesh(floor, np.array([[0, 2, 1], [1, 2, 3]]), material=Material(diffuse=(0.6, 0.5, 0.4))))
    lamps = (SpotLight((0.3, 2.0, 0.4), (-0.1, -1.0, -0.2), 0.5, 0.7, (5.0, 4.0, 3.0)),
             PointLight((-1.2, 0.8, 1.1), (1.0, 1.5, 2.0)))
    return Scene("heap", *merge(meshes), Camera((0.2, 0.9, 2.6), (0.0, -0.2, 0.0), vfov=0.9), lamps)


@cache
def recorded(method):
    return recorded_case(f"{method}-heap", heap(), method, replaced(find_method(method).settings(), SETTINGS[method]),
                         **SIZE)


@pytest.fixture(scope="module")
def kit_of(tmp_path_factory):
    """Return a function that gives the kit of a method on the heap, made once."""

    @cache
    def made(method):
        folder = tmp_path_factory.mktemp(method) / "kit"
        export_case(recorded(method), folder)
        return Kit(folder)

    return made


def own_arrays(kit, folder):
    """Return the kit's case, and where its arrays lie as a port's."""
    manifest, = kit.cases(Asked())
    output = folder / manifest.id
    output.mkdir()
    for step in manifest.stages:
        for name in step.writes:
            np.save(output / f"{name}.npy", kit.array(manifest, name))
    return manifest, output


@pytest.mark.slow("val", "vpl", "multires")
@pytest.mark.feature("REF-33")
@pytest.mark.parametrize("method", SETTINGS)
def test_own_arrays_pass_and_a_flipped_one_fails_at_its_stage(kit_of, tmp_path, method, evidence):
    """The check of a flipped array is of its stage alone; of all stages for sii."""
    kit = kit_of(method)
    manifest, output = own_arrays(kit, tmp_path)
    right = check_output(kit, output.parent, Asked())
    assert right.exit_code == 0
    assert {one.stage for one in right.stages if one.verdict == "not-run"} == set()
    caught = 0
    for step in manifest.stages:
        arrays = {one: kit.array(manifest, one) for one in step.writes}
        name = next((one for one, array in arrays.items() if array.ndim > 1 and np.isfinite(array).all()
                     and not np.array_equal(array[..., ::-1], array)), None)
        if name is None:
            continue
        array = arrays[name]
        np.save(output / f"{name}.npy", array[..., ::-1])
        result = check_output(kit, output.parent, Asked(stages=() if method == "sii" else (step.name,)))
        assert result.first == (manifest.id, step.name)
        np.save(output / f"{name}.npy", array)
        caught += 1
    evidence(f"{method}: {len(manifest.stages)} stages within, {caught} of {caught} flipped arrays out at their stage")
    assert caught >= 3


@pytest.mark.feature("REF-33")
def test_the_last_stage_is_the_picture_of_a_render(kit_of):
    kit = kit_of("sii")
    manifest, = kit.cases(Asked())
    with diagnosing(False):
        picture = render(heap(), "sii", **SIZE).radiance
    assert manifest.stages[-1].name == "frame.add_lobes" or manifest.stages[-1].name == "frame.compose"
    assert kit.array(manifest, manifest.stages[-1].writes[0]) == pytest.approx(picture, rel=1e-4, abs=1e-6)


@pytest.mark.feature("REF-33")
def test_arrays_that_stages_made_are_not_given():
    case = recorded("sii")
    assert all(name.startswith(("scene.", "materials.")) or ".projection." in name or ".lamp." in name
               or name.endswith(".shifts") for name in case.given)
    total = next(step for step in case.stages if step.name == "pairs.sum")
    assert {"rsm.surface.position", "lights.pixel_lights.flux", "lights.footprints"} <= set(total.reads)
    assert "cluster.visibility.points" not in recorded("val").given  # a copy of what a stage made
    assert "pairs.glossy_sum.points.position" not in recorded("multires").given


@pytest.mark.feature("REF-33")
def test_some_stages_alone_are_given_what_they_read():
    case = recorded_case("sii-heap", heap(), "sii", only="pairs.sum", **SIZE)
    assert [step.name for step in case.stages] == ["pairs.sum"]
    assert "pairs.sum.lights.position" in case.given
    whole = expected_of(recorded("sii"))["pairs.sum"]
    assert expected_of(case)["pairs.sum"] == pytest.approx(whole, rel=1e-5, abs=1e-6)


@pytest.mark.feature("REF-33")
def test_a_case_of_indirect_light_ends_there():
    case, picture = recorded_case("sii-heap", heap(), "sii", indirect=True, **SIZE), recorded("sii")
    left_out = {step.name for step in picture.stages} - {step.name for step in case.stages}
    assert {"rsm.direct_irradiance", "rsm.leaving_radiance"} <= left_out
    np.testing.assert_array_equal(expected_of(case)["pairs.sum"], expected_of(picture)["pairs.sum"])


@pytest.mark.feature("REF-33")
@pytest.mark.parametrize(("method", "stage", "changed"), [
    ("sii", "pairs.sum", "lights.pixel_lights.flux"),
    ("hssil", "sssil.gather_samples0", "sssil.senders.0.radiance"),
    ("sii", "rsm.direct_irradiance", "rsm.shadow_map0")])
def test_a_stage_computes_from_what_it_is_handed(method, stage, changed):
    case = recorded(method)
    step, = (one for one in case.stages if one.name == stage)
    known = expected_of(case)
    lobes = {one: 0 * known[one] for one in step.reads if one.endswith("lobe_flux")}
    dark = {one: known[one] * False for one in step.reads if kind_of(one) == kind_of(changed)}
    right, other = (outputs_of(step, known | lobes | arrays, real)[step.writes[0]] for arrays, real in (
        ({}, np.float64), (dark, np.float32)))
    assert right.any()
    assert not other.any()


def test_axes_and_units_are_those_of_docstrings_and_comments():
    case = recorded("sii")
    specs = case.specs
    assert (specs["pairs.sum"].axes, specs["pairs.sum"].unit) == ("rgb, row, column", "W/m^2")
    assert (specs["lights.pixel_lights.flux"].axes, specs["lights.pixel_lights.flux"].unit) == ("rgb, light", "W")
    assert specs["rsm.surface.position"].unit == "m"
    assert specs["lights.pixel_lights.texel"].unit == "1"


@pytest.mark.parametrize("method", SETTINGS)
def test_arrays_have_the_shapes_and_types_that_docstrings_say(method, evidence):
    """A letter or word of a shape is one number in each run of a stage."""
    with diagnosing(False), stages.observe(record=True, steps=True) as log:
        render(heap(), method, replaced(find_method(method).settings(), SETTINGS[method]), dtype=np.float64, **SIZE)
    faults, count = set(), 0
    for run in (one for one in log.runs if one.status == "ran"):
        function, arguments = inspect.unwrap(stages.STAGES[run.name]), run.arguments
        told, made = taken(function), returned(function)
        value = run.value if isinstance(run.value, tuple) and len(made) == len(run.value) else (run.value,)
        said = [(name, told[name].kind, array) for name, array in arguments.items() if name in told]
        said += [(f"-> {name}", kind, array) for (name, (kind, _)), array in zip(made.items(), value, strict=False)]
        sizes = {}
        for name, kind, array in said:
            shape = re.match(r"\(([^()]*[^()., ]),?\)", kind)
            if isinstance(array, np.ndarray) and shape:
                count, axes = count + 1, shape[1].split(", ")
                fitting = [int(axis) if axis.isdigit() else sizes.setdefault(axis, size)
                           for axis, size in zip(axes, array.shape, strict=False)]
                letter = "b" if "bool" in kind else "iu" if re.search(r"\bu?int", kind) else "f"
                if (*fitting, len(axes)) != (*array.shape, array.ndim) or array.dtype.kind not in letter:
                    faults.add((run.name, name, kind, array.shape, str(array.dtype)))
    assert not faults
    evidence(f"{method}: {count} arrays have the shapes and types that docstrings say")
    assert count > 20


def test_likely_bugs_and_the_search_know_stages_that_have_a_literal_form(kit_of, tmp_path):
    kit = kit_of("sii")
    manifest, output = own_arrays(kit, tmp_path)
    assert check_output(kit, output.parent, Asked()).exit_code == 0
    total = next(step for step in manifest.stages if step.name == "pairs.sum")
    read = {name: kit.array(manifest, name).astype(float) for name in total.reads}
    # each light's flux over the hemisphere, 1/(2 pi) in place of 1/pi: half of the diffuse light is missing
    diffuse = diffuse_light(read)
    right = kit.array(manifest, "pairs.sum")
    np.save(output / "pairs.sum.npy", (right - 0.5 * diffuse).astype(np.float32))
    result = check_output(kit, output.parent, Asked())
    assert result.first == (manifest.id, "pairs.sum")
    assert "over the hemisphere: 1/(2 pi)" in result.findings[0].causes[0].cause


@pytest.mark.feature("REF-33")
@pytest.mark.parametrize(("method", "kinds"), [
    ("sii", {"pairs.sum", "rsm.direct_irradiance"}),
    ("hssil", {"sssil.gather_samples", "sssil.blur", "sssil.upsample"}),
    ("val", {"cluster.areas", "cluster.kmeans_each", "cluster.parts", "cluster.shadowed"})])
def test_literal_forms_of_recorded_stages_are_the_stages(method, kinds):
    case = recorded(method)
    known, found = expected_of(case), set()
    for step in case.stages:
        for form in (one for one in step.variants if isinstance(one, Form)):
            made = outputs_of(step, known, np.float64, form)
            found.add(kind_of(step.name))
            for name in made:
                off, large = distance(made[name], known[name]), large_value(known[name])
                assert np.mean(off > 1e-5 * (np.abs(known[name]) + large)) <= EDGES, (step.name, name)
    assert kinds <= found


def diffuse_light(read):
    """Return Eq. 2 of a kit's arrays in a loop over lights, discs of their footprints in place of points."""
    x, n = read["rsm.surface.position"], read["rsm.surface.normal"]
    total = np.zeros_like(x)
    for p, m, flux, area in zip(read["lights.pixel_lights.position"].T, read["lights.pixel_lights.normal"].T,
                                read["lights.pixel_lights.flux"].T, read["lights.footprints"], strict=True):
        d = x - p[:, None, None]
        square = (d**2).sum(axis=0)
        cosines = np.maximum(0, -(n * d).sum(axis=0)) * np.maximum(0, np.einsum("c,cij->ij", m, d))
        term = np.divide(cosines, np.pi * square * (square + area / np.pi), out=np.zeros_like(square), where=square > 0)
        total += flux[:, None, None] * term
    return total


@pytest.mark.parametrize(("beyond", "masked"), [(0.01, 18), (-0.02, 18), (0.25, 0), (0.06, 0)])
def test_ids_beside_an_edge_that_a_gpu_may_move_are_masked(beyond, masked):
    """A wall's edge lies so many texels beyond the centres of a column of 18."""
    half = np.tan(0.45) * 24 / 18
    edge = 2 * half * (2 * (10.5 + beyond) / 24 - 1)
    wall = Mesh(np.array([[edge, -50.0, 0], [edge, 50, 0], [-100, 0, 0]]), np.array([[0, 1, 2]]), material=Material())
    behind = Mesh(np.array([[-100.0, -100, -1], [100, -100, -1], [0, 200, -1]]), np.array([[0, 1, 2]]),
                  material=Material())
    lamp = SpotLight((0.3, 0.2, 2.0), (0.0, 0.0, -1.0), 0.5, 0.7, (5.0, 4.0, 3.0))
    scene = Scene("edge", *merge([wall, behind]), Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), vfov=0.9), (lamp,))
    case = recorded_case("sii-edge", scene, "sii", only="rsm.visible_triangles", **SIZE)
    step, = case.stages
    mask = isolated_bounds(case, step, expected_of(case), 1)[step.writes[0]].masked
    assert np.count_nonzero(mask) == np.count_nonzero(mask[:, 10]) == masked


@pytest.mark.parametrize(("most", "some"), [(1e3, False), (1e6, True)])
def test_likely_bugs_of_a_scene_too_large_for_their_text_are_left_out_and_that_is_said(monkeypatch, most, some):
    monkeypatch.setattr("refgi.vectors.recorded.MOST_WORK", most)
    case = recorded_case("sii-heap", heap(), "sii", only="rsm.visible_triangles", **SIZE)
    step, = case.stages
    assert bool(step.bugs) == some
    assert ("likely bugs" in case.facts[step.name]) != some


def test_more_than_the_room_is_refused_before_anything_is_written(tmp_path):
    case = recorded("sii")
    with pytest.raises(InputError, match=r"at most 0\.01 MB, .* of which .* rsm\.map_surface1\.position: .*--size"):
        export_case(case, tmp_path / "kit", most=1e4)
    assert not (tmp_path / "kit").exists()


def test_a_size_that_fits_is_proposed_and_fits(tmp_path):
    """Of a light's map too; what is proposed takes about what is said, but for rows and lists that are rounded up."""
    def made(width, height, side):
        return recorded_case("sii-heap", heap(), "sii", width=width, height=height, rsm_resolution=side)

    proposed = r"--size (\d+)x(\d+) --rsm-resolution (\d+) would take (\S+) MB"
    with pytest.raises(InputError, match=proposed) as told:
        export_case(made(96, 66, 64), tmp_path / "kit", most=2e6)
    width, height, side, size = re.search(proposed, str(told.value)).groups()
    assert (int(width) < 96, int(height) < 66, int(side) < 64) == (True, True, True)
    smaller = made(int(width), int(height), int(side))
    export_case(smaller, tmp_path / "kit", most=2e6)
    with pytest.raises(InputError) as told:
        export_case(smaller, tmp_path / "other", most=1.0)
    assert float(re.search(r"got (\S+) MB", str(told.value))[1]) == pytest.approx(float(size), rel=0.2)
    with pytest.raises(InputError, match=r"map \(--size, --rsm-resolution; --set\)"):
        export_case(smaller, tmp_path / "other", most=1.0)


def test_leaves_are_named_by_fields_and_indices():
    light = PointLight((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    value = {"one": [np.zeros(2), (np.ones(1), "text")], "two": light, "three": Scene}
    assert [name for name, _ in leaves(value)] == ["one.0", "one.1.0"]


@pytest.mark.feature("REF-33")
def test_what_is_made_of_an_estimate_is_not_judged_in_a_chain(tmp_path):
    """A port's light has its own noise, and so has what it makes of it."""
    settings = replaced(find_method("truth").settings(), {"samples": 8})
    case = recorded_case("truth-heap", heap(), "truth", settings, **SIZE)
    export_case(case, tmp_path / "kit")
    (tmp_path / "out/truth-heap").mkdir(parents=True)
    np.save(tmp_path / "out/truth-heap/rsm.leaving_radiance.npy", expected_of(case)["rsm.leaving_radiance"] * 1.1)
    for chained, verdict in ((False, "out"), (True, "not-judged")):
        made = check_output(Kit(tmp_path / "kit"), tmp_path / "out", Asked(chained=chained))
        assert [one.verdict for one in made.stages if one.verdict != "not-run"] == [verdict]
