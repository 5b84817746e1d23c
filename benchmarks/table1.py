"""SII Table 1: what a frame costs when light and camera move or rest, and what it reuses."""

import dataclasses
import statistics
import time
from collections.abc import Iterator

from benchmarks.harness import Row
from refgi import Frame, load_scene
from refgi.scene import Scene
from refgi.splat.sii import SiiSettings, sii
from refgi.stages import Memory, observe

# The paper's milliseconds for the same four rows.
PAPER = {"both move": 10.4, "light moves": 10.8, "camera moves": 9.3, "both rest": 6.9}


def rows(quick: bool) -> Iterator[Row]:
    frames = 4 if quick else 12
    scene = load_scene("cornell_sphere:faces=17000")
    for name in PAPER:
        seconds, reused = _animate(scene, frames, "light" in name or "both move" in name,
                                   "camera" in name or "both move" in name)
        yield Row(name, 1e3 * seconds, "ms", note=f"paper {PAPER[name]} ms; reused: {', '.join(reused) or 'nothing'}")


def _animate(scene: Scene, frames: int, light_moves: bool, camera_moves: bool) -> tuple[float, list[str]]:
    memory, spent, reused = Memory(), [], set()
    for step in range(frames + 1):
        offset = 1e-3 * step
        shown = scene
        if light_moves:
            x, y, z = scene.lights[0].position
            shown = shown.with_lights(dataclasses.replace(scene.lights[0], position=(x + offset, y, z)))
        if camera_moves:
            x, y, z = scene.camera.eye
            shown = shown.with_camera(eye=(x + offset, y, z))
        with observe(memory=memory) as log:
            started = time.perf_counter()
            frame = Frame(shown, width=512, height=512)
            sii(frame, SiiSettings(lights=256))
            spent.append(time.perf_counter() - started)
        reused = {run.name for run in log.runs if run.status == "reused"}
    return statistics.median(spent[1:]), sorted(reused)
