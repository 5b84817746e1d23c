"""--preset and --set: a method's settings from text, and `refgi settings`, which lists them."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import speech
from refgi.cli.session import Session, table
from refgi.errors import InputError, expect, first_faults

if TYPE_CHECKING:
    from refgi.provenance.frames import StillFrames

preset = click.option("--preset", default="default", show_default=True, metavar="NAME",
                      help="Named settings to start from: default, or paper for the values printed.")


def settings_for(method: str, pairs: Iterable[str], seed: int | None = None, preset: str = "default") -> Any:
    """Make a method's settings from a preset and texts.

    Texts such as ``lights=1024``, ``visibility=csm`` or ``as_published=sii_no_pi,sii_widening``; `seed`: value of the
    key ``seed``. An InputError names all unknown keys and values that are not usable.
    """
    from refgi.methods import find_method
    from refgi.settings import from_text

    known = find_method(method)
    try:
        return from_text(known.preset(preset), [*pairs, *([] if seed is None else [f"seed={seed}"])])
    except InputError as error:
        raise InputError(f"{error} (`refgi settings {method}` lists the keys)", key=error.key) from error


def has_seed(method: str) -> bool:
    """Return whether a method draws random numbers: whether any of its settings is a seed."""
    from refgi.methods import find_method
    from refgi.settings import leaves

    return any(leaf.key.rpartition(".")[2] == "seed" for leaf in leaves(find_method(method).settings))


def still_frames(
    methods: Iterable[str], frames: int | None, pairs: Iterable[str]
) -> "StillFrames | None":
    """Return how many frames of a resting scene methods are to blend, and by which filter, set by `pairs`.

    None where --frames is absent. InputError if none of the methods has a temporal filter, or a setting is wrong or of
    no use.
    """
    from refgi.methods import require_filter
    from refgi.settings import from_text

    pairs = list(pairs)
    if frames is None:
        expect(not pairs, "--temporal", "--frames beside it", " ".join(pairs))
        return None
    from refgi.provenance.frames import StillFrames
    from refgi.sssil.temporal import TemporalSettings

    require_filter(methods)
    return StillFrames(frames, from_text(TemporalSettings(), pairs))


def by_method(pairs: Iterable[str], methods: Iterable[str]) -> dict[str, list[str]]:
    """Sort texts such as ``sii.lights=1024`` by method: ``key=value`` for each.

    An InputError names all whose method is missing or unknown.
    """
    from refgi.scene.files import did_you_mean

    sorted_pairs: dict[str, list[str]] = {name: [] for name in methods}
    errors = []
    for pair in pairs:
        name, dot, rest = pair.partition(".")
        if not dot or "=" in name:
            errors.append(f"--set {pair!r}: expected METHOD.key=value")
        elif name not in sorted_pairs:
            errors.append(f"--set {pair!r}: {name!r} is not compared here ({', '.join(sorted_pairs)})"
                          + did_you_mean(name, sorted_pairs))
        else:
            sorted_pairs[name].append(rest)
    if errors:
        raise InputError(first_faults(errors, "; "), key="--set")
    return sorted_pairs


@click.command("settings")
@click.argument("method")
@preset
@click.option("--all", "everything", is_flag=True, help="Also keys of other choices, and those for studies.")
@speech
@click.pass_obj
def _settings(session: Session, /, method: str, preset: str, everything: bool) -> None:
    """List what a method can be set to by --set.

    Shows keys, values, what they take and what they are.

    A key may be shortened to what tells it apart from the others: terms for visibility.terms.
    """
    from refgi.methods import find_method
    from refgi.settings import flat, schema

    known = find_method(method)
    values = flat(known.preset(preset))
    rows = _rows(known.settings, values, everything)
    head = f"{method}: {known.summary}\npresets: {', '.join(['default', *known.presets])}"
    hidden = "" if everything else "\n\n--all also shows the keys of other choices, and those for studies"
    content = {"method": method, "preset": preset, "values": values, "schema": schema(known.settings),
               "presets": {name: flat(settings) for name, settings in known.presets.items()}}
    session.result(f"{head}\n\n{table([('key', 'value', 'takes', 'what it is'), *rows])}{hidden}", content)


command = _settings


def _rows(kind: Any, values: Mapping[str, Any], everything: bool) -> list[tuple[str, ...]]:
    from refgi.provenance import plain
    from refgi.settings import leaves

    rows: list[tuple[str, ...]] = []
    for leaf in {leaf.key: leaf for leaf in leaves(kind)}.values():
        if not everything and (leaf.is_for_study or leaf.key not in values):
            continue
        value = plain(values[leaf.key]) if leaf.key in values else "-"
        shown = "none" if value is None else ",".join(value) if isinstance(value, list) else str(value)
        rows.append((leaf.key, shown, leaf.expected, leaf.about))
    return rows
