"""Property tests of docstrings: the public interface and every stage describe all that goes in and comes out.

numpydoc checks sections where there are any; kernels and functions inside the package may do without. Stages have a
line for each array, once for those that share it.
"""

import ast
import importlib
import inspect
import pkgutil
import re
import sys
import typing
from collections import Counter
from pathlib import Path

import pytest

import refgi
from refgi import stages
from refgi.vectors.docstrings import TAKEN, UNIT, documented, entries

ROOT = Path(refgi.__file__).parent
REPEATED = 3  # stages of a module that say the same of an array: their module's docstring says it
# floats that stages make and that have no unit: by the array's name, or the stage's
PURE = """
    normal axis lobe_axis frame axes lobe_exponent albedo weight share count region points shifts bias end
    cluster.back_projection cluster.basis cluster.box_means cluster.csm cluster.csm_penumbra.t cluster.depth_scale.slope
    cluster.depth_tests cluster.disc_means cluster.frames_behind
    cluster.kmeans_assign.distance cluster.map_depths cluster.mip_levels cluster.mip_means cluster.of_both cluster.pcss
    cluster.traced_share cluster.visibility frame.sum_of_lamps gather.centers.center gather.pattern.offset
    lights.grid_points lights.halton_points lights.warp.warped lights.warp.density_weight multires.curvatures.high
    multires.depth_slopes.high multires.normal_ranges.low multires.normal_ranges.high multires.subsplat_facing
    multires.representative_points.normals
    rays.openness rsm.facing rsm.resolve rsm.spread_over_picture sii.ellipsoids.appendix_center
    sii.ellipsoids.appendix_half_width sii.ellipsoids.appendix_height sii.ellipsoids.tangent_center
    sii.ellipsoids.tangent_half_width sii.ellipsoids.tangent_height sssil.reproject.mean sssil.sample_points
    truth.path_traced.variance_of_mean vpl.facing vpl.map_frames"""


@pytest.fixture(scope="module")
def known():
    """Every stage of refgi by its name."""
    for module in pkgutil.walk_packages(refgi.__path__, "refgi."):
        if not module.name.startswith(("refgi.cli", "refgi.__main__")):
            importlib.import_module(module.name)
    return {name: stage for name, stage in stages.STAGES.items() if stage.__module__.startswith("refgi.")}


def test_steps_take_what_their_stage_takes(known):
    """Steps are named in words and imported when someone records them: a name that is wrong would be found there."""
    named = [stage for stage in known.values() if isinstance(stage.steps, str) and stage.steps != "inside"]
    assert len(named) > 20
    for stage in named:
        takes, given = (inspect.signature(one).parameters.values() for one in (
            pkgutil.resolve_name(stage.steps), inspect.unwrap(stage)))
        by_both = list(zip(takes, given, strict=False))
        assert len(by_both) == len(given), stage.steps
        assert all((a.name, a.kind, a.default) == (b.name, b.kind, b.default) for a, b in by_both), stage.steps


def functions(tree):
    return [node for node in tree.body if isinstance(node, ast.FunctionDef)]


def has(function, decorator):
    return any(ast.unparse(one).partition("(")[0] == decorator for one in function.decorator_list)


def exported(tree):
    found = [node.value for node in tree.body
             if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"]
    return set(ast.literal_eval(found[0])) if found else set()


def lacks(function):
    """Return the sections that a function ought to have and has not."""
    text, arguments = ast.get_docstring(function) or "", function.args
    wanted = [("Parameters",)] if arguments.args or arguments.kwonlyargs or arguments.vararg else []
    if function.returns is not None and ast.unparse(function.returns) != "None":
        wanted.append(("Returns", "Yields"))
    return [names[0] for names in wanted if not any(f"\n{name}\n{'-' * len(name)}\n" in text for name in names)]


def test_public_functions_are_documented_in_full():
    trees = {path: ast.parse(path.read_text()) for path in ROOT.rglob("*.py")
             if path.parent.name != "jit"}  # typed overloads, no interface of renderers
    faults, count = [], 0
    for path, tree in trees.items():
        names = exported(tree)
        for folder in path.parents[: len(path.relative_to(ROOT).parts)]:
            if folder / "__init__.py" in trees:
                names |= exported(trees[folder / "__init__.py"])
        for function in functions(tree):
            if function.name in names and not function.name.startswith("_") and not (
                    has(function, "kernel") or has(function, "stage")):
                count += 1
                faults += [f"{path.relative_to(ROOT)}: {function.name}: {section}" for section in lacks(function)]
    assert count > 60
    assert not faults


def test_every_stage_says_what_it_takes_and_gives(known):
    faults = []
    for name, stage in known.items():
        taken, made = documented(stage)
        taken.pop("self", None)
        annotation = inspect.signature(stage).return_annotation
        faults += [f"{name}: no text of {field}" for field, told in (taken | made).items() if not told.text]
        faults += [f"{name}: no shape of {field}" for field, told in (taken | made).items()
                   if re.search(r"\bN?D?[aA]rray", told.kind) and "Callable" not in told.kind]
        parts = typing.get_args(annotation) if typing.get_origin(annotation) is tuple else ()
        if not made or (parts and ... not in parts and "" not in made and len(made) != len(parts)):
            faults.append(f"{name}: returns {annotation}, says {list(made)}")
        faults += [f"{name}: no shape of what it returns" for told in made.values()
                   if "(" not in told.kind and "rray" in str(annotation) and len(made) == 1]
    assert not faults
    assert len(known) > 200


def test_floats_that_stages_make_have_a_unit(known):
    pure = set(PURE.split())
    lacking = {(name, field) for name, stage in known.items() for field, told in documented(stage)[1].items()
               if "(" in told.kind and not re.search(r"\b(bool|u?int)\d*$", told.kind) and not UNIT.search(told.text)}
    names = [(field, f"{name}.{field}".rstrip(".")) for name, field in lacking]
    assert [one for field, one in names if not pure & {field, one}] == []
    assert pure <= {one for both in names for one in both}


def test_what_stages_share_is_said_once_and_is_taken(known):
    """An array's line stands in the docstring of the stage, of its module or of `refgi.stages`: in one of them."""
    common, faults = entries(stages, TAKEN), []
    said, takers = Counter(), Counter()
    for stage in {inspect.unwrap(stage) for stage in known.values()}:
        of_module, own = entries(sys.modules[stage.__module__], TAKEN), entries(stage, TAKEN)
        parameters = inspect.signature(stage).parameters
        faults += [f"{stage.__qualname__}: {field} is no parameter" for field in own if field not in parameters]
        faults += [f"{stage.__qualname__}: {field} as said elsewhere" for field, told in own.items()
                   if told == (common | of_module).get(field)]
        said.update((stage.__module__, field, told) for field, told in own.items() if field not in of_module)
        takers.update((stage.__module__ if field in of_module else "", field) for field in parameters
                      if field not in own)
    shared = {(stage.__module__, field) for stage in known.values()
              for field in entries(sys.modules[stage.__module__], TAKEN)} | {("", field) for field in common}
    assert [one for one in shared if takers[one] == 1 or (one[0] == "" and takers[one] == 0)] == []
    assert [one for one, count in said.items() if count >= REPEATED] == []
    assert not faults
