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
from refgi.scene.texture import Image, Texture

__all__ = [
    "BuiltinScene",
    "Camera",
    "DirectionalLight",
    "Geometry",
    "Image",
    "Light",
    "LightTable",
    "Material",
    "MaterialTable",
    "Mesh",
    "PointLight",
    "Scene",
    "SpotLight",
    "Texture",
    "builtin_scenes",
    "light_table",
    "load_scene",
    "material_table",
    "merge",
]
