"""The files of a kit and of a verdict as data: read, checked and described by JSON Schema with pydantic."""

import json
from pathlib import Path
from typing import Any, Literal, TypeVar

import pydantic

from refgi.errors import InputError, shortened

VERSION = "2.1.0"  # of the vectors, apart from the program's: a patch adds cases or mends, a minor adds arrays to
# a case, a major changes what an array means or its name
KIT, CASE, RESULT = "kit.json", "manifest.json", "result.json"

M = TypeVar("M", bound=pydantic.BaseModel)
Verdict = Literal["exact", "within", "not-judged", "out", "invalid", "not-run"]


class _Strict(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class Tolerance(_Strict):
    """``|got - expected| <= relative (|expected| + large)``, but for masked elements and a share of outliers."""

    relative: float
    large: float
    outliers: float
    masked: str | None = None  # file of bool: elements that may differ at will, beside those of the array's own mask


class ArrayEntry(_Strict):
    """One array of a case."""

    file: str
    sha256: str
    dtype: Literal["<f4", "<i4", "|b1"]
    shape: tuple[int, ...]
    axes: str
    unit: str
    what: str
    space: str = ""
    paper: str = ""
    tier: Literal["T0", "T1", "T3"]
    index_of: tuple[int, int] | None = None
    bound: str | None = None  # file of (...) absolute bounds, one an element; None: equal
    masked: str | None = None  # file of bool: elements that may differ at will
    masked_count: int = 0
    chained: Tolerance | None = None
    half: Tolerance | None = None  # tier T2
    bytes: Tolerance | None = None  # tier T2B
    chained_half: Tolerance | None = None  # tier T2 of the array, or of one that it is made from


class StageEntry(_Strict):
    """One stage of a case."""

    name: str
    what: str
    paper: str = ""
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    exact: tuple[str, ...] = ()  # inputs that must stay in float32 in any tier: their differences or choices count


class CaseManifest(_Strict):
    """manifest.json: one case."""

    id: str
    method: str
    what: str
    vectors: str
    facts: dict[str, Any]
    factors: dict[str, float]
    scene: str | None = None  # folder of scene.json
    given: tuple[str, ...]
    stages: tuple[StageEntry, ...]
    arrays: dict[str, ArrayEntry]
    bugs_sha256: str  # of bugs.npz: likely bugs, for the checker alone


class KitEntry(_Strict):
    """One case in the list of a kit."""

    id: str
    method: str
    what: str
    manifest: str
    sha256: str


class KitManifest(_Strict):
    """kit.json: what a kit holds."""

    kit: str
    vectors: str
    refgi: str
    cases: tuple[KitEntry, ...]


class ArrayVerdict(_Strict):
    """What became of one array."""

    name: str
    verdict: Verdict
    tier: str
    worst: float | None = None  # largest error over its bound
    element: tuple[int, ...] | None = None
    expected: float | None = None
    got: float | None = None
    bound: float | None = None
    outside: int = 0  # elements beyond their bound
    masked: int = 0  # masked elements beyond their bound
    said: str = ""  # why it is invalid or not judged; of what is within, what was spared
    damaged: bool = False  # its file cannot be read
    read: str = ""  # how it was read where it does not lie as the kit's: texels, stored depth, another order


class Cause(_Strict):
    """A likely bug that explains a difference."""

    cause: str
    share: float  # of the elements that differ; 0 of a remark that explains none
    paper: str = ""


class StageVerdict(_Strict):
    """What became of one stage."""

    case: str
    stage: str
    verdict: Verdict
    upstream: Literal["clean", "dirty", "isolated"]
    arrays: tuple[ArrayVerdict, ...]
    causes: tuple[Cause, ...] = ()
    excused: str = ""  # wrong, and does not count: why


class CommonCause(_Strict):
    """A likely bug and how many wrong verdicts it explains."""

    cause: str
    paper: str = ""
    explained: int  # 0 of a remark that explains none
    tried: int  # wrong verdicts of cases that know the bug


class Finding(_Strict):
    """What is wrong with a kind of stage over all cases."""

    stage: str  # without numbers of maps, levels and rounds: "rsm.map_surface"
    first: tuple[str, str]  # case and stage
    wrong: int  # verdicts that are out or invalid
    ran: int  # verdicts of it in all
    causes: tuple[CommonCause, ...]


class Result(_Strict):
    """result.json: what a check found."""

    kit: str
    vectors: str
    mode: Literal["isolated", "chained"]
    verdict: Verdict
    exit_code: int
    first: tuple[str, str] | None  # case and stage of the first wrong one
    findings: tuple[Finding, ...]
    stages: tuple[StageVerdict, ...]
    not_judged: int = 0  # arrays beyond their bounds at more elements than a verdict can spare
    unknown: tuple[str, ...] = ()  # what the output holds that the kit does not know
    missing: tuple[str, ...] = ()  # stages that must have run and have not: CASE/STAGE
    passing: tuple[str, ...] = ()  # lines of expected failures none of whose stages fails
    left: int = 0  # stages not looked at after the first wrong one


SCHEMAS: dict[str, type[_Strict]] = {"kit.json": KitManifest, "manifest.json": CaseManifest, "result.json": Result}


def schema_text(model: type[pydantic.BaseModel]) -> str:
    """Return the JSON Schema of a file, as the kit holds it."""
    return json.dumps(model.model_json_schema(), indent=1, sort_keys=True) + "\n"


def text_of(model: pydantic.BaseModel) -> str:
    """Return a file's text: keys in the order of the class, nothing that is absent."""
    return json.dumps(model.model_dump(mode="json", exclude_defaults=True), indent=1, ensure_ascii=False) + "\n"


def read_model(model: type[M], file: Path) -> M:
    """Read and check a file; InputError, all faults at once, if it is absent, no JSON, or not what its schema says."""
    try:
        return model.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}", file=str(file)) from error
    except pydantic.ValidationError as error:
        faults = [f"{file}: {shortened('.'.join(map(str, one['loc']))) or 'file'}: {shortened(one['msg'], 200)}"
                  for one in error.errors()[:20]]
        raise InputError("\n".join(faults), file=str(file)) from error
