"""Which refgi this is: its version, the commit of its source tree, and the versions of what it stands on."""

import functools
import os
import platform
import subprocess
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("refgi", "numpy", "numba", "llvmlite", "scipy", "embreex", "trimesh", "OpenEXR", "imageio", "matplotlib",
            "click", "rich", "pydantic", "jinja2", "flip-evaluator")
GIT_SECONDS = 10.0
DIRTY = "-dirty"


def versions() -> dict[str, str | None]:
    """Return the versions of Python, refgi and what it stands on.

    Returns
    -------
    dict of str to str
        None for a package that is not installed.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES}


def program() -> dict[str, str]:
    """Return which refgi this is.

    Returns
    -------
    dict of str to str
        `version`, and `git` where the package lies in its own git checkout: the commit, with "-dirty" where a file of
        the package differs from it.
    """
    commit = git_id(Path(__file__).resolve().parents[1])
    return {"version": import_module("refgi").__version__} | ({} if commit is None else {"git": commit})


@functools.cache
def git_id(package: Path) -> str | None:
    """Return the commit of the checkout that a package is part of.

    Parameters
    ----------
    package : Path
        Folder of the package.

    Returns
    -------
    str or None
        The commit's id, with "-dirty" where a file in the folder differs from it; None where git does not keep the
        folder: an installed package inside another project's checkout is not of that project.
    """
    if not _git(package, "ls-files", "__init__.py"):
        return None
    commit = _git(package, "rev-parse", "HEAD")
    changes = _git(package, "status", "--porcelain", "--", ".")
    return commit and commit + (DIRTY if changes else "")


def _git(folder: Path, *arguments: str) -> str | None:
    """Return what git says, None where there is no git or it refuses."""
    quiet = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, env=quiet | {"GIT_OPTIONAL_LOCKS": "0"},
                              capture_output=True, text=True, timeout=GIT_SECONDS, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
