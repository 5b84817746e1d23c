"""Frames of a scene that changes: what rests since the frame before is not computed again.

Each frame is the picture that `render` makes of its scene, to the bit. Buffers, pixel lights, clusters, maps and lists
whose inputs rest are those of the frame before, and the memory of what has changed serves the next frame.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from refgi import stages
from refgi.diagnostics import FrameSession, SamplingError
from refgi.methods import Picture, render
from refgi.scene import load_scene

if TYPE_CHECKING:
    from refgi.scene import Scene

PICTURE = "animation.picture"  # under which a memory keeps the last pictures


class Animation:
    """Pictures of a scene that changes, by one method of `METHODS`; `settings` default to the method's.

    `frame_options` go to `Frame`. `scene` is that of the last frame, from which the next one follows (`with_camera`,
    `with_lights`); `runs` are that frame's stages, run or reused, none where all rests.
    """

    def __init__(self, scene: "Scene", method: str = "sii", settings: Any = None, **frame_options: Any) -> None:
        self.scene = scene
        self.runs: list[stages.Run] = []
        self._options = (method, settings, frame_options)
        self._memory = stages.Memory()
        self._session = FrameSession()
        self._sampling_error: SamplingError | None = None

    def render(self, scene: "Scene | None" = None) -> Picture:
        """Render the next frame, of the scene as it was where `scene` is absent.

        After an `InputError` the next frame may be rendered all the same. The same object as before where the scene is
        that of the frame before. Its arrays are shared with other frames: they are to be read, not written. Its
        sampling error is that of the last frame that had diagnostics: the first one, or one with other objects,
        materials or number of lamps.
        """
        method, settings, frame_options = self._options
        scene = self.scene if scene is None else scene
        with stages.reusing(self._memory) as runs:
            picture: Picture
            rests, picture = self._memory.recall(PICTURE, (scene,))
            if not rests:
                picture = self._made(scene, method, settings, frame_options)
                self._memory.keep(PICTURE, (scene,), picture)
        self.scene, self.runs = scene, runs
        return picture

    def _made(self, scene: "Scene", method: str, settings: Any, frame_options: dict[str, Any]) -> Picture:
        """Render a frame, with diagnostics where those of the frame before no longer hold."""
        with self._session.frame(scene) as due:
            picture = render(scene, method, settings, **frame_options)
        if due:
            self._sampling_error = picture.sampling_error
        return picture._replace(sampling_error=self._sampling_error)

    def along(self, scenes: Iterable["Scene"]) -> Iterator[Picture]:
        """Render frames one after the other, of scenes that are taken one by one.

        Who lets go of a picture before the next one is made gives its memory to that.
        """
        for scene in scenes:
            yield self.render(scene)


def frames(scene: "Scene | str | Path", method: str = "sii", settings: Any = None, **frame_options: Any) -> Animation:
    """Begin the frames of a scene that changes.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene, or what `load_scene` takes.
    method : str
        A name of `METHODS`.
    settings : object, optional
        The method's settings; its defaults where absent.
    **frame_options : object
        Passed to `Frame`: width, height, dtype, rsm_resolution, shadows.

    Returns
    -------
    Animation
        Renders frame after frame.

    Raises
    ------
    InputError
        If the scene cannot be loaded.
    """
    return Animation(load_scene(scene) if isinstance(scene, str | Path) else scene, method, settings, **frame_options)
