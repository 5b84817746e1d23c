"""The search as the checker asks for it: which changes explain the first wrong stage, told as causes."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from refgi.errors import RefgiError
from refgi.vectors.findings import CAUSES
from refgi.vectors.kit import Asked, Kit
from refgi.vectors.manifest import Cause, CommonCause, Finding, Result, StageVerdict
from refgi.vectors.spec import kind_of

MOST_CASES = 3  # that a change must explain
Tell = Callable[[str, float], None]


def searched(
    kit: Kit, output: Path, asked: Asked, result: Result, *, seconds: float = 60.0, tell: Tell = lambda *_: None
) -> Result:
    """Look for causes of the first wrong stage among single changes of refgi's source, after those that are known.

    Parameters
    ----------
    kit : Kit
        The kit.
    output : Path
        Folder of the port's arrays.
    asked : Asked
        As it was checked.
    result : Result
        What the check found.
    seconds : float
        After which no further change is tried.
    tell : callable
        Called with (what runs, share done).

    Returns
    -------
    Result
        With up to three causes for the first finding; as it was where nothing is wrong or nothing was found.

    Raises
    ------
    RefgiError
        If the search itself fails.
    """
    if not result.findings:
        return result
    first = result.findings[0]
    known = [one for one in first.causes if one.explained]
    wrong = [(one.case, one.stage) for one in result.stages if one.verdict == "out" and one.upstream != "dirty"
             and kind_of(one.stage) == first.stage]
    if len(known) >= CAUSES or not wrong:
        return result
    task = {"kit": str(kit.folder), "output": str(output), "chained": asked.chained, "tiers": dict(asked.tiers),
            "wrong": _of_few_cases(wrong), "seconds": seconds}
    found = [(f"{one['said']}, as if refgi's {one['file']}:{one['line']} were changed so in {one['function']}", one)
             for one in _run(task, first, tell)[: CAUSES - len(known)]]
    if not found:
        return result
    common = [CommonCause(cause=said, explained=one["explained"], tried=one["tried"]) for said, one in found]
    own = [Cause(cause=said, share=one["share"]) for said, one in found]
    stages = (_told(one, own) if (one.case, one.stage) == first.first else one for one in result.stages)
    finding = first.model_copy(update={"causes": (*known, *common)})
    return result.model_copy(update={"findings": (finding, *result.findings[1:]), "stages": tuple(stages)})


def _told(verdict: StageVerdict, found: list[Cause]) -> StageVerdict:
    """Return a verdict with more causes, in place of remarks that explain nothing."""
    known = [one for one in verdict.causes if one.share > 0]
    return verdict.model_copy(update={"causes": tuple([*known, *found][:CAUSES])})


def _of_few_cases(wrong: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the first stage of each of the first cases."""
    firsts: dict[str, str] = {}
    for case, stage in wrong:
        firsts.setdefault(case, stage)
    return list(firsts.items())[:MOST_CASES]


def _run(task: dict[str, object], first: Finding, tell: Tell) -> list[dict[str, Any]]:
    """Run the task in a process in which kernels are plain Python."""
    command = [sys.executable, "-m", "refgi.vectors.search.trial"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          env={**os.environ, "NUMBA_DISABLE_JIT": "1"}) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdin.write(json.dumps(task) + "\n")
        process.stdin.close()
        for line in process.stdout:
            said = json.loads(line)
            if "found" in said:
                return list(said["found"])
            tell(f"{first.stage}: {said['tried']} changes tried", said["done"])
        last = process.stderr.read().strip().splitlines()[-1:]
    raise RefgiError(f"search: the process ended with nothing: {''.join(last) or 'no output'}")
