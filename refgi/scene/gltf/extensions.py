"""Extensions of glTF: which are honoured, which change no light, and how many uses of the others are passed over.

Compressed meshes and images of formats that are not read are refused, with a tool that unpacks them.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from refgi.errors import InputError

HONOURED = frozenset({
    "EXT_mesh_gpu_instancing", "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness", "KHR_mesh_quantization", "KHR_texture_transform"})
# warned of by materials themselves:
APART = frozenset({"KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume"})
# choices, names, tags, sounds, physics and behaviour: the picture of the file as it stands is the same
HARMLESS = frozenset({
    "AGI_articulations", "AGI_stk_metadata", "CESIUM_primitive_outline", "EXT_feature_metadata",
    "EXT_instance_features", "EXT_mesh_features", "EXT_structural_metadata", "GODOT_single_root",
    "KHR_animation_pointer", "KHR_audio_emitter", "KHR_audio_graph", "KHR_collision_shapes", "KHR_implicit_shapes",
    "KHR_interactivity", "KHR_materials_variants", "KHR_node_hoverability", "KHR_node_selectability",
    "KHR_physics_rigid_bodies", "KHR_rigid_bodies", "KHR_xmp", "KHR_xmp_json_ld", "MPEG_audio_spatial", "MSFT_lod",
    "MSFT_packing_normalRoughnessMetallic", "MSFT_packing_occlusionRoughnessMetallic", "OMI_collider",
    "OMI_physics_body", "OMI_physics_shape", "OMI_spawn_point", "VRM", "VRMC_node_constraint",
    "VRMC_springBone", "VRMC_vrm"})
DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
IMAGES = {"KHR_texture_basisu": "KTX2", "EXT_texture_webp": "WebP", "EXT_texture_avif": "AVIF",
          "MSFT_texture_dds": "DDS"}
UNPACKED_BY = {
    **dict.fromkeys((DRACO, *MESHOPT), "gltf-transform copy IN OUT"),
    **dict.fromkeys(IMAGES, 'gltf-transform png IN OUT --formats "*"'),
    "KHR_texture_basisu": "gltf-transform ktxdecompress IN OUT", "MSFT_texture_dds": "magick IMAGE.dds IMAGE.png"}
# Nothing else that is required by a file can be passed over without drawing something wrong.
READABLE = HONOURED | APART | HARMLESS | UNPACKED_BY.keys()


def packed(where: str, what: str, extension: str) -> InputError:
    """Return the error of data that only a compressed form holds, with the command of a tool that unpacks them."""
    return InputError(f"{where}: {what} ({extension}) are not read; `{UNPACKED_BY[extension]}` unpacks them")


def unread(tree: dict[str, Any]) -> Iterator[tuple[str, int]]:
    """Yield each extension that a document uses and that is passed over, and how many of its objects have it."""
    listed = tree.get("extensionsUsed", [])
    names = {name for name in listed if isinstance(name, str)} if isinstance(listed, list) else set()
    if found := names - READABLE:
        yield from sorted(_uses(tree, found).items())


def _uses(tree: dict[str, Any], names: set[str]) -> Counter[str]:
    found: Counter[str] = Counter()
    pending: list[Any] = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, dict):
            extensions = node.get("extensions")
            if isinstance(extensions, dict):
                found.update(names & extensions.keys())
            pending += [value for value in node.values() if isinstance(value, dict | list)]
        else:
            pending += [value for value in node if isinstance(value, dict | list)]
    return found
