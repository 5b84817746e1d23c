"""The page of a check: stages left to right, the first wrong one open, arrays side by side. One file, no network."""

import base64
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from refgi.image.whole import write_text
from refgi.types import Array
from refgi.vectors.kit import Asked, Kit
from refgi.vectors.manifest import ArrayVerdict, Result, StageVerdict
from refgi.vectors.port import Got, Port

FILES = Path(__file__).with_name("files")
MOST_BYTES = 24_000_000  # of arrays in a page; beyond that only those that are out are shown


def write_page(file: str, kit: Kit, output: Path, result: Result, asked: Asked) -> None:
    """Write the page of what was found, whole or not at all; InputError if it cannot be written."""
    import jinja2

    manifests = {case.id: case for case in kit.cases(Asked(cases=tuple({one.case for one in result.stages})))}
    ran = [one for one in result.stages if one.verdict != "not-run"]
    size = 12 * sum(int(np.prod(manifests[one.case].arrays[array.name].shape)) for one in ran for array in one.arrays)
    shown = {"out"} if size > MOST_BYTES else {"out", "not-judged", "within", "exact"}
    stages: dict[str, Any] = {}
    for case in manifests.values():
        port = Port(kit, case, output, asked)
        got = {step.name: port.read(step) for step in case.stages}
        stages |= {f"{case.id}/{one.stage}": _stage(port, one, got[one.stage], shown) for one in ran
                   if one.case == case.id}
    first = "/".join(result.first) if result.first else next(iter(stages), "")
    wrong = {one.case for one in ran if one.verdict in ("out", "invalid")}
    cases = [{"id": case.id, "what": case.what, "open": not wrong or case.id in wrong,
              "stages": [one for one in result.stages if one.case == case.id]}
             for case in manifests.values() if any(one.case == case.id for one in ran)]
    text = json.dumps({"first": first, "stages": stages}, allow_nan=False).replace("<", "\\u003c")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    template = environment.from_string((FILES / "page.html.j2").read_text(encoding="utf-8"))
    style, script = ((FILES / name).read_text(encoding="utf-8") for name in ("style.css", "page.js"))
    safe = environment.filters["safe"]
    write_text(file, template.render(result=result, cases=cases, data=safe(text), style=safe(style),
                                     script=safe(script), version=version("refgi")))


def _stage(port: Port, verdict: StageVerdict, got: Got, shown: set[str]) -> dict[str, Any]:
    entry = next(step for step in port.case.stages if step.name == verdict.stage)
    return {"verdict": verdict.verdict, "what": entry.what, "paper": entry.paper,
            "causes": [cause.model_dump() for cause in verdict.causes],
            "arrays": [_array(port, one, got, shown) for one in verdict.arrays]}


def _array(port: Port, verdict: ArrayVerdict, got: Got, shown: set[str]) -> dict[str, Any]:
    entry = port.case.arrays[verdict.name]
    told = {"name": verdict.name, "verdict": verdict.verdict, "worst": verdict.worst, "element": verdict.element,
            "expected_value": verdict.expected, "got_value": verdict.got, "bound": verdict.bound,
            "outside": verdict.outside, "said": "; ".join(filter(None, (verdict.said, verdict.read))),
            "axes": entry.axes, "unit": entry.unit, "what": entry.what, "shape": entry.shape, "got": None}
    array = got.arrays.get(verdict.name)
    if verdict.verdict not in shown or array is None or not np.prod(entry.shape):
        return told
    if verdict.read and verdict.read != got.read.get(verdict.name):
        moved = port.in_order_of_lists(verdict.name, array)
        array = array if moved is None else moved
    expected = port.kit.array(port.case, verdict.name)
    limit = port.kit.extra(port.case, entry.bound) if entry.bound is not None else np.zeros(entry.shape)
    return told | {"expected": _text(expected), "got": _text(array), "limit": _text(limit)}


def _text(array: Array) -> str:
    with np.errstate(over="ignore"):
        return base64.b64encode(np.ascontiguousarray(array, "<f4").tobytes()).decode("ascii")
