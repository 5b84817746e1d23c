"""Kills: whenever a process is ended, its files are whole or absent, and what goes on ends as if nothing had been.

kill -9 of render, compare, sequence --resume, a truth with checkpoint, and batch, at random moments spread over their
work and every other time while a file is written; SIGTERM and SIGINT, after which the exit code is 143 or 130, one line
says so, and no unfinished file is left.
`python -m benchmarks.stability.kills NAME TIMES SEED` does one of them again.
"""

import contextlib
import hashlib
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.kill_batch import is_whole
from benchmarks.kill_batch import killed as killed_batch
from benchmarks.stability.promise import Task, Tell
from benchmarks.stability.victim_host import Host
from refgi.image import read_exr
from refgi.stress.promises import Row

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


SEED = 19
TIMES = {"render": 50, "compare": 30, "sequence": 50, "checkpoint": 40}
SHORT_TIMES = {"render": 4}
BATCH_TIMES, BATCH_JOBS = 30, 120
ASKED = {signal.SIGTERM: (143, "terminated"), signal.SIGINT: (130, "interrupted")}
ASKED_TIMES = {True: 1, False: 12}  # each signal of each command


class Found(NamedTuple):
    """What some kills of a command did."""

    kills: int
    torn: int  # files that are not whole, or hold what no undisturbed run gives
    lost: int  # files that were there and are not, or are others
    other: int  # files of the run that was let end at last, that differ from those of an undisturbed one
    left: int  # unfinished files after that
    began: int  # unfinished files that kills left in all: how often one came while a file was written
    text: str = ""


def tasks(short: bool) -> list[Task]:
    """Return a task a command that is killed and asked to end."""
    times = SHORT_TIMES if short else TIMES
    batch = [] if short else [Task("batch", _batch_task)]
    return [Task(name, partial(_task, name, number, ASKED_TIMES[short])) for name, number in times.items()] + batch


class Prepared(NamedTuple):
    """A command that can be started again and again."""

    name: str
    host: Host
    stand: Stand  # knows what files may hold
    run: Undisturbed


@contextlib.contextmanager
def prepared(name: str, patch: str = "") -> Iterator[Prepared]:
    """Open a host that has run a command undisturbed, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder, Host(f"{VICTIMS[name].patch}\n{patch}") as host:
        stand = Stand(Path(folder) / "work", {})
        run = undisturbed(name, stand, host)
        stand.renew()
        with_old_files(name, stand, host)
        yield Prepared(name, host, stand._replace(known=allowed(run.whole, stand.digests())), run)


def killed(prepared: Prepared, times: int, seed: int) -> Found:
    """Kill a command some times at random moments, let it end, and count what is not as promised."""
    name, host, stand, (seconds, files, whole) = prepared
    victim = VICTIMS[name]
    moments = random.Random(seed)
    torn = lost = began = 0
    texts: list[str] = []
    for number in range(times):
        if not victim.resumes or number == 0 or stand.digests() == whole:
            stand.renew()
            with_old_files(name, stand, host)
        before = stand.digests()
        # every other one and the last come while a file is written, where that can be seen
        at_file = moments.randint(1, files) if files and (times - number) % 2 else 0
        after = 1.1 * seconds * (number + moments.random()) / times
        host.run(victim.arguments, stand.folder, end=signal.SIGKILL, after=after, at_file=at_file)
        now, broken = stand.digests() if not (found := stand.torn()) else {}, found
        began += len(stand.parts())
        torn += len(broken)
        gone = [file for file in before if not broken and file not in now]
        gone += [file for file in before if victim.resumes and file in now and file.endswith(".exr")
                 and now[file] != before[file]]
        lost += len(gone)
        texts += [f"kill {number}: torn {broken}, lost {gone}"] if broken or gone else []
    code, said = host.run(victim.arguments, stand.folder)
    texts += [f"at last exit {code}: {said[-300:]}"] if code else []
    end = stand.digests()
    other = sum(end.get(file) != content for file, content in whole.items())
    return Found(times, torn, lost, other + (code != 0), len(stand.parts()), began, "; ".join(texts)[:600])


def asked(prepared: Prepared, number: signal.Signals, times: int, seed: int) -> list[str]:
    """Ask a command to end at random moments, and return what is not as promised."""
    name, host, stand, (seconds, _, whole) = prepared
    moments, faults = random.Random(seed + number), []
    code_promised, word = ASKED[number]
    victim = VICTIMS[name]
    for turn in range(times):
        stand.renew()
        with_old_files(name, stand, host)
        moment = seconds * (turn + moments.random()) / times
        code, said = host.run(victim.arguments, stand.folder, end=number, after=moment)
        torn = stand.torn()
        is_done = not torn and stand.digests() == whole
        heeded = code == code_promised and f"refgi: {word}" in said.splitlines() and "Traceback" not in said
        if not (heeded or (is_done and code in (0, -number))):
            faults.append(f"{turn}, after {moment:.3f} s: exit {code}: {said[-300:]}")
        faults += [f"{turn}, after {moment:.3f} s: left {part}" for part in stand.parts()]
        faults += [f"{turn}, after {moment:.3f} s: torn {file}" for file in torn]
    return faults


def _task(name: str, times: int, times_asked: int, tell: Tell) -> Iterable[Row]:
    with prepared(name) as victim:
        found = killed(victim, times, SEED)
        tell(str(found))
        yield from rows_of(name, found, f"python -m benchmarks.stability.kills {name} {times} {SEED}")
        for number, (code, _) in ASKED.items():
            faults = asked(victim, number, times_asked, SEED)
            tell(f"{number.name}: {faults or 'as promised'}")
            yield _row(f"{number.name}: exit {code}, one line, no unfinished file", name, "any moment of its work",
                       len(faults), "breaches", times_asked,
                       f"python -m benchmarks.stability.kills {name} {times_asked} {SEED}", "; ".join(faults)[:600])


def rows_of(name: str, found: Found, again: str) -> Iterator[Row]:
    """Return the rows of some kills."""
    domain = f"kill -9 at any moment; {found.began} of {found.kills} while a file was written"
    for promise, figure, unit in (
        ("killed: each file is whole, old or new", found.torn + found.lost, "files torn or lost"),
        ("killed: the next run ends as if undisturbed", found.other, "files that differ"),
        ("killed: the next run removes unfinished files", found.left, "files left"),
    ):
        yield _row(promise, name, domain, figure, unit, found.kills, again, found.text)


def _batch_task(tell: Tell) -> Iterable[Row]:
    with tempfile.TemporaryDirectory() as folder:
        tally = killed_batch(Path(folder), BATCH_TIMES, 2, 2.0, SEED, BATCH_JOBS)
    tell(str(tally))
    again = f"python -m benchmarks kill-batch --times {BATCH_TIMES} --seed {SEED} --longest 2"
    domain = "kill -9 of the first process at any moment, 2 workers"
    yield _row("killed: each file is whole, old or new", "batch", domain, tally.lost + tally.torn,
               "files torn or lost", tally.kills, again, str(tally))
    yield _row("killed: no worker outlives the batch", "batch", domain, tally.stray, "kills", tally.kills, again)
    yield Row(part="kills", property="killed: jobs to be done again", subject="batch", domain=domain,
              figure=tally.most_repeated, unit="jobs a kill", limit=2, kind="exact", source="one a worker",
              cases=tally.kills, seed=SEED, reproduce=again)


def _row(promise: str, name: str, domain: str, figure: int, unit: str, cases: int, again: str,
         text: str = "") -> Row:
    return Row(part="kills", property=promise, subject=name, domain=domain, figure=figure, unit=unit, limit=0,
               kind="exact", source="written under another name, then renamed", cases=cases, seed=SEED,
               reproduce=again, detail=text)


def main(arguments: list[str]) -> int:
    name, times, seed = arguments
    with prepared(name) as victim:
        found = killed(victim, int(times), int(seed))
        print(found)
        faults = [fault for number in ASKED for fault in asked(victim, number, int(times), int(seed))]
    print(*faults, sep="\n")
    return int(bool(faults or found.torn or found.lost or found.other or found.left))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
