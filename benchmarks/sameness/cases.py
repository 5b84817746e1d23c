"""Cases out of the tables: every method on every scene as it is, every setting changed; and whether none is missing."""

import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from benchmarks.sameness.settings import SETS, TRANSLATIONS, choice_of, key_of, names_of, settings_of, translated
from benchmarks.sameness.splat_tables import GATHER, MULTIRES, SII, TRUTH, VPL, Row, Table
from benchmarks.sameness.val_hssil_tables import HSSIL, TEMPORAL, VAL
from refgi import load_scene
from refgi.errors import InputError
from refgi.methods import METHODS
from refgi.scene import Scene
from refgi.scene.builtin import SCENES as BUILTIN
from refgi.scene.model import PointLight
from refgi.scene.motion import faces_of, moved, rotation_about, with_own_vertices

TABLES: dict[str, Table] = {"sii": SII, "multires": MULTIRES, "val": VAL, "hssil": HSSIL, "temporal": TEMPORAL,
                            "gather": GATHER, "vpl": VPL, "truth": TRUTH}


SMALLER = {"atrium": "atrium:faces=20000"}
MOVING = {"cornell_box": "green", "stage": "glaze"}  # material of what moves


def scene_names() -> list[str]:
    """Return every built-in scene, and the stage with a second, weaker lamp."""
    return [*BUILTIN, "two_lamps"]


@functools.lru_cache(maxsize=4)
def scene_of(name: str) -> Scene:
    if name != "two_lamps":
        return load_scene(SMALLER.get(name, name))
    stage = load_scene("stage")
    return stage.with_lights(*stage.lights, PointLight((-0.35, 0.45, 0.3), (0.04, 0.03, 0.05)))


def sequence_of(name: str) -> list[Scene]:
    """Return three frames of a scene in which the camera moves, and from the second on an object."""
    scene = scene_of(name)
    selected = faces_of(scene, MOVING[name])
    own = with_own_vertices(scene.geometry, selected)
    x, y, z = scene.camera.eye
    frames = []
    for number in range(3):
        turn = rotation_about((0.0, 1.0, 0.0), 0.1 * max(0, number - 1))
        geometry = moved(own, selected, np.asarray(turn), (0.0, 0.0, 0.0), (0.01 * max(0, number - 1), 0.0, 0.0))
        frames.append(Scene(scene.name, geometry, scene.materials, scene.camera, scene.lights)
                      .with_camera(eye=(x + 0.01 * number, y, z)))
    return frames


DTYPES = ("float32", "float64")
DEFAULTS = {"truth": {"samples": 24}}  # where the default takes long
GLOSSY = ("stage", "ring")  # scenes that show a surface with a lobe
LOBES: dict[str, tuple[dict[str, Any], ...]] = {
    "sii": ({"lights": 96}, {"lights": 96, "cut": "relative"}, {"lights": 96, "clamp": "distance", "clamp_value": 0.1}),
    "multires": ({"lights": 96}, {"lights": 24, "subsplats": "irradiance"}, {"lights": 96, "subsplats": "error"}),
    "val": ({"lights": 96, "clusters": 5}, {"lights": 96, "clusters": 5, "visibility": "pcf"}),
    "hssil": ({"radius": 5.0, "samples": 16}, {"radius": 5.0, "pattern": "all"},
              {"radius": 5.0, "samples": 16, "visibility": "rays"},
              {"radius": 5.0, "samples": 16, "visibility": "bitmask"}),
    "gather": ({"samples": 96},), "vpl": ({"lights": 96},), "truth": ({"samples": 24},)}
AS_IS, BASE = "default", "base"


class Case(NamedTuple):
    name: str
    method: str
    scene: str
    dtype: str
    flat: dict[str, Any]
    unlike: tuple[str, ...] = ()  # cases whose picture is another one
    part: str = "irradiance"  # or "lobes", those of receivers by indirect light


def all_cases() -> list[Case]:
    """Return every case once, those of one scene together."""
    found: dict[str, Case] = {}
    for case in (*_as_they_are(), *_varied(), *_lobes()):
        known = found.setdefault(case.name, case)
        found[case.name] = known._replace(unlike=tuple(dict.fromkeys((*known.unlike, *case.unlike))))
    return sorted(found.values(), key=lambda case: (case.scene, case.dtype))


def _as_they_are() -> Iterator[Case]:
    for method in METHODS:
        for scene in scene_names():
            for dtype in DTYPES:
                yield Case(f"{method}/{scene}/{dtype}/{AS_IS}", method, scene, dtype, DEFAULTS.get(method, {}))


def _lobes() -> Iterator[Case]:
    """Yield the lobes of glossy receivers, by what reaches them: each way to sum them once."""
    for method, ways in LOBES.items():
        for scene in GLOSSY:
            for dtype in DTYPES:
                for flat in ways:
                    yield Case(f"{method}/{scene}/{dtype}/lobes,{described(flat)}", method, scene, dtype, dict(flat),
                               part="lobes")


def _varied() -> Iterator[Case]:
    for method, table in TABLES.items():
        for row in table.rows:
            for scene in row.on:
                for dtype in DTYPES:
                    yield from _of_row(method, table.base, row, f"{method}/{scene}/{dtype}")


def _of_row(method: str, base: dict[str, Any], row: Row, where: str) -> Iterator[Case]:
    """Yield what the values are compared to, and each value; those of one row differ from each other as well."""
    _, scene, dtype = where.split("/")
    earlier = []
    try:
        usual = settings_of(method, **base | row.companions)
        earlier.append(f"{where}/{described(row.companions)}")
        yield Case(earlier[0], method, scene, dtype, base | row.companions)
    except InputError:  # companions that cannot be without the value
        usual = None
    for value in row.values:
        flat = row.companions | {row.field: value}
        if settings_of(method, **base | flat) == usual:  # the default, in a table that methods share
            continue
        name = f"{where}/{described(flat)}"
        yield Case(name, method, scene, dtype, base | flat, () if row.same else tuple(earlier))
        earlier.append(name)


def described(flat: dict[str, Any]) -> str:
    """Return settings as text, by name: `terms=8`."""
    return ",".join(f"{name}={_text(flat[name])}" for name in sorted(flat)) or BASE


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value or "empty"
    return str(value).lower() if isinstance(value, bool) or value is None else repr(value)


def gaps() -> list[str]:
    """Return what no case of the tables covers, and what they name without need."""
    return [gap for method, table in TABLES.items() for gap in _gaps_of(method, table)]


def _gaps_of(method: str, table: Table) -> list[str]:
    wanted = names_of(method)
    tried: dict[str, set[object]] = {}
    for row in table.rows:
        for value in row.values:
            companions = row.companions if method in TRANSLATIONS else {}
            for name, one in translated(method, companions | {row.field: value}).items():
                key = key_of(method, name)
                tried.setdefault(key, set()).update(one.split("+") if name in SETS else [one])
                if chosen := choice_of(method, key):
                    tried.setdefault(chosen[0], set()).add(chosen[1])
    excluded = {key_of(method, name) for name in table.excluded}
    excluded |= {name for name in wanted if name.startswith(table.borrowed)}
    found = [f"{method}: no case has {name}" for name in wanted if name not in tried and name not in excluded]
    found += [f"{method}: {name} is no setting" for name in (*tried, *excluded) if name not in wanted]
    return found + [f"{method}: no case has {name} {value!r}" for name, values in wanted.items()
                    if name not in excluded for value in sorted(values - tried.get(name, set()), key=str)]
