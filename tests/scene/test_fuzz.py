"""Spoiled files: whatever bytes or values change, a file is read or refused with an `InputError` that names it."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.stability.file_child import breach_of
from benchmarks.stability.file_formats import BESIDE, FORMATS, Format, mutated, read_scene, spoiled
from tests import fuzzed

FORMS = {name: FORMATS[name] for name in ("glb", "gltf", "ply", "scene")} | {
    "poses": fuzzed.GLB, "obj": fuzzed.OBJS, "mtl": fuzzed.LIBRARY, "strips": fuzzed.POLYGONS}
MUTATIONS, SEED = 400, 11  # of each; thousands in `python -m benchmarks stability` and tests/test_fuzz_readers.py


@pytest.mark.parametrize("name", FORMS)
def test_spoiled_files_are_read_or_refused(tmp_path: Path, name: str) -> None:
    form, read = FORMS[name], []
    for beside, content in BESIDE.items():
        (tmp_path / beside).write_bytes(content)
    counted = Format(form.file, form.seeds, lambda path: read.append(form.read(path)), form.named)
    path, seeds = tmp_path / form.file, form.seeds()
    for number in range(MUTATIONS):
        path.write_bytes(mutated(seeds[number % len(seeds)], np.random.default_rng([SEED, number])))
        assert breach_of(counted, path) is None, number
    assert 20 < len(read) < MUTATIONS - 20


def test_spoiled_real_headers(data_dir: Path, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    for name in ("stage.glb", "plate.ply", "cornell_box.glb"):
        whole, form = (data_dir / name).read_bytes(), Format(name, list, read_scene)
        for _ in range(60):
            (tmp_path / name).write_bytes(spoiled(whole[:2000], random) + whole[2000:])
            assert breach_of(form, tmp_path / name) is None
