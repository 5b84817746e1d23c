"""`refgi info`: methods, versions, processor, threads, cache."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from refgi.cli.options import speech
from refgi.cli.session import Session, table


@click.command("info")
@speech
@click.pass_obj
def _info(session: Session, /) -> None:
    """Show methods, versions, CPU features, threads and cache."""
    from refgi.compare.report import environment
    from refgi.jit import cache_root
    from refgi.methods import METHODS

    facts = environment()
    facts["methods"] = {name: method.summary for name, method in METHODS.items()}
    sizes = list(_sizes(cache_root()))
    facts["cache"] = {"path": str(cache_root()), "files": len(sizes), "bytes": sum(sizes)}
    facts["embree"] = _embree()
    session.result(_text(facts), facts)


command = _info


def _sizes(folder: Path) -> Iterator[int]:
    """Yield the bytes of each file below a folder; other processes may write and remove files meanwhile."""
    for path, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(OSError):
                yield Path(path, name).stat().st_size


def _embree() -> str:
    import numpy as np

    from refgi.rays.embree import RunBackend, open_backend

    backend = open_backend(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    return "embreex's run" if isinstance(backend, RunBackend) else "by address"


def _text(facts: dict[str, Any]) -> str:
    cache = facts["cache"]
    rows = [(name, said or "not installed") for name, said in facts["versions"].items()]
    rows += [
        ("platform", facts["platform"]), ("cpu", facts["cpu"]), ("simd", " ".join(facts["simd"])),
        ("threads", str(facts["threads"])), ("embree", facts["embree"]),
        ("cache", f"{Path(cache['path'])} ({cache['files']} files, {cache['bytes'] / 2**20:.1f} MiB)"),
    ]
    return f"{table(rows)}\n\n{table(list(facts['methods'].items()))}"
