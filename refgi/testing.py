"""For pytest suites of ports: assertions on stages and pictures, and kits made once.

`assert_stage_close(my_flux, "sii-warp-a", "rsm.reflected_flux0.flux")` judges one array by the quick kit, which is
made on first use;
`stages(scene, "val", folder=...)` gives the arrays of every stage of any scene and settings;
`pytest_plugins = ["refgi.testing"]` in a conftest.py gives the fixture `refgi_kit`.
"""

import functools
import hashlib
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.errors import InputError, RefgiWarning, expect
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.scene import Scene
    from refgi.sssil.settings import TemporalSettings
    from refgi.vectors.check import Kit

KIT_FOLDER = "REFGI_KIT"  # environment variable: a kit to use in place of one made here
ABOVE = ("cli", "testing.py", "batch", "stress", "bench", "compare")  # of refgi: what no kit depends on

try:
    import pytest
except ImportError:  # assertions work without
    pytest = None  # type: ignore[assignment]


def kit_folder(kit: str = "quick") -> Path:
    """Return the folder of a kit, which is made on first use and kept in the cache, by a hash of what makes it.

    Parameters
    ----------
    kit : {"quick", "full"}
        Which kit; the folder that the environment variable REFGI_KIT names takes its place.

    Returns
    -------
    Path
        A kit.
    """
    from refgi.jit.cache import cache_root
    from refgi.vectors.export import export_kit
    from refgi.vectors.manifest import KIT, VERSION

    if os.environ.get(KIT_FOLDER):
        return Path(os.environ[KIT_FOLDER])
    folder = cache_root() / "kits" / f"{kit}-{VERSION}-{_digest()[:12]}"
    if not (folder / KIT).is_file():
        with _made_by_one(folder):
            if not (folder / KIT).is_file():
                export_kit(kit, folder)
    return folder


def assert_stage_close(
    got: npt.ArrayLike, case: str, name: str, *, tier: str = "T1", kit: "Kit | None" = None
) -> None:
    """Assert that an array of a port is what a kit expects.

    Parameters
    ----------
    got : array_like
        What the port has.
    case : str
        Id of a case, such as "sii-warp-a".
    name : str
        Name of an array, such as "rsm.reflected_flux0.flux".
    tier : {"T0", "T1", "T2", "T2B", "R11G11B10F", "RGB9E5"}
        Equal; float32 rounding; storage in half floats; in 8 bits where they fit; in packed floats.
    kit : Kit, optional
        The kit; the quick one where absent.

    Raises
    ------
    AssertionError
        If it is not, with the worst element, both values, the bound and likely causes.
    InputError
        If there is no such case or array.
    """
    from refgi.vectors.check import stage_of_array

    opened = quick_kit() if kit is None else kit
    verdict = stage_of_array(opened, case, name, np.asarray(got), tier)
    if verdict.verdict in ("out", "invalid"):
        from refgi.vectors.report import story

        raise AssertionError("\n".join(story(verdict)))
    if verdict.verdict == "not-judged":
        warnings.warn(RefgiWarning(f"{case}/{name}: not judged: {verdict.arrays[0].said}"), stacklevel=2)


class StageData(Mapping[str, Array]):
    """Arrays of every stage of a method on a scene, by name, as `stages` makes them: a kit of one case."""

    def __init__(self, kit: "Kit") -> None:
        from refgi.vectors.kit import Asked

        self.kit = kit
        self.case, = kit.cases(Asked())

    def __getitem__(self, name: str) -> Array:
        if name not in self.case.arrays:
            raise KeyError(name)
        return self.kit.array(self.case, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.case.arrays)

    def __len__(self) -> int:
        return len(self.case.arrays)

    def assert_close(self, got: npt.ArrayLike, name: str, *, tier: str = "T1") -> None:
        """Assert that an array of a port is what it should be; tiers and errors as for `assert_stage_close`."""
        assert_stage_close(got, self.case.id, name, tier=tier, kit=self.kit)


def stages(
    scene: "Scene | str | Path | Sequence[Scene | str | Path]", method: str = "sii", settings: Any = None, *,
    folder: str | Path, only: str = "", temporal: "TemporalSettings | None" = None, **options: Any,
) -> StageData:
    """Return what every stage of a method reads and writes on a scene, with the bounds of a port's arrays.

    Parameters
    ----------
    scene : Scene, str, Path or sequence of these
        A scene, or what `refgi.scene.load_scene` takes; the scenes of all frames up to the one that is asked for.
    method : str
        Short name of the method.
    settings : object, optional
        Its settings; its defaults where absent.
    folder : str or Path
        Where the arrays are written: a kit, such as below pytest's `tmp_path_factory`.
    only : str
        Start of the names of stages to keep; all where empty.
    temporal : TemporalSettings, optional
        The filter that blends the last frame's light with that of those before; none where absent.
    **options : object
        As of `refgi.methods.render`: width, height, rsm_resolution, shadows.

    Returns
    -------
    StageData
        Arrays by name.
    """
    from refgi.scene import load_scene
    from refgi.vectors.check import Kit
    from refgi.vectors.export import export_case
    from refgi.vectors.frames import frame_case

    every = scene if isinstance(scene, Sequence) and not isinstance(scene, str) else [scene]
    scenes = [load_scene(one) if isinstance(one, str | Path) else one for one in every]
    expect(len(scenes) > 0, "scene", "a scene, or one or more of a sequence", "none")
    expect(len(scenes) > 1 or temporal is None, "temporal", "the scenes of two frames or more to blend", "one")
    export_case(frame_case(method, scenes, method, settings, temporal, only=only, **options), Path(folder))
    return StageData(Kit(Path(folder)))


def assert_image_close(
    picture: npt.ArrayLike, reference: npt.ArrayLike, *, variance: npt.ArrayLike | None = None,
    own_variance: npt.ArrayLike | None = None, tolerance: float = 0.0, report: str | Path | None = None,
) -> None:
    """Assert that a picture is its reference, to a tolerance or to the noise of both.

    Parameters
    ----------
    picture, reference : (3, h, w) array_like
        Linear values, of one unit.
    variance, own_variance : (3, h, w) array_like, optional
        Variance of the reference's mean, and of the picture's: a z-test of pixels and sum.
    tolerance : float
        Largest RMSE above the noise, as a share of the reference's mean.
    report : str or Path, optional
        Folder for picture.exr, reference.exr and difference.exr on failure.

    Raises
    ------
    AssertionError
        If it is not, with RMSE, noise, the worst pixel and likely causes.
    """
    from refgi.vectors.judge import judge_picture

    got, expected = np.asarray(picture), np.asarray(reference)
    its, own = (None if one is None else np.asarray(one) for one in (variance, own_variance))
    verdict = judge_picture(got, expected, its, own, tolerance)
    if not verdict.close:
        lines = [f"the picture is not its reference: {verdict.said}", *(f"likely: {one}" for one in verdict.causes)]
        if report is not None:
            lines.append(f"pictures: {_written(Path(report), got, expected)}")
        raise AssertionError("\n".join(lines))


@functools.cache
def quick_kit() -> "Kit":
    """Return the quick kit, opened."""
    from refgi.vectors.check import Kit

    return Kit(kit_folder())


if pytest is not None:
    @pytest.fixture(scope="session")
    def refgi_kit() -> "Kit":
        """Return the quick kit, made once and kept."""
        return quick_kit()


def _written(folder: Path, got: Array, expected: Array) -> Path:
    from refgi.image import write_exr

    folder.mkdir(parents=True, exist_ok=True)
    for name, planes in (("picture", got), ("reference", expected), ("difference", got - expected)):
        write_exr(folder / f"{name}.exr", dict(zip("RGB", planes.astype(np.float32), strict=True)))
    return folder


def _digest() -> str:
    """Return a hash of the sources that a kit is made by."""
    import refgi

    total, home = hashlib.sha256(), Path(refgi.__file__).parent
    for file in sorted(home.rglob("*")):
        if file.suffix in (".py", ".bugs") and file.relative_to(home).parts[0] not in ABOVE:
            total.update(file.read_bytes())
    return total.hexdigest()


@contextmanager
def _made_by_one(folder: Path) -> Iterator[None]:
    """Let one process at a time make a kit."""
    import fcntl

    folder.parent.mkdir(parents=True, exist_ok=True)
    with (folder.parent / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
        except OSError as error:
            raise InputError(f"{folder}: cannot be locked: {error.strerror}") from error
        yield
