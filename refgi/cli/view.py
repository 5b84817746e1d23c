"""The scene as the options ask for it: loaded, seen by the given camera, under the given lights."""

import dataclasses
import math
from pathlib import Path
from typing import Any

from refgi.cli.lights import read_lights
from refgi.scene import Camera, Scene, load_scene


@dataclasses.dataclass(frozen=True)
class View:
    """What the options of `options.view` say."""

    scene: str
    size: tuple[int, int] | None
    eye: tuple[float, float, float] | None
    target: tuple[float, float, float] | None
    up: tuple[float, float, float] | None
    vfov_deg: float | None
    lights: tuple[str, ...]

    def load(self) -> Scene:
        """Return the scene with its camera and lights changed as asked.

        Returns
        -------
        Scene
            Its camera's size is the picture's size.

        Raises
        ------
        InputError
            If the scene, the camera or a light is not usable.
        """
        changes = self._camera_changes()
        lights = read_lights(self.lights)
        whole = "eye" in changes and "target" in changes
        if whole and Path(self.scene).suffix.lower() in (".glb", ".gltf", ".obj", ".ply"):
            return load_scene(self.scene, camera=Camera(**changes), lights=lights)
        scene = load_scene(self.scene, lights=lights)
        return scene.with_camera(**changes) if changes else scene

    def _camera_changes(self) -> dict[str, Any]:
        changes = {key: getattr(self, key) for key in ("eye", "target", "up") if getattr(self, key) is not None}
        if self.vfov_deg is not None:
            changes["vfov"] = math.radians(self.vfov_deg)
        if self.size is not None:
            changes["width"], changes["height"] = self.size
        return changes
