"""The short verbs.

`scenes`, `info` and `settings` say what there is, `warm` compiles ahead, `report` makes pages again, `stress` attacks a
scene.
"""

import contextlib
import math
import os
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from refgi.cli.options import SEEN, WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say, table

QUICK, USUAL = 96, 192  # pixels along the longer side of what is attacked, at most


@verb("scenes")
def _scenes(session: Session, _: Asked) -> None:
    """List the built-in scenes, with faces and a line each.

    A scene's parameters follow its name: refgi render atrium:faces=1000000,seed=3 ...
    """
    from refgi.scene import builtin_scenes

    built_in = builtin_scenes()
    rows = [("scene", "faces", "what it is", "parameters")]
    rows += [(name, f"{scene.faces:,}", scene.summary, ",".join(f"{k}={v}" for k, v in scene.parameters.items()))
             for name, scene in built_in.items()]
    session.result(table(rows, right=frozenset({1})), {"scenes": {
        name: {"faces": scene.faces, "summary": scene.summary, "parameters": scene.parameters}
        for name, scene in built_in.items()
    }})


@verb("info")
def _info(session: Session, _: Asked) -> None:
    """Show methods, versions, CPU features, threads and cache."""
    import numpy as np

    from refgi.jit import cache_root
    from refgi.methods import METHODS
    from refgi.provenance.record import environment
    from refgi.rays.embree import RunBackend, open_backend

    backend = open_backend(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    sizes = list(_sizes(cache_root()))
    facts = environment() | {
        "methods": {name: method.summary for name, method in METHODS.items()},
        "cache": {"path": str(cache_root()), "files": len(sizes), "bytes": sum(sizes)},
        "embree": "embreex's run" if isinstance(backend, RunBackend) else "by address"}
    rows = [(name, said or "not installed") for name, said in facts["versions"].items()]
    rows += [(name, str(facts[name])) for name in ("platform", "cpu")]
    rows += [("simd", " ".join(facts["simd"])), ("threads", str(facts["threads"])), ("embree", facts["embree"]),
             ("cache", f"{cache_root()} ({len(sizes)} files, {sum(sizes) / 2**20:.1f} MiB)")]
    session.result(f"{table(rows)}\n\n{table(list(facts['methods'].items()))}", facts)


def _sizes(folder: Path) -> Iterator[int]:
    """Yield the bytes of each file below a folder; other processes may write and remove files meanwhile."""
    for path, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(OSError):
                yield Path(path, name).stat().st_size


@verb("settings", "METHOD", "preset", "all")
def _settings(session: Session, asked: Asked) -> None:
    """List what a method can be set to by --set.

    Shows keys, values, what they take and what they are.

    A key may be shortened to what tells it apart from the others: terms for visibility.terms.
    """
    from refgi.methods import find_method
    from refgi.settings import flat, schema

    known = find_method(asked.method)
    values = flat(known.preset(asked.preset))
    rows = _rows(known.settings, values, asked.everything)
    head = f"{asked.method}: {known.summary}\npresets: {', '.join(['default', *known.presets])}"
    hidden = "" if asked.everything else "\n\n--all also shows the keys of other choices, and those for studies"
    content = {"method": asked.method, "preset": asked.preset, "values": values, "schema": schema(known.settings),
               "presets": {name: flat(preset) for name, preset in known.presets.items()}}
    session.result(f"{head}\n\n{table([('key', 'value', 'takes', 'what it is'), *rows])}{hidden}", content)


def _rows(kind: Any, values: Mapping[str, Any], everything: bool) -> list[tuple[str, ...]]:
    from refgi.provenance import plain
    from refgi.settings import leaves

    rows: list[tuple[str, ...]] = []
    for leaf in {leaf.key: leaf for leaf in leaves(kind)}.values():
        if not everything and (leaf.is_for_study or leaf.key not in values):
            continue
        value = plain(values[leaf.key]) if leaf.key in values else "-"
        shown = "none" if value is None else ",".join(value) if isinstance(value, list) else str(value)
        rows.append((leaf.key, shown, leaf.expected, leaf.about))
    return rows


@verb("warm", "methods", "dtype", "processes", dtype="Element type of their kernels.",
      methods={"help": "Methods to compile for; all where absent.", "metavar": "NAME,NAME"})
def _warm(session: Session, asked: Asked) -> None:
    """Compile kernels ahead, on all cores.

    Those that methods need at their defaults; they are kept on disk.
    """
    from refgi.cli.view import lacking_kernels, named_methods
    from refgi.jit.ahead import compile_ahead
    from refgi.methods import METHODS, find_method

    names = [find_method(name).name for name in named_methods(asked.methods) or METHODS]
    lacking = lacking_kernels(names, asked.dtype)
    with progress() as tell:
        compile_ahead(lacking, tell, asked.processes)
    session.result(f"{len(lacking)} kernels compiled for {', '.join(names)} ({asked.dtype})",
                   {"methods": names, "dtype": asked.dtype, "compiled": [one.kernel for one in lacking]})


@verb("report", "DIR", "watch", "force", force="Overwrite an index.html that is not from refgi.")
def _report(session: Session, asked: Asked) -> int:
    """Make the page of DIR again from its results.json and pictures.

    DIR is what `refgi bench` or `refgi batch` wrote, or a folder of such folders: each then gets its page, and DIR an
    index over all scenes.
    """
    from refgi.bench.folder import INDEX, folders_of, remake
    from refgi.bench.folder import watch as keep_up_to_date
    from refgi.cli.destination import Permission, folder
    from refgi.errors import expect

    path = Path(asked.dir)
    expect(path.is_dir(), "DIR", "a folder", asked.dir)
    folders = folders_of(path)
    for one in {path, *folders}:
        folder(str(one), Permission(force=asked.force), [INDEX])
    if asked.watch:
        say(f"open {path / INDEX}; an interrupt ends this")
        keep_up_to_date(path, say)
        return DONE
    held = remake(path, folders)
    made = [scene for one in held for scene in one.result.scenes]
    lines = [f"{one.folder}: {', '.join(scene.scene for scene in one.result.scenes)}" for one in held]
    session.result("\n".join([*lines, "", f"open {path / INDEX}"]), {
        "pages": [str(one / INDEX) for one in dict.fromkeys([path, *folders])], "scenes": len(made),
        "runs": sum(len(scene.runs) for scene in made)})
    return DONE


@verb("stress", "SCENE", *SEEN, "methods", "change", "quick", "threads", "out", *WRITING,
      methods="Methods to attack; all where absent.",
      quick=f"At most {QUICK} pixels along the longer side, in place of {USUAL}.",
      out={"required": True, "help": "Folder for index.html and stability.json."})
def _stress(session: Session, asked: Asked) -> int:
    """Attack SCENE: tell whether it is safe to compare against.

    Every method renders the scene as it is and after changes of which the outcome is known: brighter lamps, other
    units, another place, other triangles. Each row of the table is a promise with the worst that was found beside its
    limit; the exit code is 1 where one is broken.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.view import named_methods, on_threads, require_memory, scene_of, warm_up
    from refgi.methods import METHODS, find_method
    from refgi.provenance.record import environment
    from refgi.stress.page import markdown_summary, write_page
    from refgi.stress.promises import Stability, markdown, write_rows
    from refgi.stress.run import Silence
    from refgi.stress.run import stress as attack

    names = [find_method(name).name for name in named_methods(asked.methods) or METHODS]
    scene = scene_of(asked)
    camera = scene.camera
    shrink = max(1.0, max(camera.width, camera.height) / (QUICK if asked.quick else USUAL))
    width, height = (camera.width, camera.height) if asked.size else (
        max(1, math.floor(n / shrink)) for n in (camera.width, camera.height))
    largest = scene.with_camera(width=2 * width, height=2 * height)  # of "resolution x 2"
    require_memory(largest, "float64", 512, traced=True,
                   settings={name: find_method(name).settings() for name in names})
    path = folder(asked.out, Permission(asked.parents, asked.force), ("index.html", "stability.json"))
    silent: list[Silence] = []
    with on_threads(asked.threads), progress() as tell:
        warm_up(names, "float32", tell)
        found = list(attack(scene, names, width=width, height=height, changes=asked.changes or None,
                            source=_typed(asked), tell=tell, silent=silent.append))
    result = Stability(environment=environment(), rows=tuple(one.row for one in found))
    path.mkdir(parents=True, exist_ok=True)
    write_rows(result, path / "stability.json")
    write_page(result, found, silent, path, scene.name)
    for row in result.failed:
        say(f"broken: {row.subject}, {row.property}: {row.figure:.3g} {row.unit}, limit {row.limit:.3g}")
    session.result("\n".join([markdown(result.rows), markdown_summary(result),
                              f"open {asked.out.rstrip('/')}/index.html"]),
                   result.model_dump(mode="json") | {"silent": [one._asdict() for one in silent]})
    return FAILED if result.failed else DONE


def _typed(asked: Asked) -> str:
    """Return the scene and what is seen of it as one types it, without the size."""
    words = [asked.scene]
    for key in ("eye", "target", "up", "vfov_deg"):
        if (value := getattr(asked, key)) is not None:
            text = ",".join(f"{c:.17g}" for c in value) if isinstance(value, tuple) else f"{value:.17g}"
            words.append(f"--{key.replace('_', '-')}={text}")
    return shlex.join([*words, *(f"--light={light}" for light in asked.lights)])
