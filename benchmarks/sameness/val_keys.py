"""What names of the ledger of `val` are today, where several together became a choice."""

from typing import Any


def val_keys(named: dict[str, Any]) -> dict[str, Any]:
    """Return names of `val` with the choices that they stand for."""
    made = dict(named)
    if "target_error" in made:
        made["clusters"] = "adaptive"
        made.pop("area_lights", None)
    if made.get("visibility") == "step":  # its bias is one of a scale, and only without the receiver's plane
        bias = {"visibility.constant_bias.value": made.pop("bias", None) or 0.0,
                "visibility.constant_bias.scale": made.pop("depth_scale", "log_map")}
        if not made.pop("receiver_plane", True):
            made |= {"visibility.constant_bias": "constant_bias"} | bias
    return made
