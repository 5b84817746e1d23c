"""Judge a port's arrays by the kit that this file lies in: python kit/check.py my_output/ [options].

Python 3.10 or newer and NumPy alone. `python kit/check.py --help` lists the options, README.md explains them. Exit
codes: 0 all within their bounds, 1 a stage is out, 2 a wrong option or no such folder, 4 not comparable, 5 kit or
output damaged.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from refgi.errors import InputError
from refgi.vectors.check import DAMAGED, asked_from, check_output
from refgi.vectors.kit import DamagedError, Kit
from refgi.vectors.manifest import text_of
from refgi.vectors.options import OPTIONS
from refgi.vectors.report import github, report, write_junit


def main(arguments: list[str] | None = None) -> int:
    """Return the exit code of a check."""
    parser = argparse.ArgumentParser(description=str(__doc__), formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", help="The port's arrays: OUTPUT/<case>/<array>.npy.")
    parser.add_argument("--kit", default=str(Path(__file__).parent), help="Another kit.")
    for one in OPTIONS:
        if not one.metavar:
            parser.add_argument(one.flag, dest=one.key, help=one.help, action="store_true")
        elif "|" in one.metavar:
            choices = one.metavar.split("|")
            parser.add_argument(one.flag, dest=one.key, help=one.help, choices=choices, default=choices[0])
        else:
            how: dict[str, Any] = {"action": "append", "default": []} if one.many else {}
            parser.add_argument(one.flag, dest=one.key, help=one.help, metavar=one.metavar, **how)
    options = vars(parser.parse_args(arguments))
    try:
        result = check_output(Kit(Path(options["kit"])), Path(options["output"]), asked_from(options))
        if options["json_file"]:
            Path(options["json_file"]).write_text(text_of(result), encoding="utf-8")
        if options["junit_file"]:
            write_junit(options["junit_file"], result)
    except (InputError, OSError) as error:
        print(f"check.py: {error}", file=sys.stderr)
        return DAMAGED if isinstance(error, DamagedError) else 2
    print(github(result) if options["form"] == "github" else report(result))
    return result.exit_code


if __name__ == "__main__":
    sys.exit(main())
