"""`refgi info`: methods, versions, processor, threads, cache."""

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
    from refgi.compare.provenance import environment
    from refgi.jit import cache_root
    from refgi.methods import METHODS

    facts = environment()
    facts["methods"] = {name: method.summary for name, method in METHODS.items()}
    files = [path for path in cache_root().rglob("*") if path.is_file()] if cache_root().is_dir() else []
    facts["cache"] = {"path": str(cache_root()), "files": len(files), "bytes": sum(p.stat().st_size for p in files)}
    facts["embree"] = _embree()
    session.result(_text(facts), facts)


command = _info


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
