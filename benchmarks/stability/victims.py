"""Commands that are killed at work: what they are asked for, what stood in their folder, and what must hold after."""

import hashlib
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.kill_batch import is_whole
from benchmarks.stability.victim_host import Host
from refgi.image import read_exr

SMALL = ["cornell_box", "--size", "64x48", "--rsm-resolution", "64"]
WAY = """curve = "linear"
[[camera]]
at = 0.0
eye = [0.0, 1.0, 3.2]
[[camera]]
at = 1.0
eye = [0.1, 1.0, 3.0]
"""
FRAMES = 6
# a pass takes a moment here, and one that is not saved is done again
SAVE_EVERY_PASS = "import refgi.truth.checkpoint as c; c.SECONDS_BETWEEN = 0"


class Victim(NamedTuple):
    """A command that is killed."""

    arguments: list[str]  # run in the folder that holds `out`
    resumes: bool = False  # so that what a kill leaves is what the next run begins with
    before: tuple[str, ...] = ()  # the command whose files it overwrites
    patch: str = ""  # Python of its host


VICTIMS: dict[str, Victim] = {
    "render": Victim(["render", *SMALL, "--set", "lights=64", "--out", "out"],
                     before=("render", *SMALL, "--set", "lights=16", "--out", "out")),
    "compare": Victim(["compare", *SMALL, "--methods", "sii", "--set", "truth.samples=48", "--out", "out"],
                      before=("compare", *SMALL, "--methods", "sii", "--set", "truth.samples=24", "--out", "out"),
                      patch="import sys; sys.modules['flip_evaluator'] = None"),  # a process of its own, and slow
    "sequence": Victim(["sequence", *SMALL, "way.toml", "--frames", str(FRAMES), "--method", "sii", "--temporal",
                        "weight=0.5", "--resume", "--out", "out"], resumes=True),
    "checkpoint": Victim(["render", *SMALL, "--method", "truth", "--set", "samples=960", "--set",
                          "checkpoint=out/light.truth", "--out", "out/a.exr"], resumes=True, patch=SAVE_EVERY_PASS),
}


class Stand(NamedTuple):
    """A folder in which a victim works, and what is known of it."""

    folder: Path
    known: dict[str, set[str]]  # what files may hold, by name: digests of planes

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def renew(self) -> None:
        """Remove all that was written."""
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir(parents=True)
        (self.folder / "way.toml").write_text(WAY)

    def torn(self) -> list[str]:
        """Return files under their final names that are not whole, or hold what no undisturbed run gives."""
        return [file.name for file in self._files() if not (is_whole(file) and self._is_known(file))]

    def parts(self) -> list[str]:
        """Return unfinished files."""
        return [file.name for file in self.folder.rglob("*.part*")]

    def digests(self) -> dict[str, str]:
        """Return what the files hold, by name."""
        return {file.name: digest(file) for file in self._files()}

    def _files(self) -> list[Path]:
        return [file for file in self.out.rglob("*") if file.is_file() and ".part" not in file.name]

    def _is_known(self, file: Path) -> bool:
        known = self.known.get(file.name)
        return known is None or digest(file) in known


def digest(file: Path) -> str:
    """Return a hash of a picture's planes, or of a file's bytes; of JSON and pages, which hold times, of nothing."""
    found = hashlib.sha256()
    if file.suffix == ".exr":
        for name, plane in sorted(read_exr(file)[0].items()):
            found.update(name.encode() + np.ascontiguousarray(plane).tobytes())
    elif file.suffix == ".png":
        from refgi.image import read_png_attributes

        content = file.read_bytes()
        found.update(content[content.index(b"IDAT"):])
        assert read_png_attributes(file) is not None
    return found.hexdigest()


class Undisturbed(NamedTuple):
    """A victim's run to its end."""

    seconds: float  # since it heeded signals
    files: int  # that were seen unfinished
    whole: dict[str, str]  # what its files hold, by name


def undisturbed(name: str, stand: Stand, host: Host) -> Undisturbed:
    """Run a victim to its end twice; the first may compile."""
    seconds, files = 0.0, 0
    for _ in range(2):
        stand.renew()
        code, said, seconds, files = host.timed(VICTIMS[name].arguments, stand.folder)
        if code != 0:
            raise RuntimeError(f"{name} undisturbed: exit {code}: {said[-500:]}")
    return Undisturbed(seconds, files, stand.digests())


def with_old_files(name: str, stand: Stand, host: Host) -> None:
    """Fill the folder with what the victim will overwrite."""
    if VICTIMS[name].before:
        code, said = host.run(VICTIMS[name].before, stand.folder)
        if code != 0:
            raise RuntimeError(f"{name}, what was before: exit {code}: {said[-500:]}")


def allowed(*kinds: dict[str, Any]) -> dict[str, set[str]]:
    """Return what each file may hold: what one of some undisturbed runs gave it."""
    return {name: {kind[name] for kind in kinds if name in kind} for name in {key for kind in kinds for key in kind}}
