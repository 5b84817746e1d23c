"""What a newcomer types: every example of README and docs/cli.md runs as printed, and the demo says where to go on."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from refgi.cli.group import VERBS, VerbGroup
from refgi.image import is_from_refgi

ROOT = Path(__file__).parents[1]
# appended, so that a printed command means the same and ends soon: fewer pixels, samples, frames or repeats
SMALLER = {
    "render": ["--size", "24x18"], "compare": ["--size", "24x18", "--set", "truth.samples=48"],
    "batch": ["--shard", "1/6"],
    "bench": ["--size", "24x18", "--rounds", "1", "--set", "samples=48", "--methods", "sii"],
    "choose": ["--size", "24x18", "--rounds", "1", "--set", "samples=48", "--methods", "sii,truth"],
    "sequence": ["--size", "24x18", "--frames", "2"], "explain": ["--size", "24x18", "--rounds", "1"],
    "stress": ["--size", "24x18", "--methods", "hssil", "--change", "mirrored"],
    "vectors": ["--case", "pairs-diffuse"],
}


def examples(text):
    """Lines of fenced blocks that start with `refgi`, as a shell splits them."""
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", "").splitlines() if line.startswith("refgi ")]
    return [shlex.split(line, comments=True)[1:] for line in lines]


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder with the files that a clone has for its examples; the plan's pictures are small."""
    shutil.copytree(ROOT / "docs" / "examples", tmp_path / "docs" / "examples")
    plan = tmp_path / "docs" / "examples" / "batch.toml"
    plan.write_text(plan.read_text().replace("[96, 72]", "[24, 18]").replace("384", "96"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_example_runs_as_printed(clone, evidence):
    """Those of both documents, each once."""
    of = {document: examples((ROOT / document).read_text("utf-8")) for document in ("README.md", "docs/cli.md")}
    commands = list(dict.fromkeys(tuple(arguments) for document in of.values() for arguments in document))
    for arguments in commands:
        smaller = [] if "--again" in arguments else SMALLER.get(arguments[0], [])
        if arguments[:2] == ("vectors", "export") and not arguments[2].startswith("--"):  # of a scene
            smaller = ["--size", "16x12", "--rsm-resolution", "16"]
        result = CliRunner().invoke(VerbGroup.refgi(), [*arguments, *smaller])
        assert result.exit_code == 0, f"{shlex.join(arguments)}: {result.output}"
        if "--out" in arguments and arguments[0] != "vectors":
            out = clone / arguments[arguments.index("--out") + 1]
            files = [out] if out.is_file() else [file for file in out.rglob("*") if file.is_file()]
            assert files
            assert all(map(is_from_refgi, files)), arguments
    assert all({arguments[0] for arguments in document} == set(VERBS) for document in of.values())
    evidence(f"{', '.join(of)}: {len(commands)} of {len(commands)} commands run")


def test_the_examples_of_a_text_are_found():
    text = "refgi no\n```\nrefgi a \\\n    'b c'  # why\nmake\n```\n```python\nimport refgi\n```\n```sh\nrefgi d\n```\n"
    assert examples(text) == [["a", "b c"], ["d"]]


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
def test_the_readmes_python_runs():
    block, = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL)
    names = {}
    exec(block.replace("512", "24"), names)
    assert names["picture"].irradiance.shape == (3, 24, 24)


def test_the_demo_has_flip_and_ends_with_a_line_that_runs(clone):
    makefile = (ROOT / "Makefile").read_text()
    recipe = re.search(r"^demo:.*?\n((?:\t.*\n)+)", makefile, re.MULTILINE)[1]
    run_stamp = re.search(r"^\$\(VENV\)/run.stamp:.*?\n((?:\t.*\n)+)", makefile, re.MULTILINE)[1]
    assert "'.[flip]'" in run_stamp
    line = re.search(r"try: \$\(BIN\)/refgi (.*?)\"", recipe)[1]
    (clone / "out").mkdir()
    result = CliRunner().invoke(VerbGroup.refgi(), [*shlex.split(line), *SMALLER["render"]])
    assert result.exit_code == 0, result.output
    assert ".venv/bin/refgi" in (ROOT / "README.md").read_text("utf-8")
