"""Where the names of a case become settings: names of a ledger stay as they are when settings are renamed."""

from collections.abc import Callable
from typing import Any, Literal, get_args, get_origin

from refgi.methods import METHODS
from refgi.scene import Camera
from refgi.settings import Settings, choices_of, flat, leaves, replaced
from refgi.settings.fields import is_choice, may_be_none
from refgi.settings.keys import PRINTED, SEED, find_key
from refgi.sssil.temporal import TemporalSettings

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


def val_keys(named: dict[str, Any]) -> dict[str, Any]:
    """Return names of `val` with the choices that they stand for."""
    made = dict(named)
    if made.get("visibility") == "step":  # its bias is one of a scale, and only without the receiver's plane
        bias = {"visibility.constant_bias.value": made.pop("bias", None) or 0.0,
                "visibility.constant_bias.scale": made.pop("depth_scale", "log_map")}
        if not made.pop("receiver_plane", True):
            made |= {"visibility.constant_bias": "constant_bias"} | bias
    return made


SETS = ("as_published", "criteria")  # names joined by "+"
VIEWS = {"cornell_side": Camera((0.5, 0.3, -0.6), (0.2, 0.2, 0.3)),
         "stage_side": Camera((0.9, 0.4, 0.9), (0.0, 0.1, 0.0))}
# names of the ledger that are no short keys today, and values that have another name
RENAMED: dict[str, dict[str, str]] = {
    "val": {"dealing": "interleaving.assignment", "area_lights": "clusters.count", "map_resolution": "maps.resolution",
            "maps": "maps.renderer", "extent": "area.extent", "receiver_plane": "visibility.constant_bias"},
    "sii": {"i_low": "reach.cut.share", "irradiance_low": "reach.cut.irradiance", "mesh_faces": "reach.bound.faces",
            "stochastic_range": "reach.stochastic"},
    "vpl": {"levels": "maps.levels"},
}
# single values that are another key's value today
RENAMED_CASES: dict[tuple[str, str, Any], tuple[str, Any]] = {("gather", "grid", 0): ("interpolation", "none")}
RENAMED_VALUES: dict[tuple[str, str], dict[Any, Any]] = {
    ("truth", "emitters"): {"seen": "visible"},
    ("val", "visibility"): {"series": "csm", "step": "pcss", "rectangle": "rays_rectangle", "members": "rays_vpls"}}
# of methods whose names became choices: what names together are today
TRANSLATIONS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "multires": multires_keys, "val": val_keys}


def settings_of(method: str, **named: Any) -> Any:
    """Return the settings of a method, of which some differ from the default; "temporal" is the temporal filter."""
    named = translated(method, named)
    for name in named.keys() & set(SETS):
        named[name] = frozenset(filter(None, named[name].split("+")))
    if "views" in named:
        named["views"] = (VIEWS[named["views"]],)
    return replaced(_settings_class(method)(), named)


def translated(method: str, named: dict[str, Any]) -> dict[str, Any]:
    """Return what names and values of the ledger are today."""
    named = TRANSLATIONS[method](named) if method in TRANSLATIONS else named
    return dict(renamed(method, name, value) for name, value in named.items())


def renamed(method: str, name: str, value: Any) -> tuple[str, Any]:
    """Return what a name and a value of the ledger are called today."""
    if isinstance(value, str):
        value = RENAMED_VALUES.get((method, name), {}).get(value, value)
    elif (method, name, value) in RENAMED_CASES:
        return RENAMED_CASES[method, name, value]
    return RENAMED.get(method, {}).get(name, name), value


def key_of(method: str, name: str) -> str:
    """Return the whole key that a name means."""
    if name in (PRINTED, SEED):
        return name
    return find_key(_settings_class(method)(), RENAMED.get(method, {}).get(name, name)).key


def choice_of(method: str, key: str) -> tuple[str, str] | None:
    """Return the choice that has a setting, and its name; None for a setting that is always there."""
    kind = _settings_class(method)
    found = [leaf for leaf in leaves(kind) if leaf.key == key]
    above = [leaf for leaf in leaves(kind) if leaf.key == key.rpartition(".")[0]] if len(found) == 1 else []
    return (above[0].key, found[0].owner.name()) if above else None


def names_of(method: str) -> dict[str, set[Any]]:
    """Return every setting of a method, each with the values that a ledger must have beside the default."""
    kind = _settings_class(method)
    wanted: dict[str, set[Any]] = {}
    defaults = flat(kind())
    for leaf in leaves(kind):
        last = leaf.key.rpartition(".")[2]
        values = wanted.setdefault(last if last in (PRINTED, SEED) else leaf.key, set())
        if last == PRINTED:
            values |= leaf.owner.SWITCHES
        elif is_choice(leaf.hint):
            names = {*choices_of(leaf.hint), *(["none"] if may_be_none(leaf.hint) else [])}
            values |= names - {defaults.get(leaf.key) or "none"}
        elif get_origin(leaf.hint) is Literal:
            values |= {*get_args(leaf.hint)} - {defaults.get(leaf.key, leaf.field.default)}
        elif leaf.hint is bool:
            values |= {not leaf.field.default}
    return wanted


def _settings_class(method: str) -> type[Settings]:
    return TemporalSettings if method == "temporal" else METHODS[method].settings
