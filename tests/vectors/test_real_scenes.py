"""Stage data of real scenes: own arrays pass, a flipped, a shifted and a swapped array is named."""

import numpy as np
import pytest

from refgi.methods import find_method
from refgi.scene import load_scene
from refgi.settings.text import from_text
from refgi.vectors.check import ALL_WITHIN, OUT
from refgi.vectors.export import export_case
from refgi.vectors.kit import Kit
from refgi.vectors.recorded import recorded_case
from tests.vectors.port import Port

ARRAY = "rsm.surface.position"
WRONG = [(lambda a: a[:, ::-1], "rows run upwards"), (lambda a: np.roll(a, 1, 2), "columns are shifted by one"),
         (lambda a: a[[1, 0, 2]], "in the order yxz")]
PLANS = [
    ("cornell_box", "sii", "lights.count=64"), ("cornell_box", "val", "visibility=pcss clusters=4 maps_resolution=32"),
    ("cornell_horse", "multires", "lights.count=32"), ("cornell_horse", "hssil", "sampling.samples=12"),
    ("glass_sphere", "sii", "lights.count=64 pairs.clamp=none"), ("glass_sphere", "gather", "disc.samples=16"),
    ("metaballs", "val", "visibility=pcf clusters=3 maps_resolution=16 lights.count=48"),
    ("metaballs", "vpl", "lights.count=24"), ("quake_e1m1", "hssil", "sampling.samples=8 blur=none"),
    ("quake_e1m1", "multires", "subsplats.visibility=rays lights.count=24"),
    ("kitchen", "sii", "lights.count=64 lights.source.warp=A reach.cut=relative"),
    ("kitchen", "val", "clusters=4 maps_resolution=16 lights.count=48 interleaving.block=none")]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("scene", "method", "settings"), PLANS, ids=[f"{a}-{b}" for a, b, _ in PLANS])
def test_wrong_arrays_of_real_scenes_are_named(data_dir, tmp_path, evidence, scene, method, settings):
    chosen = from_text(find_method(method).settings(), settings.split())
    case = recorded_case(scene, load_scene(data_dir / f"{scene}.json"), method, chosen, width=32, height=24,
                         rsm_resolution=16)
    export_case(case, tmp_path / "kit")
    port = Port(Kit(tmp_path / "kit"), scene, tmp_path)
    result = port.check()
    assert (result.exit_code, result.not_judged) == (ALL_WITHIN, 0)
    for change, word in WRONG:
        port.write(ARRAY, change(port.arrays[ARRAY]))
        result = port.check()
        assert result.exit_code == OUT
        assert result.first == (scene, ARRAY.rpartition(".")[0])
        assert any(word in cause.cause for cause in result.findings[0].causes), (word, result.findings[0].causes)
    size = sum(file.stat().st_size for file in (tmp_path / "kit").rglob("*") if file.is_file())
    evidence(f"{scene}, {method} {settings}: {len(port.case.stages)} stages exact, {size / 1e6:.1f} MB; 3 of 3 named")
