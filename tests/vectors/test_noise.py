"""Noise, zeros and exchanged choices put into every array, in every mode and tier: out or not judged, never within."""

from pathlib import Path

import numpy as np
import pytest

from refgi.testing import kit_folder
from refgi.vectors.check import _judged
from refgi.vectors.kit import Asked, Kit
from refgi.vectors.port import Got, Port

MODES = [(tier, chained) for tier in ("T1", "T2", "T2B") for chained in (False, True)]
PACKED = [("R11G11B10F", False), ("R11G11B10F", True)]
MOST_NOT_JUDGED = 0.02  # share of arrays, of each of MODES


class Cached(Kit):
    """A kit whose arrays are read once."""

    def __init__(self, folder):
        super().__init__(folder)
        self.known = {}

    def array(self, case, name):
        key = case.id, name
        return self.known[key] if key in self.known else self.known.setdefault(key, super().array(case, name))

    def extra(self, case, file):
        key = case.id, file
        return self.known[key] if key in self.known else self.known.setdefault(key, super().extra(case, file))


def noisy(array):
    """Yield arrays in the place of one: noise, and nothing."""
    random = np.random.default_rng(array.size)
    if array.dtype.kind == "f":
        yield (np.where(np.isfinite(array), array, 0) + 1e3 * (1 + random.random(array.shape))).astype(np.float32)
    else:
        yield ~array if array.dtype.kind == "b" else array + 1 + random.integers(0, 9, array.shape, np.int32)
    if np.count_nonzero(array) > 0.1 * array.size:
        yield np.zeros_like(array)


def verdicts(kit, case, tier, chained):
    """Yield (array, verdicts on each noise in it) of a case."""
    port = Port(kit, case, Path(), Asked(chained=chained, tiers={"": tier}))
    for step in case.stages:
        port.note_storage(step)
        for name in step.writes:
            if case.arrays[name].tier != "T3":
                yield name, {_judged(port, name, Got({name: wrong}, {}, {}), tier).verdict.verdict
                             for wrong in noisy(kit.array(case, name)) if wrong.size}


@pytest.mark.parametrize("size", ["quick", pytest.param("full", marks=pytest.mark.slow)])
def test_noise_in_any_array_is_out_or_not_judged(size, evidence):
    kit = Cached(kit_folder(size))
    found = {mode: {} for mode in (*MODES, *PACKED)}
    for case in kit.cases(Asked()):
        for mode, seen in found.items():
            seen |= {f"{case.id} {name}": own for name, own in verdicts(kit, case, *mode)}
    passed = {(mode, name): seen for mode, own in found.items() for name, seen in own.items()
              if seen & {"exact", "within"}}
    assert passed == {}
    idle = {mode: [name for name, seen in found[mode].items() if "not-judged" in seen] for mode in MODES}
    shares = ", ".join(f"{tier}{' chained' if chained else ''} {len(names)} of {len(found[tier, chained])}"
                       for (tier, chained), names in idle.items())
    evidence(f"{size} kit, arrays not judged: {shares}; all others out")
    assert {mode: names for mode, names in idle.items() if len(names) > MOST_NOT_JUDGED * len(found[mode])} == {}
