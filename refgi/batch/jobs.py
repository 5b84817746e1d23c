"""Jobs of a plan, each named by what its result depends on: one method and choice of settings on one frame of a scene.

The name is a SHA-256 of the scene as that frame shows it, the picture's size, all settings of the method and of its
truth, the seeds, the sources that they reach (`refgi.batch.code`) and the packages that compute.
"""

import dataclasses
import functools
import hashlib
import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

from refgi.batch.code import RUNNERS, SHARED, code_key, place_of
from refgi.batch.plan import FRAME, Plan
from refgi.bench.grid import Choice
from refgi.bench.measure import REFERENCE_SEED, stop
from refgi.errors import expect
from refgi.image import canonical_json
from refgi.methods import METHODS
from refgi.provenance import plain, versions
from refgi.provenance.record import geometry_digest, light_json, materials_digest
from refgi.scene import Scene, load_scene
from refgi.scene.path import scenes_along
from refgi.scene.pathfile import read_path
from refgi.sssil.settings import TemporalSettings
from refgi.truth import TruthSettings

FORMAT = "job 1"  # of a result; another one makes every job another
COMPUTING = ("numpy", "numba", "llvmlite", "scipy", "embreex", "flip-evaluator")
NAME = 24  # hexadecimal digits of a name


class Shot(NamedTuple):
    """One frame of one scene: what is seen."""

    scene: str  # its name in the plan
    source: str  # what `load_scene` takes
    size: tuple[int, int] | None
    path: str | None = None  # TOML file
    frame: int = 0
    frames: int = 1

    @property
    def name(self) -> str:
        """The scene, and on a path the frame."""
        return self.scene if self.path is None else f"{self.scene}{FRAME}{self.frame}"


class Job(NamedTuple):
    """One method with one choice of settings on one frame."""

    name: str  # of its result
    shot: Shot
    choice: Choice
    seeds: tuple[int, ...]
    scene_key: str
    before: str | None = None  # job of the frame before, whose light a temporal filter blends with this one's
    temporal: TemporalSettings | None = None

    @property
    def label(self) -> str:
        """What is said of it."""
        return f"{self.shot.name} {self.choice.method} ({self.choice.label})"

    @property
    def picture(self) -> str:
        """EXR of the first seed, from the folder of the batch."""
        return picture_of(self.shot, self.choice.method, self.name)


def jobs_of(plan: Plan) -> list[Job]:
    """Return all jobs of a plan in the order of scenes, frames and choices; its scenes are loaded."""
    _loaded.cache_clear()
    return [job for name, source in plan.scenes.items() for job in _of_scene(plan, name, source)]


def scene_at(shot: Shot) -> Scene:
    """Return the scene as the path leaves it at a frame, its camera of the picture's size."""
    return next(itertools.islice(_scenes(shot), shot.frame, None))


def key_of_scene(scene: Scene) -> str:
    """Return a digest, 64 hexadecimal digits, of all of a scene that a picture depends on, its camera's size too."""
    return _digest([geometry_digest(scene), materials_digest(scene), plain(scene.camera),
                    [light_json(light) for light in scene.lights]])


def reference_settings(truth: TruthSettings, shot: Shot) -> TruthSettings:
    """Return how the truth of a frame is traced: with a seed that no job has, another in each frame."""
    return dataclasses.replace(truth, seed=REFERENCE_SEED + shot.frame, checkpoint=None)


def _of_scene(plan: Plan, name: str, source: str) -> Iterator[Job]:
    before: dict[Choice, str] = {}
    for shot, scene in _shots(plan, name, source):
        key = key_of_scene(scene)
        stops = [stop(plan.truth, passes) for passes in plan.grid.passes]
        for choice in (*plan.grid.choices, *stops):
            filtered = plan.temporal if METHODS[choice.method].temporal is not None else None
            last = before.get(choice) if filtered else None
            count = 1 if filtered else plan.rounds
            job = Job("", shot, choice, tuple(range(shot.frame * count, (shot.frame + 1) * count)), key, last, filtered)
            job = job._replace(name=_digest(_content(job, plan))[:NAME])
            before[choice] = job.name
            yield job


def _shots(plan: Plan, name: str, source: str) -> Iterator[tuple[Shot, Scene]]:
    shot = Shot(name, source, plan.size, plan.path)
    if plan.path is not None:
        frames = plan.frames or read_path(plan.path, _loaded(source))[1]
        expect(frames is not None, f"{plan.file}: batch.frames", f"how many, as {plan.path} does not say", "nothing")
        shot = shot._replace(frames=frames or 1)
    for number, scene in enumerate(_scenes(shot)):
        yield shot._replace(frame=number), scene


def _scenes(shot: Shot) -> Iterator[Scene]:
    """Yield the scene of every frame."""
    scene = _loaded(shot.source)
    if shot.size is not None:
        scene = scene.with_camera(width=shot.size[0], height=shot.size[1])
    if shot.path is None:
        yield scene
    else:
        yield from scenes_along(scene, read_path(shot.path, scene)[0], shot.frames)


@functools.lru_cache(maxsize=1)
def _loaded(source: str) -> Scene:
    """Return a scene; the frames of a path share its geometry, by which a temporal filter knows that nothing moves."""
    return load_scene(source)


def _content(job: Job, plan: Plan) -> dict[str, Any]:
    truth = reference_settings(plan.truth, job.shot)
    return {"format": FORMAT, "scene": job.scene_key, "rsm_resolution": plan.rsm_resolution, "seeds": job.seeds,
            "method": job.choice.method, "settings": plain(job.choice.settings), "truth": plain(truth),
            "before": job.before, "temporal": plain(job.temporal), "code": _code(job.choice.method),
            "versions": _versions()}


@functools.cache
def _versions() -> dict[str, str | None]:
    known = versions()
    return {name: known[name] for name in COMPUTING}


@functools.cache
def _code(method: str) -> str:
    return code_key(*SHARED, place_of(method), alone=RUNNERS)


def _digest(content: Any) -> str:
    return hashlib.sha256(canonical_json(content).encode()).hexdigest()


def picture_of(shot: Shot, method: str, job: str) -> str:
    """Return where the picture of a job lies in the folder of a batch."""
    return f"pictures/{shot.name}/{method}_{job}.exr"
