"""Where results go, made sure of before anything is computed and made only when there is something to write."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from refgi.errors import InputError, blame, expect
from refgi.image import is_from_refgi, is_text

SUFFIXES = (".exr", ".png")


class Permission(NamedTuple):
    """What may be done to put results where they are asked for."""

    parents: bool = False  # make every missing folder, not the last alone
    force: bool = False  # overwrite files of other programs


class Pictures(NamedTuple):
    """Files that one picture goes to."""

    exr: Path | None = None
    png: Path | None = None

    @property
    def files(self) -> list[Path]:
        """Those that are to be written."""
        return [file for file in self if file is not None]

    def make_folder(self) -> None:
        """Make the folder that the files lie in where it is missing."""
        for file in self.files:
            make(file.parent)


def picture_files(out: str, stem: str, permission: Permission) -> Pictures:
    """Return the files for --out and make sure that they can be written.

    `out`: a name that ends in .exr or .png, or a folder, which then gets both, named by `stem`. InputError if the name
    ends otherwise, or its folder or file cannot be written or must not.
    """
    path = Path(out)
    suffix = path.suffix.lower()
    with blame(key="--out"):
        is_folder = _is_folder(path)
        if suffix in SUFFIXES and not is_folder:
            _require(path, path.parent, permission)
            _spare(path, [path], permission)
            return Pictures(path if suffix == ".exr" else None, path if suffix == ".png" else None)
        if suffix and not is_folder and not out.endswith(("/", os.sep)):
            raise InputError(f"--out {out}: expected a name that ends in .exr or .png, or a folder")
    folder(out, permission, (stem + suffix for suffix in SUFFIXES))
    return Pictures(path / f"{stem}.exr", path / f"{stem}.png")


def folder(out: str, permission: Permission, names: Iterable[str] = ()) -> Path:
    """Make sure that files can be written into a folder, none over another program's; it is not made yet."""
    expect(out != "", "--out", "a name", out)
    path = Path(out)
    with blame(key="--out"):
        _require(path, path, permission)
        if _is_folder(path):
            _spare(path, (path / name for name in names), permission)
    return path


def make(folder: Path) -> None:
    """Make a folder that `folder` or `picture_files` found possible; InputError if it cannot be any more."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:  # a name longer than the file system allows
        raise _unwritable(path, error) from error


def _require(asked: Path, home: Path, permission: Permission) -> None:
    """Refuse a name that is no text, a folder that must not be made, and one that cannot be written."""
    expect(is_text(str(asked)), "--out", "a name in UTF-8", str(asked))
    try:
        _is_there(asked)
        nearest = home
        while not _is_there(nearest):
            nearest = nearest.parent
        if nearest not in (home, home.parent) and not permission.parents:
            raise InputError(f"--out {asked}: there is no folder {home.parent}; --parents makes it")
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise _unwritable(asked, error) from error


def _is_there(path: Path) -> bool:
    """Return whether a path exists; a name too long, or below a file, raises."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    return True


def _spare(asked: Path, files: Iterable[Path], permission: Permission) -> None:
    """Refuse to overwrite what refgi did not write, and pipes and the like, which stay what they are."""
    for file in files:
        if file.exists() and not file.is_file():
            raise InputError(f"--out {asked}: expected a new name or a file, got {file}, which is neither",
                             file=str(file))
        if not permission.force and file.exists() and not is_from_refgi(file):
            raise InputError(f"--out {asked}: {file} is there and not from refgi; --force overwrites it",
                             file=str(file))


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"--out {path}: cannot be written: {error.strerror or error}")
