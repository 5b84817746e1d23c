"""What a kit holds for those without refgi: check.py, and the scene of a case as scene.json and OBJ.

check.py is the checker in one file, gathered from refgi's own modules, so that both give the same verdicts.

files/check.py is its command line. What that imports of refgi, and what this needs in turn, is copied definition by
definition; files/models.py stands in for pydantic.
"""

import ast
import json
import math
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from refgi.provenance.record import light_json
from refgi.scene import Material, Scene
from refgi.types import Array

FILES = Path(__file__).with_name("files")
STANDS_IN = "pydantic"
Definition = ast.FunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign


def standalone_text() -> str:
    """Return check.py.

    ValueError if two modules define one name, or a function that is needed imports from refgi in its body.
    """
    frame, models = (_Module("", (FILES / name).read_text(encoding="utf-8")) for name in ("check.py", "models.py"))
    wanted = _Wanted({name: "files" for name in (*frame.definitions, *models.definitions)})
    wanted.add_all(frame)
    imports = {one for module in (*wanted.modules.values(), frame, models) for one in module.plain_imports(wanted)}
    names = [one.name for one in models.tree.body if isinstance(one, ast.ClassDef)]
    parts = [frame.docstring, "from __future__ import annotations", "\n".join(sorted(imports)), models.rest(),
             f"class {STANDS_IN}:\n    \"\"\"In place of the package.\"\"\"\n\n    ConfigDict = dict\n"
             + "".join(f"    {name} = {name}\n" for name in names)]
    for name, module in wanted.modules.items():
        parts += [f"# {name}", *module.kept(wanted.names[name])]
    return "\n\n\n".join(part.strip("\n") for part in (*parts, frame.rest())) + "\n"


class _Module:
    """A module's text and its definitions."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self.lines, self.tree = name, text.splitlines(), ast.parse(text)
        self.definitions: dict[str, Definition] = {}
        self.ours: dict[str, tuple[str, str]] = {}  # name here -> module of refgi, name there
        self.imports: dict[str, str] = {}  # name here -> line that imports it
        for node in self.tree.body:
            if isinstance(node, ast.ImportFrom):
                for one in node.names:
                    if str(node.module).startswith("refgi"):
                        self.ours[one.asname or one.name] = str(node.module), one.name
                    else:
                        self.imports[one.asname or one.name] = f"from {node.module} import {ast.unparse(one)}"
            elif isinstance(node, ast.Import):
                self.imports |= {(one.asname or one.name).partition(".")[0]: f"import {ast.unparse(one)}"
                                 for one in node.names}
            elif isinstance(node, Definition):
                self.definitions |= dict.fromkeys(_names_of(node), node)

    @property
    def docstring(self) -> str:
        return self._text(self.tree.body[0])

    def plain_imports(self, wanted: "_Wanted") -> set[str]:
        """Return the lines that import what is not refgi's, of all that is needed here."""
        nodes = [self.definitions[one] for one in wanted.names[self.name]] if self.name else self.tree.body
        used = {name for node in nodes for name in _used(node)}
        return {line for name, line in self.imports.items() if name in used and name != STANDS_IN}

    def kept(self, names: set[str]) -> list[str]:
        """Return the texts of definitions, in their order here."""
        nodes = {id(self.definitions[name]): self.definitions[name] for name in names}
        found, after_plain = list[str](), False
        for node in sorted(nodes.values(), key=lambda one: one.lineno):
            plain = isinstance(node, ast.Assign | ast.AnnAssign)
            if plain and after_plain:
                found[-1] += "\n" + self._text(node)
            else:
                found.append(self._text(node))
            after_plain = plain
        return found

    def rest(self) -> str:
        """Return all but the docstring and imports."""
        return "\n\n\n".join(self._text(node) for node in self.tree.body[1:]
                             if not isinstance(node, ast.Import | ast.ImportFrom))

    def _text(self, node: ast.stmt) -> str:
        first = min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", ()))])
        return "\n".join(self.lines[first - 1 : node.end_lineno])


class _Wanted:
    """Definitions that are needed, by module; modules in an order in which each stands behind those it needs."""

    def __init__(self, owner: dict[str, str]) -> None:
        self.modules: dict[str, _Module] = {}
        self.names: dict[str, set[str]] = {}
        self._known: dict[str, _Module] = {}
        self._owner = owner  # of each name

    def add_all(self, frame: _Module) -> None:
        """Add what a file imports of refgi."""
        for module, name in frame.ours.values():
            self._add(module, name)
        ordered: dict[str, _Module] = {}
        for name in self.names:
            self._put(name, ordered)
        self.modules = ordered

    def _put(self, name: str, ordered: dict[str, _Module]) -> None:
        for module, _ in self._known[name].ours.values():
            if module in self.names and module not in ordered:
                self._put(module, ordered)
        ordered[name] = self._known[name]

    def _add(self, module: str, name: str) -> None:
        if name in self.names.setdefault(module, set()):
            return
        if self._owner.setdefault(name, module) != module:
            raise ValueError(f"{name}: expected one of this name, got those of {self._owner[name]} and {module}")
        if module not in self._known:
            origin = getattr(find_spec(module), "origin", None) or ""
            self._known[module] = _Module(module, Path(origin).read_text(encoding="utf-8"))
        own = self._known[module]
        node = own.definitions[name]
        self.names[module] |= {*_names_of(node)}
        for inner in ast.walk(node):
            if isinstance(inner, ast.ImportFrom) and str(inner.module).startswith("refgi"):
                raise ValueError(f"{module}.{name}: expected imports at the top of its module, got one in its body")
        for used in _used(node):
            if used in own.definitions:
                self._add(module, used)
            elif used in own.ours:
                if own.ours[used][1] != used:
                    raise ValueError(f"{module}: expected {own.ours[used][1]} by its own name, got {used}")
                self._add(*own.ours[used])


def _names_of(node: Definition) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    return [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]


def _used(node: ast.AST) -> set[str]:
    """Return the names that a definition needs when it runs: not those of a function's annotations."""
    skipped = {id(inner) for one in ast.walk(node) if isinstance(one, ast.FunctionDef | ast.arg | ast.AnnAssign)
               for part in _annotations(one) for inner in ast.walk(part)}
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and id(one) not in skipped}


def _annotations(node: ast.AST) -> list[ast.AST]:
    if isinstance(node, ast.FunctionDef):
        return [node.returns] if node.returns else []
    return [node.annotation] if isinstance(node, ast.arg) and node.annotation else []


def is_plain(scene: Scene) -> bool:
    """Return whether the files can say all of a scene: opaque triangles without textures and glow."""
    geometry, bare = scene.geometry, Material()
    return geometry.cut_outs is None and all(
        getattr(one, key) == getattr(bare, key) for one in scene.materials
        for key in ("ior", "emission", "texture", "alpha", "cutoff", "emission_texture", "alpha_texture", "sends"))


def write_scene(scene: Scene, size: tuple[int, int], folder: Path) -> None:
    """Write scene.json and scene.obj, triangles in the order of the case's ids; `size`: columns and rows."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.obj").write_text(_obj(scene), encoding="utf-8", newline="\n")
    (folder / "scene.json").write_text(json.dumps(_scene(scene, size), indent=1) + "\n", encoding="utf-8", newline="\n")


def _scene(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    camera = scene.camera
    return {
        "schema": 1,
        "name": scene.name,
        "objects": [{"mesh": "scene.obj", "smooth_normals": scene.geometry.vertex_normals is not None}],
        "materials": {f"material{k}": {
            "type": "phong" if any(one.specular) else "diffuse", "diffuse": list(one.diffuse),
            **({"specular": list(one.specular), "exponent": one.exponent} if any(one.specular) else {})}
            for k, one in enumerate(scene.materials)},
        "camera": {"eye": list(camera.eye), "target": list(camera.target), "up": list(camera.up),
                   "vfov_deg": math.degrees(camera.vfov), "width": size[0], "height": size[1]},
        "lights": [_light(light) for light in scene.lights],
    }


def _light(light: Any) -> dict[str, Any]:
    units = {"intensity": "intensity_w_per_sr", "irradiance": "irradiance_w_per_m2"}
    return {f"{key}_deg" if "angle" in key else units.get(key, key): math.degrees(value) if "angle" in key else value
            for key, value in light_json(light).items()}


def _obj(scene: Scene) -> str:
    geometry, lines, material = scene.geometry, ["# triangles in the order of triangle_id"], -1
    points = geometry.vertices
    if geometry.colours is not None:  # of a vertex: all faces that share it have the same one there
        of_vertex = np.ones_like(points)
        of_vertex[geometry.faces] = geometry.colours
        points = np.hstack([points, of_vertex])
    lines += [_row("v", vertex) for vertex in points]
    normals = geometry.vertex_normals
    lines += [] if normals is None else [_row("vn", normal) for normal in normals]
    for face, own in zip(geometry.faces + 1, geometry.material_of_face, strict=True):
        if own != material:
            material = int(own)
            lines.append(f"usemtl material{material}")
        corners = [str(k) if normals is None else f"{k}//{k}" for k in face]
        lines.append(f"f {' '.join(corners)}")
    return "\n".join(lines) + "\n"


def _row(key: str, values: Array) -> str:
    return " ".join((key, *(f"{value:.9g}" for value in values)))
