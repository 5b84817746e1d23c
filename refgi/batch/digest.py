"""Digests of what stages give, by which a change is traced to the first stage that differs."""

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from refgi.stages import Log

DIGITS = 16


def hashes_of(log: Log, buffers: Mapping[str, Sequence[str]]) -> tuple[tuple[str, str], ...]:
    """Return the name and the digest of each stage's output of a recorded log, in the order in which stages ended.

    `buffers`: digests of shared buffers by stage, in the order in which they were used. They stand for what the stage
    gives whether it ran or gave back an earlier result; stages inside it are left out.
    """
    left = {name: list(digests) for name, digests in buffers.items()}
    ended: list[tuple[str, str]] = []
    running: list[tuple[int, str, str]] = []  # depth, name, digest of stages that are not known to have ended
    for run in log.runs:  # in the order in which they began
        while running and running[-1][0] >= run.depth:
            ended.append(running.pop()[1:])
        if run.status == "skipped" or any(name in left for _, name, _ in running):
            continue
        running.append((run.depth, run.name, left[run.name].pop(0) if run.name in left else digest_of(run.output)))
    return (*ended, *(one[1:] for one in reversed(running)))


def digest_of(value: Any) -> str:
    """Return a digest of a stage's output, in hexadecimal digits.

    Of arrays, numbers, text and None, in tuples, lists, mappings and dataclasses; of any other object its type alone.
    """
    digest = hashlib.sha256()
    for part in _parts(value):
        digest.update(part)
    return digest.hexdigest()[:DIGITS]


def _parts(value: Any) -> Iterator[bytes | memoryview]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).reshape(-1).view(np.uint8).data
    elif value is None or isinstance(value, bool | int | float | str | np.generic):
        yield f"{type(value).__name__} {value!r}".encode()
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key).encode()
            yield from _parts(value[key])
    elif isinstance(value, tuple | list):
        yield f"{type(value).__name__} {len(value)}".encode()
        for item in value:
            yield from _parts(item)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        yield from _parts([getattr(value, field.name) for field in dataclasses.fields(value)])
    else:
        yield type(value).__name__.encode()
