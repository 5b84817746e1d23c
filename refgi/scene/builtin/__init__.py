"""Scenes made by formula, with parameters: what the demo, the tests and the benchmarks render without any file."""

from refgi.scene.builtin.catalogue import SCENES, BuiltinScene, build_named, builtin_scenes

__all__ = ["SCENES", "BuiltinScene", "build_named", "builtin_scenes"]
