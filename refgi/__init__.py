"""A CPU reference of four one-bounce indirect-light methods, judged by path tracing.

The names here are loaded when first used, so that `import refgi` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from refgi.animation import frames
    from refgi.compare import compare
    from refgi.frame import Frame
    from refgi.methods import render
    from refgi.scene import load_scene

__all__ = ["Frame", "compare", "frames", "load_scene", "render"]
__version__ = "0.1.0"

_HOME = {
    "Frame": "refgi.frame",
    "compare": "refgi.compare",
    "frames": "refgi.animation",
    "load_scene": "refgi.scene",
    "render": "refgi.methods",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'refgi' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
