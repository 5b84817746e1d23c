"""The literal twins pass the kit, stage by stage on the kit's inputs and chained on their own outputs."""

import numpy as np
import pytest

from refgi.vectors.check import ALL_WITHIN, Asked, check_output
from tests.vectors.naive_port import NaivePort

CASES = ("pairs-diffuse", "pairs-glossy", "sii-halton", "sii-three-lamps", "sii-warp-a", "sii-warp-b", "sii-grid",
         "sii-one-texel")
WITHOUT_TWIN = {"sii-halton": {"rsm0.flux"}, "sii-three-lamps": {"rsm0.flux"}, "sii-grid": {"rsm0.flux"},
                "sii-one-texel": {"rsm0.flux", "rsm1.flux"}, "sii-warp-a": {"rsm0.flux"},
                "sii-warp-b": {"rsm0.flux"}}  # a spot's falloff


@pytest.mark.parametrize("chained", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_the_twins_pass(kit, tmp_path, evidence, name, chained):
    case = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    port, own, covered = NaivePort(case), {}, set()
    (tmp_path / name).mkdir()
    for step in case.stages:
        inputs = {one: own[one] if chained and one in own else as_read(kit.array(case, one)) for one in step.reads}
        made = port.run(step.name, inputs)
        if made is None:
            own |= {one: as_read(kit.array(case, one)) for one in step.writes}
            continue
        covered.add(step.name)
        for one, array in made.items():
            own[one] = np.asarray(array)
            np.save(tmp_path / name / f"{one}.npy", own[one])
    result = check_output(kit, tmp_path, Asked(chained=chained, cases=(name,)))
    wrong = [(one.stage, one.arrays, one.causes) for one in result.stages if one.verdict in ("out", "invalid")]
    assert not wrong
    assert result.exit_code == ALL_WITHIN
    assert {step.name for step in case.stages} - covered == WITHOUT_TWIN.get(name, set())
    worst = max(array.worst or 0.0 for one in result.stages for array in one.arrays)
    evidence(f"{name}, {'chained' if chained else 'isolated'}: {len(covered)} stages within, worst {worst:.2g} bounds")


def as_read(array):
    return array.astype(np.float64) if array.dtype.kind == "f" else array
