"""What is lit: scenes from files and built-in procedural ones, as one frozen model."""

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
    "light_table",
    "material_table",
    "merge",
]
