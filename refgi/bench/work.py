"""What a picture takes beside time: pairs, rays, bytes, memory; and how long the first one of a new process takes."""

import contextlib
import json
import subprocess
import sys
import time
import tracemalloc
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

from refgi import stages
from refgi.bench.grid import Choice
from refgi.bench.results import Work
from refgi.errors import RefgiError, RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS
from refgi.scene import Scene

Tell = Callable[[str, float], None]
Key = TypeVar("Key")
Figure = TypeVar("Figure")

FIRST_FRAME = """
import json, sys, warnings
warnings.simplefilter("ignore")
from refgi.methods import render
render(sys.argv[1], sys.argv[2], **json.loads(sys.argv[3]))
"""
LONGEST = 600.0  # s that a new process may take


def works_of(scene: Scene, choices: Sequence[Choice], options: Mapping[str, Any], tell: Tell) -> dict[int, Work]:
    """Count what each of some choices takes, by its number; those that give no picture are left out."""
    return _of_each({number: (f"counting {choice.method}: {choice.label}", partial(work_of, scene, choice, options))
                     for number, choice in enumerate(choices)}, tell)


def first_frames(source: str, methods: Sequence[str], options: Mapping[str, Any], tell: Tell) -> dict[str, float]:
    """Return `cold_seconds` of each of some methods by name; those that give no picture are left out."""
    return _of_each({name: (f"new process: {name}", partial(cold_seconds, source, name, options)) for name in methods},
                    tell)


def _of_each(asked: Mapping[Key, tuple[str, Callable[[], Figure]]], tell: Tell) -> dict[Key, Figure]:
    """Return what each gives that is asked, told before; without those that fail."""
    found = {}
    for number, (key, (what, made)) in enumerate(asked.items()):
        tell(what, number / len(asked))
        with quietly():
            found[key] = made()
    return found


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Leave warnings and errors to the real run, which says them."""
    with warnings.catch_warnings(), contextlib.suppress(RefgiError):
        warnings.simplefilter("ignore", RefgiWarning)
        yield


def work_of(scene: Scene, choice: Choice, options: Mapping[str, Any]) -> Work:
    """Count what one frame takes, its buffers included; what the scene holds itself counts as nothing.

    Memory is that of arrays and objects of Python; trees of Embree and what kernels hold inside are not seen.
    """
    running = tracemalloc.is_tracing()
    if not running:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before, _ = tracemalloc.get_traced_memory()
        with stages.observe(counting=True) as log:
            METHODS[choice.method].made(Frame(scene, **options), choice.settings)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        if not running:
            tracemalloc.stop()
    counts = log.counts or Counter()
    return Work(pairs=counts["pairs"], rays=counts["rays"], bytes=counts["bytes"], peak_bytes=max(0, peak - before))


def cold_seconds(source: str, method: str, options: Mapping[str, Any]) -> float:
    """Return how long a new process takes to its first frame, s: Python, kernels from the cache, the scene, the frame.

    The method at its defaults; `source`: a scene's name or path. RefgiError if the process gives no frame.
    """
    command = [sys.executable, "-c", FIRST_FRAME, source, method, json.dumps(dict(options))]
    started = time.perf_counter()
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=LONGEST)
    except (subprocess.SubprocessError, OSError) as error:
        last = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
        raise RefgiError(f"{method}: a new process gave no frame of {source}: {''.join(last)}") from error
    return time.perf_counter() - started
