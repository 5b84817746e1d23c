"""The literal twins as a program: `python -m tests.vectors.naive_run KIT OUT [CASE ...]` writes what they cover."""

import sys
from pathlib import Path

import numpy as np

from refgi.vectors.cases import kit_cases
from refgi.vectors.check import Asked, Kit
from refgi.vectors.spec import outputs_of
from tests.vectors import screen_space_port
from tests.vectors.naive_port import NaivePort

CLUSTERED = ("val-",)
SPLATTING, SCREEN = ("pairs-", "sii-halton", "sii-three", "sii-warp", "sii-grid"), ("hssil-",)


def main(kit, out, only=()):
    """Write the arrays of every stage that a twin covers, each made from the kit's inputs; of some cases or of all."""
    covered = kit.cases(Asked(cases=(*SPLATTING, *SCREEN, *CLUSTERED)))
    for case in (one for one in covered if not only or one.id in only):
        (out / case.id).mkdir(parents=True, exist_ok=True)
        for made in outputs(kit, case):
            for name, array in (made or {}).items():
                if name in case.arrays:
                    np.save(out / case.id / f"{name}.npy", np.asarray(array))


def outputs(kit, case):
    """Yield what each stage writes; None where no twin covers it."""
    known = {name: kit.array(case, name) for name in case.arrays}
    if case.id.startswith(CLUSTERED):
        yield from (outputs_of(step, known, np.float64, step.variants[-1]) for step in kit_cases("quick")[case.id](
            ).stages if step.variants)
        return
    splatted = case.id.startswith(SPLATTING)
    steps = NaivePort(case) if splatted else kit_cases("quick")[case.id]()
    for number, step in enumerate(case.stages):
        inputs = {name: as_read(known[name]) for name in step.reads}
        yield steps.run(step.name, inputs) if splatted else screen_space_port.outputs(
            steps, steps.stages[number], inputs)


def as_read(array):
    return array.astype(np.float64) if array.dtype.kind == "f" else array


if __name__ == "__main__":
    main(Kit(Path(sys.argv[1])), Path(sys.argv[2]), sys.argv[3:])
