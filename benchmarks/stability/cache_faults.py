"""The kernel cache: a damaged file is never run, and starts that find it empty at once share it."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from benchmarks.stability.cache_child import expected
from benchmarks.stability.tasks import Tell
from refgi.stress.rows import Row

ROOT = Path(__file__).parents[2]
STARTS = {True: 2, False: 8}
DAMAGES = {True: 200, False: 10_000}


def child(folder: Path, *arguments: str, before: str = "") -> subprocess.Popen[str]:
    """Start a process whose kernels are kept in a folder, after some Python of ours."""
    code = f"import sys\n{before}\nfrom benchmarks.stability.cache_child import main\nsys.exit(main(sys.argv[1:]))"
    environment = os.environ | {"REFGI_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], cwd=ROOT, env=environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def answer(process: subprocess.Popen[str]) -> list[float | str]:
    """Return what a process printed when it has ended."""
    said, complaint = process.communicate()
    if process.returncode:
        raise RuntimeError(f"exit {process.returncode}: {complaint[-500:]}")
    return list(json.loads(said))


def damaged(short: bool, tell: Tell, before: str = "") -> Iterable[Row]:
    """Yield the row of a kernel's file with flipped bits, cuts and zeros."""
    seed, times = 19, DAMAGES[short]
    with tempfile.TemporaryDirectory() as folder:
        try:
            taken, first = answer(child(Path(folder), "damage", str(times), str(seed), before=before))
        except RuntimeError as error:  # machine code that LLVM does not survive
            taken, first = 1.0, str(error)
    tell(f"{taken} of {times} taken for a kernel {first}")
    yield Row(part="faults", property="a damaged kernel is compiled anew", subject="kernel cache",
              domain="a bit, a cut or zeros anywhere, machine code included", figure=float(taken), unit="taken",
              limit=0, kind="exact", source="SHA-256 at its end", cases=times, seed=seed, detail=str(first),
              reproduce=f"python -m benchmarks.stability.cache_child damage {times} {seed}")


def cold_starts(short: bool, tell: Tell, before: str = "") -> Iterable[Row]:
    """Yield the row of several starts that find the cache empty, and one more that finds it filled."""
    count = STARTS[short]
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        processes = [child(Path(folder), "call", before=before) for _ in range(count)]
        results = [answer(process)[0] for process in processes]
        result, hits = answer(child(Path(folder), "call", before=before))
        faults += [f"a start gave {one}" for one in [*results, result] if one != expected()]
        faults += ["the last start found no kernel"] if hits != 1 else []
        faults += [f"left {file.name}" for file in Path(folder).iterdir() if file.suffix != ".kernel"]
    tell("; ".join(faults) or f"{count} cold starts as promised")
    yield Row(part="faults", property="cold starts share an empty cache", subject="kernel cache",
              domain=f"{count} at once, and one after them", figure=len(faults), unit="breaches", limit=0, kind="exact",
              source="the value by Python; one file is left", cases=count + 1, detail="; ".join(faults)[:500],
              reproduce="python -m benchmarks stability --part faults --out out/stability")
