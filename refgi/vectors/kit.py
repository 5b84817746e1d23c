"""A kit on disk, what is to be checked of it, and a port's files. NumPy alone, but for reading manifests."""

import hashlib
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from refgi.errors import InputError, shortened
from refgi.types import Array
from refgi.vectors.manifest import BUGS, KIT, Bugs, CaseManifest, KitManifest, read_model
from refgi.vectors.storage import Depth

MAGIC = b"\x93NUMPY"
LONGEST_NAME = 250  # bytes; .npy follows it


class DamagedError(InputError):
    """A kit or a port's output that cannot be read as what it says it is."""


@dataclass(frozen=True)
class Asked:
    """What is to be checked, and how."""

    chained: bool = False
    stages: tuple[str, ...] = ()  # names or their beginnings; all where empty
    cases: tuple[str, ...] = ()  # the same of ids
    tiers: Mapping[str, str] = field(default_factory=dict)  # stage or array, or its beginning -> tier; "" is for all
    layout: str = "planes"  # or "rgba": texels of up to four components are taken too
    depth: Mapping[str, Depth] = field(default_factory=dict)  # array or beginning of NAME.depth -> its storage
    unordered: tuple[str, ...] = ()  # stages whose lists may be in another order
    expect: tuple[str, ...] = ()  # [CASE/]STAGE of those that may fail, with wildcards
    require: tuple[str, ...] = ()  # starts of CASE/STAGE or of stages' names that must have run; "" is for all
    fail_fast: bool = False  # stop at the first wrong stage

    def fits(self, stage: str) -> bool:
        """Return whether a stage is asked for: by its beginning, or by what follows a dot."""
        return not self.stages or fits(stage, self.stages)

    def tier_of(self, stage: str, array: str) -> str:
        """Return the tier of an array of a stage: that of the longest name that asks for either."""
        fitting = [start for start in self.tiers if fits(stage, (start,)) or fits(array, (start,))]
        return self.tiers[max(fitting, key=len)] if fitting else "T1"

    def depth_of(self, array: str) -> Depth | None:
        """Return how a port stores the depth of an array; None where it is depth in m, or none."""
        named = array.endswith(".depth")
        fitting = [start for start in self.depth if array == start or (named and fits(array, (start,)))]
        return self.depth[max(fitting, key=len)] if fitting else None


def fits(stage: str, names: tuple[str, ...]) -> bool:
    """Return whether a stage's name begins with one of some, or one of its parts after a dot does."""
    return stage.startswith(names) or any(f".{name}" in stage for name in names)


class Kit:
    """A kit on disk.

    Parameters
    ----------
    folder : Path
        Its folder.

    Raises
    ------
    DamagedError
        If a file is absent, changed or not what its schema says.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._bugs: dict[str, Bugs] = {}
        try:
            self.manifest = read_model(KitManifest, folder / KIT)
        except InputError as error:
            raise DamagedError(str(error), file=str(folder / KIT)) from error

    def cases(self, asked: Asked) -> Iterator[CaseManifest]:
        """Yield the manifests of the cases asked for."""
        for entry in self.manifest.cases:
            if not asked.cases or entry.id.startswith(asked.cases):
                file = inside(self.folder, entry.manifest)
                self._bytes(file, entry.sha256)
                try:
                    manifest = read_model(CaseManifest, file)
                except InputError as error:
                    raise DamagedError(str(error), file=str(file)) from error
                for name in (manifest.id, *manifest.arrays):  # by these names a port's files are looked for
                    if not _is_name(name):
                        raise DamagedError(f"{file}: expected names of files, got {shortened(repr(name))}",
                                           file=str(file))
                unknown = {name for step in manifest.stages for name in step.writes} - set(manifest.arrays)
                if unknown:
                    raise DamagedError(f"{file}: expected an entry for each array that a stage writes, got none of "
                                       f"{shortened(', '.join(sorted(unknown)))}", file=str(file))
                yield manifest

    def array(self, case: CaseManifest, name: str) -> Array:
        """Return an expected array, checked by its hash."""
        entry = case.arrays[name]
        file = inside(self.folder, "cases", case.id, entry.file)
        self._bytes(file, entry.sha256)
        return read_array(file)

    def extra(self, case: CaseManifest, file: str) -> Array:
        """Return an array that is no case's own: a bound, a mask."""
        return read_array(inside(self.folder, "cases", case.id, file))

    def bugs(self, case: CaseManifest) -> Bugs:
        """Return the likely bugs of a case, checked by their hash and read once."""
        if case.id not in self._bugs:
            file = inside(self.folder, "cases", case.id, BUGS)
            try:
                self._bugs[case.id] = Bugs(self._bytes(file, case.bugs_sha256))
            except ValueError as error:
                raise DamagedError(f"{file}: cannot be read: {error}", file=str(file)) from error
        return self._bugs[case.id]

    def _bytes(self, file: Path, sha256: str) -> bytes:
        try:
            content = file.read_bytes()
        except OSError as error:
            raise DamagedError(f"{file}: cannot be read: {error.strerror}", file=str(file)) from error
        if hashlib.sha256(content).hexdigest() != sha256:
            raise DamagedError(f"{file}: expected the bytes of its manifest's sha256, got others: a damaged kit",
                               file=str(file))
        return content


def inside(folder: Path, *names: str) -> Path:
    """Return a file of a kit; DamagedError if its name, or a link on the way, leads out of the kit."""
    file = folder.joinpath(*names)
    try:
        if all(map(str.isprintable, names)) and file.resolve().is_relative_to(folder.resolve()):
            return file
    except (OSError, RuntimeError, ValueError) as error:  # a name with a null, or links in a circle
        raise DamagedError(f"{shortened(repr(str(file)))}: cannot be read: {error}", file=str(folder)) from error
    raise DamagedError(f"{folder}: expected files inside the kit, got {shortened(repr('/'.join(names)))}",
                       file=str(folder))


def _is_name(name: str) -> bool:
    fits_a_folder = 0 < len(name.encode(errors="replace")) <= LONGEST_NAME
    return fits_a_folder and name not in (".", "..") and name.isprintable() and not set(name) & set("/\\:")


def read_array(file: Path) -> Array:
    """Return an .npy file's array; DamagedError if it is none, or not of as many bytes as its header says."""
    try:
        content = io.BytesIO(file.read_bytes())
        if content.read(len(MAGIC)) != MAGIC:
            raise DamagedError(f"{file}: expected an .npy file, got one without its header", file=str(file))
        content.seek(0)
        expected, got = _bytes_said(content), content.getbuffer().nbytes - content.tell()
        if got != expected:
            raise DamagedError(f"{file}: expected the {expected:,} bytes that its header says, got {got:,}",
                               file=str(file))
        content.seek(0)
        array: Array = np.lib.format.read_array(content, allow_pickle=False)
    except DamagedError:
        raise
    except Exception as error:  # a header is an expression of Python, and raises nearly any
        raise DamagedError(f"{file}: cannot be read as .npy: {_reason(error)}", file=str(file)) from error
    return array


def _bytes_said(content: io.BytesIO) -> int:
    """Return how many bytes of elements the header says that there are, and go past it."""
    version = np.lib.format.read_magic(content)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"version {version[0]}.{version[1]}")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(content)
    if kind.hasobject or min(shape, default=0) < 0:
        raise ValueError(f"elements of {kind} in a shape {shape}")
    return math.prod(shape) * kind.itemsize


def find_array(output: Path, case: str, name: str) -> Path | None:
    """Return the file of a port's array, None where there is none."""
    files = (place / f"{name}.npy" for place in places_of_case(output, case))
    return next((file for file in files if file.is_file()), None)


def places_of_case(output: Path, case: str) -> tuple[Path, ...]:
    """Return the folders in which a port's arrays of a case are looked for; the last is a kit's own."""
    return output / case, output / case / "out", output / "cases" / case / "out"


def _reason(error: Exception) -> str:
    said = error.strerror if isinstance(error, OSError) else str(error).partition("\n")[0]
    return said or "nothing readable"
