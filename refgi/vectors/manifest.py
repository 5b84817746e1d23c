"""The files of a kit and of a verdict as data: read, checked and described by JSON Schema with pydantic.

Likely bugs of a case are one packed file, `bugs.npz`, that the checker alone reads. `index` is JSON: by stage the
cause, where the paper says how it should be, shapes, and of each array that shows it a piece of `places` (flat
indices) and of `bits` (what the array holds there with the bug, as 4-byte words, changed from the expected ones by
exclusive or; bits that move a value by less than `UNSEEN` of its bound are 0). Places are steps from the one before,
and both lie byte by byte, all first bytes before all second ones: most are 0 then and take no room.
"""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
import pydantic

from refgi.errors import InputError, shortened
from refgi.types import Array

VERSION = "2.3.1"  # of the vectors, apart from the program's: a patch adds cases or mends, a minor adds arrays to
# a case, a major changes what an array means or its name
LONGEST_LINE = 118  # characters of JSON
KIT, CASE, RESULT = "kit.json", "manifest.json", "result.json"

M = TypeVar("M", bound=pydantic.BaseModel)
Verdict = Literal["exact", "within", "not-judged", "out", "invalid", "not-run"]


class _Strict(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class Tolerance(_Strict):
    """``|got - expected| <= relative (|expected| + large)``, but for masked elements and a share of outliers."""

    relative: float
    large: float
    outliers: float = 0.0
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
    bound: str | None = None  # file of (...) absolute bounds, one an element, maybe another case's; None: equal
    masked: str | None = None  # file of bool: elements that may differ at will
    masked_count: int = 0
    packed: str | None = None  # file of bool: whole numbers that packed floats among what they are made of may change
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
    """Return a file's text: keys in the order of the class, nothing that is absent, on one line what fits there."""
    return _lines(model.model_dump(mode="json", exclude_defaults=True), "") + "\n"


def _lines(value: Any, indent: str) -> str:
    text = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(text) <= LONGEST_LINE or not isinstance(value, dict | list):
        return text
    deeper = f"{indent} "
    parts = ([f"{json.dumps(key, ensure_ascii=False)}: {_lines(one, deeper)}" for key, one in value.items()]
             if isinstance(value, dict) else [_lines(one, deeper) for one in value])
    inner = ",\n".join(f"{deeper}{one}" for one in parts)
    return f"{text[0]}\n{inner}\n{indent}{text[-1]}"


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


BUGS = "bugs.npz"
UNSEEN = 1 / 16  # of an element's bound
MANTISSA = 23  # bits of float32
HANDFUL = 7  # elements that must differ for a wrong wiring to stand before other causes


class Piece(pydantic.BaseModel):
    """Where the elements of one array lie in `places` and `bits`."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)
    start: int
    count: int
    differing: int = 0  # elements of the whole array that tell the bug; 0 in kits before 2.3.1


class BugEntry(pydantic.BaseModel):
    """A likely bug of a stage."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)
    cause: str
    paper: str = ""
    shapes: dict[str, tuple[int, ...]]  # of the arrays with the bug
    arrays: dict[str, Piece]  # elements of those that show it
    blind: bool = False  # this case cannot tell it from the right stage
    wired: bool = False  # a wrong wiring

    @property
    def by_chance(self) -> bool:
        """Whether it is a wrong wiring that so few elements tell that others fit as well."""
        return self.wired and 0 < sum(one.differing for one in self.arrays.values()) < HANDFUL


class Told(NamedTuple):
    """What a bug makes of some elements of an array."""

    places: Array  # (n,) flat indices
    values: Array  # (n,) of the array's type
    differing: int  # elements of the whole array that tell it


class BugWriter:
    """Likely bugs of a case, gathered stage by stage."""

    def __init__(self) -> None:
        self._index: dict[str, list[BugEntry]] = {}
        self._places: list[Array] = []
        self._bits: list[Array] = []
        self._values: list[Array] = []
        self._limits: list[Array] = []  # bounds of floats, 0 of other numbers
        self._count = 0

    def add(
        self, stage: str, entry: BugEntry, told: Mapping[str, Told], expected: Mapping[str, Array],
        limits: Mapping[str, Array],
    ) -> None:
        """Keep a bug; the pieces of its entry follow from what it tells. `limits`: bounds of all elements."""
        pieces = {}
        for name, (places, values, differing) in told.items():
            pieces[name] = Piece(start=self._count, count=len(places), differing=differing)
            self._places.append(places)
            self._bits.append(_words(values) ^ _words(expected[name].reshape(-1)[places]))
            floats = values.dtype.kind == "f"
            self._values.append(values if floats else np.zeros(len(places), np.float32))
            self._limits.append(limits[name].reshape(-1)[places] if floats else np.zeros(len(places), np.float32))
            self._count += len(places)
        self._index.setdefault(stage, []).append(entry.model_copy(update={"arrays": pieces}))

    def content(self) -> bytes:
        """Return the file."""
        index = {stage: [one.model_dump(mode="json", exclude_defaults=True) for one in entries]
                 for stage, entries in self._index.items()}
        text = np.frombuffer(json.dumps(index, ensure_ascii=False).encode(), np.uint8)
        stream = io.BytesIO()
        places, bits, values, limits = (np.concatenate([np.zeros(0, kind), *parts]) for kind, parts in (
            (np.int64, self._places), (np.uint32, self._bits), (np.float32, self._values), (np.float32, self._limits)))
        np.savez_compressed(stream, index=text, places=_planes(np.diff(places, prepend=0)),
                            bits=_planes(bits & _seen(values, limits)))
        return stream.getvalue()


class Bugs:
    """Likely bugs of a case, from the bytes of its file; ValueError if it is none."""

    def __init__(self, content: bytes) -> None:
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                text, steps, bits = (file[name] for name in ("index", "places", "bits"))
            self._places, self._bits = np.cumsum(_from_planes(steps).view("<i4")), _from_planes(bits)
            index = json.loads(text.tobytes().decode())
            self._of = {stage: [BugEntry.model_validate(one) for one in entries] for stage, entries in index.items()}
        except Exception as error:  # a damaged archive raises nearly any, a size beyond memory among them
            raise ValueError(str(error)) from error

    def of(self, stage: str) -> list[BugEntry]:
        """Return those of a stage."""
        return self._of.get(stage, [])

    def told(self, bug: BugEntry, name: str, expected: Array) -> Told:
        """Return what a bug makes of an array whose expected values are given."""
        own = bug.arrays[name]
        piece = slice(own.start, own.start + own.count)
        places = self._places[piece]
        right = expected.reshape(-1)[places]
        words = self._bits[piece] ^ _words(right)
        values = words.astype(np.bool_) if right.dtype.kind == "b" else words.view(right.dtype)
        return Told(places, values, own.differing)


def _seen(values: Array, limit: Array) -> Array:
    """Return which bits of floats move them by more than `UNSEEN` of their bounds; all where those are 0."""
    with np.errstate(all="ignore"):  # what a bug makes may be any number
        unseen = np.floor(np.log2(UNSEEN * limit / np.spacing(np.abs(values)).astype(np.float64)))
    unseen = np.where(np.isfinite(unseen), np.clip(unseen, 0, MANTISSA), 0).astype(np.uint32)
    return np.uint32(0xFFFFFFFF) << unseen


def _planes(words: Array) -> Array:
    return np.ascontiguousarray(words.astype("<u4").view(np.uint8).reshape(-1, 4).T)


def _from_planes(planes: Array) -> Array:
    return np.ascontiguousarray(planes.T).reshape(-1).view("<u4")


def _words(array: Array) -> Array:
    """Return the elements of a stored array as 4-byte words."""
    array = np.ascontiguousarray(array)
    return array.astype(np.uint32) if array.dtype.kind == "b" else array.view(np.uint32)
