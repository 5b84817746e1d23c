"""The literal twins as a program: `python -m tests.vectors.naive_run KIT OUT` writes what they cover of a kit."""

import sys
from pathlib import Path

import numpy as np

from refgi.vectors.cases import kit_cases
from refgi.vectors.check import Asked, Kit
from tests.vectors import screen_space_port
from tests.vectors.naive_port import NaivePort

SPLATTING, SCREEN = ("pairs-", "sii-halton", "sii-three", "sii-warp", "sii-grid"), ("hssil-",)


def main(kit, out):
    """Write the arrays of every stage that a twin covers, each made from the kit's inputs."""
    for case in kit.cases(Asked(cases=(*SPLATTING, *SCREEN))):
        splatted = case.id.startswith(SPLATTING)
        steps = NaivePort(case) if splatted else kit_cases("quick")[case.id]()
        (out / case.id).mkdir(parents=True, exist_ok=True)
        for number, step in enumerate(case.stages):
            inputs = {name: as_read(kit.array(case, name)) for name in step.reads}
            made = (steps.run(step.name, inputs) if splatted else
                    screen_space_port.outputs(steps, steps.stages[number], inputs))
            for name, array in (made or {}).items():
                if name in case.arrays:
                    np.save(out / case.id / f"{name}.npy", np.asarray(array))


def as_read(array):
    return array.astype(np.float64) if array.dtype.kind == "f" else array


if __name__ == "__main__":
    main(Kit(Path(sys.argv[1])), Path(sys.argv[2]))
