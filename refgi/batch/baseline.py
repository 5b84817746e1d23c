"""A batch beside an earlier one: which figures are worse, in which pictures, and which stage changed first."""

from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

import pydantic

from refgi.batch.thresholds import Finding, figure_of, place_of
from refgi.bench.results import Result, Run
from refgi.errors import InputError

LESS_IS_BETTER = ("rmse", "rmse_unoccluded", "relmse", "flip")
MORE_IS_BETTER = ("ssim",)


def read_baseline(file: Path) -> Result:
    """Read the results.json of an earlier batch or bench; InputError if it cannot be read or is something else."""
    try:
        return Result.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}", file=str(file), key="--baseline") from error
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "content"
        raise InputError(f"{file}: {where}: expected results of a batch: {first['msg'].lower()}", file=str(file),
                         key="--baseline") from error


def worse(result: Result, baseline: Result, tolerance: float, folder: str = "") -> list[Finding]:
    """Return figures of a batch that are worse than an earlier one's by more than `tolerance`, a share of that.

    One finding a figure, with both pictures (the earlier ones in `folder`) and the first stage whose output is another.
    What only one of the results holds is passed over.
    """
    before = dict(_runs(baseline))
    return [finding for key, run in _runs(result) if key in before
            for finding in _worse(key, run, before[key], tolerance, folder)]


def first_change(now: Run, before: Run) -> str | None:
    """Return the first stage of one method and setting whose output is not what it was.

    None where all are the same or one of the runs holds no digests.
    """
    if not (now.hashes and before.hashes):
        return None
    return next((one[0] if one else other[0] for one, other in zip_longest(now.hashes, before.hashes)
                 if one != other), None)


def _runs(result: Result) -> Iterator[tuple[tuple[str, str, tuple[str, ...]], Run]]:
    for scene in result.scenes:
        yield from (((scene.scene, run.method, run.changes), run) for run in (*scene.runs, *scene.line))


def _worse(key: tuple[str, str, tuple[str, ...]], now: Run, before: Run, tolerance: float, folder: str
           ) -> Iterator[Finding]:
    for figure in (*LESS_IS_BETTER, *MORE_IS_BETTER):
        old, new = figure_of(before, figure), figure_of(now, figure)
        if old is None or new == old:
            continue
        if new is None or (new - old if figure in LESS_IS_BETTER else old - new) > tolerance * abs(old):
            text = f"was {old:.4g} and is {'not known' if new is None else f'{new:.4g}'}"
            pictures = [*([now.picture] if now.picture else []),
                        *([f"before: {Path(folder) / before.picture}"] if before.picture else [])]
            yield Finding(place_of(key[0], key[1], now.label), figure, text, tuple(pictures),
                          first_change(now, before))
