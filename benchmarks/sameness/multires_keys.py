"""Names of the ledger's cases of `multires` as keys of its settings."""

from typing import Any

KEYS = {"light_threshold": "subsplats.threshold", "threshold_form": "subsplats.form",
        "refinement": "subsplats.criteria.traversal", "target_error": "subsplats.target"}
CRITERIA = {"depth": "range", "derivative": "slope", "normal": "range", "curvature": "chord"}


def multires_keys(named: dict[str, Any]) -> dict[str, Any]:
    """Return values by key; "criteria" are joined by "+", and "curvature" is the form of that criterion."""
    made = {KEYS.get(name, name): value for name, value in named.items()
            if name not in ("criteria", "curvature", "per_light")}
    if named.get("per_light", "shared") != "shared":
        made["subsplats"] = "irradiance"
    if named.get("per_light") == "shared_then_light":
        made["subsplats.criteria"] = "geometry"
    if "target_error" in named:
        made["subsplats"] = "error"
    if "criteria" in named:
        forms = CRITERIA | {"curvature": named.get("curvature", "chord")}
        chosen = named["criteria"].split("+")
        made |= {f"subsplats.criteria.{name}": form if name in chosen else "none" for name, form in forms.items()}
    return made
