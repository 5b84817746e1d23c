"""Show one case again: `python -m benchmarks.stability.again PART NAME SEED CASE`.

Prints inputs, answer, reference and error; the lines of the table end in such a command.
"""

import argparse
import importlib
import sys
import tempfile
import time
import traceback
from pathlib import Path

from benchmarks.stability.bombs import BOMBS
from benchmarks.stability.file_child import BOMB, maker, read_in_children
from benchmarks.stability.file_formats import BESIDE, FORMATS
from benchmarks.stability.files import SEED

USAGE = ("usage: python -m benchmarks.stability.again kernels|rays|files NAME SEED CASE, "
         "or files FORMAT CASE of a mutated file")


def main(arguments: list[str]) -> int:
    if arguments[:1] == ["files"] and not (len(arguments) == 4 and arguments[3].isdigit()):
        return of_file(arguments[1:])
    try:
        part, name, seed, case = arguments
        numbers = int(seed), int(case)
    except ValueError:
        print(USAGE, file=sys.stderr)
        return 2
    if part not in ("kernels", "rays", "files"):
        print(USAGE, file=sys.stderr)
        return 2
    try:
        print(importlib.import_module(f"benchmarks.stability.{part}").again(name, *numbers))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def of_file(arguments: list[str]) -> int:
    """Read one spoiled file again and print what became of it, with the traceback where it was refused."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability.again files", description=of_file.__doc__)
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
