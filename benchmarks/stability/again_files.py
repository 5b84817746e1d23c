"""Read one spoiled file again: `python -m benchmarks.stability.again_files FORMAT[-bombs] NUMBER [--keep FILE]`.

Prints what became of it, with the traceback where it was refused; --keep writes the file to look at.
"""

import argparse
import sys
import tempfile
import time
import traceback
from pathlib import Path

from benchmarks.stability.bombs import BOMBS
from benchmarks.stability.file_child import BOMB, maker
from benchmarks.stability.file_formats import BESIDE, FORMATS
from benchmarks.stability.file_trial import read_in_children
from benchmarks.stability.files import SEED


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability.again files", description=__doc__)
    parser.add_argument("format", choices=[*FORMATS, *(f"{name}-bombs" for name in BOMBS)])
    parser.add_argument("number", type=int)
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write the file there")
    options = parser.parse_args(arguments)
    name = options.format.removesuffix("-bombs")
    seed = BOMB if options.format.endswith("-bombs") else str(SEED)
    form, make = FORMATS[name], maker(FORMATS[name], name, seed)
    if options.keep:
        make(options.number, options.keep)
    found = read_in_children(name, seed, range(options.number, options.number + 1))
    for breach in found:
        print(f"{breach.kind}: {breach.text}")
    if not found:  # it ends, and within the limits
        with tempfile.TemporaryDirectory() as folder:
            for beside, content in BESIDE.items():
                (Path(folder) / beside).write_bytes(content)
            make(options.number, Path(folder) / form.file)
            _read_aloud(form, Path(folder) / form.file)
    return int(bool(found))


def _read_aloud(form, path) -> None:
    begin = time.process_time()
    try:
        form.read(path)
        print("read", end="")
    except Exception:
        traceback.print_exc()
        print("refused", end="")
    print(f" in {time.process_time() - begin:.3f} s")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
