"""Which methods' sources differ from those of an earlier commit."""

import os
import subprocess
from collections.abc import Iterable
from pathlib import Path

import refgi
from refgi.batch.code import RUNNERS, SHARED, file_of, place_of, reached, source_digest
from refgi.errors import InputError

PACKAGE = Path(refgi.__file__).parent


def changed_methods(methods: Iterable[str], commit: str) -> dict[str, list[str]]:
    """Return by method which modules of those that it reaches changed since a commit; methods without are left out.

    Comments and docstrings count for nothing. InputError if refgi lies in no git checkout or there is no such commit.
    """
    changed = _changed_files(commit)
    found = {}
    for method in methods:
        modules = set(RUNNERS).union(*(reached(place) for place in (*SHARED, place_of(method))))
        own = sorted(module for module in modules if file_of(module).resolve() in changed)
        if own:
            found[method] = own
    return found


def _changed_files(commit: str) -> set[Path]:
    """Return files of the package whose code is not that of a commit."""
    root = Path(_git(PACKAGE, "rev-parse", "--show-toplevel").strip())
    _git(root, "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}")
    named = _git(root, "diff", "--name-only", "-z", commit, "--", str(PACKAGE))
    files = [name for name in named.split("\0") if name.endswith(".py")]  # one that imports a new file is among them
    return {(root / name).resolve() for name in files if _differs(root, name, commit)}


def _differs(root: Path, name: str, commit: str) -> bool:
    file = root / name
    try:
        before = _git(root, "show", f"{commit}:{name}")
    except InputError:
        return True  # a new file
    return not file.exists() or source_digest(file.read_bytes()) != source_digest(before.encode())


def _git(folder: Path, *arguments: str) -> str:
    quiet = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    try:
        return subprocess.run(["git", *arguments], cwd=folder, env=quiet, capture_output=True, text=True,
                              check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        said = " ".join((getattr(error, "stderr", "") or str(error)).split())
        raise InputError(f"--since: git {' '.join(arguments)}: {said or 'no such commit'}", key="--since") from error
