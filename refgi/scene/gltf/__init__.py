"""glTF 2.0 and GLB: triangles, base colours, emission, punctual lights and cameras.

The container and its accessors are read here with NumPy and not through trimesh: trimesh rounds base colours to eight
bits, drops emission strength, lights and cameras, so that the JSON has to be read anyway; and an accessor is a bounds
check and a view of the buffer once that is done. Meshes stand in their rest pose, morphed and skinned; animations are
passed over.
"""

from refgi.scene.gltf.read import read_gltf

__all__ = ["read_gltf"]
