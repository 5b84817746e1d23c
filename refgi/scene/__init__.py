"""Scenes from files and built-in procedural ones, as one frozen model."""

from refgi.scene.builtin import BuiltinScene, builtin_scenes
from refgi.scene.load import load_scene
from refgi.scene.model import (
    Camera,
    DirectionalLight,
    Geometry,
    Light,
    LightTable,
    Material,
    MaterialTable,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    light_table,
    material_table,
    merge,
)

__all__ = [
    "BuiltinScene",
    "Camera",
    "DirectionalLight",
    "Geometry",
    "Light",
    "LightTable",
    "Material",
    "MaterialTable",
    "Mesh",
    "PointLight",
    "Scene",
    "SpotLight",
    "builtin_scenes",
    "light_table",
    "load_scene",
    "material_table",
    "merge",
]
