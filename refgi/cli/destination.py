"""Where results go, made sure of before anything is computed."""

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from refgi.errors import InputError, expect
from refgi.image import is_text

if TYPE_CHECKING:
    import numpy.typing as npt

SUFFIXES = (".exr", ".png")


class Pictures(NamedTuple):
    """Files that one picture goes to."""

    exr: Path | None
    png: Path | None


def picture_files(out: str, stem: str) -> Pictures:
    """Return the files for --out and make sure that they can be written.

    Parameters
    ----------
    out : str
        A name that ends in .exr or .png, or a folder, which then gets both.
    stem : str
        Name of the files in a folder.

    Returns
    -------
    Pictures
        One or both.

    Raises
    ------
    InputError
        If the name ends otherwise or its folder cannot be written.
    """
    path = Path(out)
    suffix = path.suffix.lower()
    is_folder = _is_folder(path)
    if suffix in SUFFIXES and not is_folder:
        _require(path, path.parent)
        return Pictures(path if suffix == ".exr" else None, path if suffix == ".png" else None)
    if suffix and not is_folder and not out.endswith(("/", os.sep)):
        raise InputError(f"--out {out}: expected a name that ends in .exr or .png, or a folder")
    folder(out)
    return Pictures(path / f"{stem}.exr", path / f"{stem}.png")


def folder(out: str) -> Path:
    """Make sure that a folder can be written, creating it where it is missing.

    Parameters
    ----------
    out : str
        The folder.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        If it cannot be created or written.
    """
    path = Path(out)
    _require(path, path)
    return path


def write_light(file: Path, radiance: "npt.NDArray[Any]", irradiance: "npt.NDArray[Any]", said: Any) -> None:
    """Write a picture as an EXR: R, G, B and irradiance.R, .G, .B as float32, whole or not at all.

    Parameters
    ----------
    file : Path
        Where to.
    radiance : (3, h, w) ndarray
        What the camera receives, W/m^2/sr.
    irradiance : (3, h, w) ndarray
        Indirect irradiance, W/m^2.
    said : dict
        Attributes: finite JSON values.
    """
    import numpy as np

    from refgi.image import write_exr

    planes = [*zip("RGB", radiance, strict=True),
              *((f"irradiance.{channel}", plane) for channel, plane in zip("RGB", irradiance, strict=True))]
    write_exr(file, {name: np.asarray(plane, np.float32) for name, plane in planes}, said)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:  # a name longer than the file system allows
        raise InputError(f"--out {path}: cannot be written: {error.strerror or error}") from error


def _require(asked: Path, home: Path) -> None:
    expect(is_text(str(asked)), "--out", "a name in UTF-8", str(asked))
    try:
        home.mkdir(parents=True, exist_ok=True)
        asked.exists()  # raises where the name is longer than the file system allows
        with tempfile.TemporaryFile(dir=home):
            pass
    except OSError as error:
        raise InputError(f"--out {asked}: cannot be written: {error.strerror or error}") from error
