"""A port of a kit for tests: arrays of a case that are right, and folders of them as a port would write."""

import numpy as np

from refgi.vectors.check import Asked, Kit, check_output


class Port:
    """What a port has written of one case of a kit: at first all that the kit expects."""

    def __init__(self, kit: Kit, case: str, folder):
        self.kit, self.folder, self.id = kit, folder / "output", case
        self.case = next(one for one in kit.cases(Asked(cases=(case,))) if one.id == case)
        self.arrays = {name: kit.array(self.case, name) for step in self.case.stages for name in step.writes}
        for name, array in self.arrays.items():
            self.write(name, array)

    def write(self, name, array):
        """Write an array in place of the right one."""
        (self.folder / self.id).mkdir(parents=True, exist_ok=True)
        np.save(self.folder / self.id / f"{name}.npy", array)

    def remove(self, name):
        (self.folder / self.id / f"{name}.npy").unlink()

    def check(self, **asked):
        """Return what the checker finds."""
        return check_output(self.kit, self.folder, Asked(cases=(self.id,), **asked))

    def first(self, **asked):
        """Return the verdict on the first wrong stage."""
        result = self.check(**asked)
        return next(one for one in result.stages if (one.case, one.stage) == result.first)
