"""Show one case again: `python -m benchmarks.stability.again PART NAME SEED CASE`.

Prints inputs, answer, reference and error; the lines of the table end in such a command.
"""

import importlib
import sys

from benchmarks.stability import again_files

USAGE = ("usage: python -m benchmarks.stability.again kernels|rays|files NAME SEED CASE, "
         "or files FORMAT CASE of a mutated file")


def main(arguments: list[str]) -> int:
    if arguments[:1] == ["files"] and not (len(arguments) == 4 and arguments[3].isdigit()):
        return again_files.main(arguments[1:])
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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
