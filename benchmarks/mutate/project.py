"""What is mutated, by which tests it is judged, and by which pictures."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

DIFFERENT = 3  # exit code of the pictures' program where one is not as before


class Project(NamedTuple):
    """A package, its tests and its pictures; paths are relative to `root`."""

    root: Path
    package: str
    tests: str
    wired: tuple[str, ...]  # folders whose code outside kernels is wiring; code in kernels counts everywhere
    wiring_tests: str  # a folder of the tests of wiring, one file or more a method
    methods: Mapping[str, str]  # folder or file of the sources: the method that it alone belongs to
    pictures: str  # module that writes a hash of every picture: `-m MODULE FILE [--against KNOWN] [--first METHOD]`
    judging: tuple[str, ...]  # folders and files that say which pictures there are

    def sources(self) -> list[str]:
        """Return the Python files of the package."""
        return sorted(path.relative_to(self.root).as_posix() for path in (self.root / self.package).rglob("*.py"))

    def method_of(self, file: str) -> str:
        """Return the one method that a file belongs to; empty where it is shared."""
        found = [part for part in self.methods if file == part or file.startswith(f"{part}/")]
        return self.methods[max(found, key=len)] if found else ""

    def is_wired(self, file: str) -> bool:
        """Return whether code of a file outside kernels is wiring."""
        return file.startswith(tuple(f"{folder}/" for folder in self.wired))


REFGI = Project(
    root=Path(__file__).parents[2],
    package="refgi",
    tests="tests",
    wired=tuple(f"refgi/{name}" for name in
                ("rsm", "lights", "pairs", "splat", "cluster", "sssil", "truth", "rays")),
    wiring_tests="tests/wiring",
    methods={"refgi/splat/sii": "sii", "refgi/splat/multires": "multires", "refgi/splat/gather": "gather",
             "refgi/cluster": "val", "refgi/sssil": "hssil", "refgi/sssil/temporal.py": "temporal",
             "refgi/sssil/temporal_filter.py": "temporal", "refgi/sssil/motion.py": "temporal",
             "refgi/truth": "truth", "refgi/truth/vpl.py": "vpl"},
    pictures="benchmarks.mutate.pictures",
    judging=("benchmarks/sameness", "benchmarks/mutate/pictures.py"),
)
