"""What a paper's figures look at: its scenes by name, and frames of them in units of the run's size."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from refgi.frame import Frame

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.scene import Scene

SMALLEST = 8  # pixels along a side, however small a run is


class Subjects(NamedTuple):
    """The stand-ins of one paper; a name that is not theirs is one that `load_scene` takes."""

    builders: "Mapping[str, Callable[[], Scene]]"

    def scene_of(self, bench: "Workbench", name: str) -> "Scene":
        """Return a stand-in or a built-in scene.

        Parameters
        ----------
        bench : Workbench
            Keeps it.
        name : str
            A name of `builders`, or what `load_scene` takes.

        Returns
        -------
        Scene
            As it was built.
        """
        build = self.builders.get(name)
        return bench.scene(name) if build is None else bench.once(("stand-in", build), build)

    def frame_of(self, bench: "Workbench", name: str, factor: float = 1, **options: Any) -> Frame:
        """Return a frame of a scene.

        Parameters
        ----------
        bench : Workbench
            Keeps the frame.
        name : str
            As for `scene_of`.
        factor : float
            As for `seen_by`.
        **options : object
            As for `seen_by`.

        Returns
        -------
        Frame
            Its buffers stay once they are computed.
        """
        scene = self.scene_of(bench, name)
        return bench.once(("view", name, factor, *sorted(options.items())),
                          lambda: seen_by(bench, scene, factor, **options))


def seen_by(bench: "Workbench", scene: "Scene", factor: float = 1, *, wide: float = 1, **options: Any) -> Frame:
    """Return a fresh frame of a scene whose camera, bodies or light may have moved.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    scene : Scene
        What is seen.
    factor : float
        Height of the picture, in units of the run's.
    wide : float
        Width of the picture, in units of its height.
    **options : object
        Passed to `Frame`.

    Returns
    -------
    Frame
        Nothing is computed yet.
    """
    height = factor * bench.scale.size
    return Frame(scene, width=max(SMALLEST, round(wide * height)), height=max(SMALLEST, round(height)),
                 rsm_resolution=bench.scale.rsm_resolution, **options)
