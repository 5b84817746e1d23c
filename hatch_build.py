"""A wheel that brings compiled kernels along is for one Python and one platform."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Name the wheel after what its kernels run on."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Look for kernels."""
        if version == "standard" and any(Path(self.root).glob("refgi/jit/brought/*.kernel")):
            build_data.update(pure_python=False, infer_tag=True)
