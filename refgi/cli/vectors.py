"""`refgi vectors`: stage-by-stage test vectors for ports, and the check of a port's arrays against them."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from refgi.cli.options import speech
from refgi.cli.session import Session, progress, say, table

if TYPE_CHECKING:
    from refgi.vectors.manifest import Result, StageVerdict


@click.group("vectors")
def command() -> None:
    """Test vectors of every stage, and a port's check against them."""


@command.command("export")
@click.option("--kit", default="quick", show_default=True, type=click.Choice(["quick", "full"]), help="Which cases.")
@click.option("--out", required=True, help="Folder of the kit; a kit there is replaced.")
@click.option("--case", help="Only cases whose id begins so.")
@speech
@click.pass_obj
def _export(session: Session, /, kit: str, out: str, case: str | None) -> None:
    """Write a kit: arrays of every stage, bounds, likely bugs, scenes, schemas, and how to read them."""
    from refgi.vectors.export import export_kit

    with progress() as tell:
        made = export_kit(kit, Path(out), tell, case)
    size = sum(file.stat().st_size for file in Path(out).rglob("*") if file.is_file())
    rows = [("case", "what it holds"), *((entry.id, entry.what) for entry in made.cases)]
    session.result(f"{table(rows)}\n{out}: {len(made.cases)} cases, {size / 1e6:.1f} MB, vectors {made.vectors}",
                   {"kit": kit, "vectors": made.vectors, "cases": [entry.id for entry in made.cases], "bytes": size})


@command.command("check")
@click.argument("kit")
@click.argument("output")
@click.option("--chained", is_flag=True, help="The port has read its own outputs, not the kit's.")
@click.option("--stage", "stages", multiple=True, metavar="NAME", help="Only stages whose name begins so; repeatable.")
@click.option("--case", "cases", multiple=True, metavar="ID", help="Only cases whose id begins so; repeatable.")
@click.option("--tier", "tiers", multiple=True, metavar="[STAGE=]TIER",
              help="T0 equal, T1 float32 rounding, T2 storage in half floats, T2B in 8 bits; repeatable.")
@click.option("--search", "seconds", type=click.FloatRange(min=0, min_open=True), metavar="SECONDS",
              help="Try single changes of refgi's own source on the first wrong stage, for so long.")
@click.option("--json", "json_file", metavar="FILE", help="Write the verdicts as JSON.")
@click.option("--html", "html_file", metavar="FILE", help="Write a page with the arrays side by side.")
def _check(
    kit: str, output: str, chained: bool, stages: tuple[str, ...], cases: tuple[str, ...], tiers: tuple[str, ...],
    seconds: float | None, json_file: str | None, html_file: str | None,
) -> int:
    """Judge the arrays in OUTPUT by KIT: the first wrong stage, its worst element, likely causes.

    OUTPUT holds <case>/<array>.npy. Stages without arrays are not run and do not count, unless --stage asks for them.

    Exit codes: 0 all within their bounds, 1 a stage is out, 4 not comparable, 5 kit or output damaged.
    """
    from refgi.vectors.check import DAMAGED, Asked, DamagedError, Kit, check_output

    asked = Asked(chained, stages, cases, tiers_of(tiers))
    try:
        opened = Kit(Path(kit))
        result = check_output(opened, Path(output), asked)
        if seconds is not None:
            from refgi.vectors.search import searched

            with progress() as tell:
                result = searched(opened, Path(output), asked, result, seconds=seconds, tell=tell)
        if json_file is not None:
            from refgi.image.whole import write_text
            from refgi.vectors.manifest import text_of

            write_text(json_file, text_of(result))
        if html_file is not None:
            from refgi.vectors.page import write_page

            write_page(html_file, opened, Path(output), result)
    except DamagedError as error:
        say(str(error))
        return DAMAGED
    click.echo(report(result))
    return result.exit_code


def tiers_of(texts: tuple[str, ...]) -> dict[str, str]:
    """Return tiers by the beginning of stages' names, "" for all, from texts such as "T2" and "rsm=T2".

    Raises
    ------
    UsageError
        If a tier is none.
    """
    from refgi.vectors.check import TIERS

    found = {}
    for text in texts:
        start, _, tier = text.rpartition("=")
        if tier.upper() not in TIERS:
            raise click.UsageError(f"--tier: expected [STAGE=]TIER with a tier of {', '.join(TIERS)}, got {text!r}")
        found[start] = tier.upper()
    return found


def report(result: "Result") -> str:
    """Return what people read: one line a stage that ran, then what is wrong, by kinds of stages."""
    from refgi.vectors.words import stories

    ran = [one for one in result.stages if one.verdict != "not-run"]
    rows = [("case", "stage", "verdict", "worst / bound", "")]
    rows += [(one.case, one.stage, one.verdict, _worst(one), _remark(one)) for one in ran]
    lines = [table(rows)] if ran else []
    for one in stories(result):
        lines += ["", *one]
    lines += ["", *(f"unknown: {one}" for one in result.unknown)] if result.unknown else []
    if not ran:
        lines.append("OUTPUT/<case>/<array>.npy is where arrays are looked for")
    idle = len(result.stages) - len(ran)
    tally = {kind: sum(one.verdict == kind for one in ran) for kind in ("exact", "within", "out", "invalid")}
    counts = ", ".join(f"{count} {kind}" for kind, count in tally.items() if count)
    lines += ["", f"{result.mode}: {counts or 'nothing to check'}" + (f"; {idle} stages not run" if idle else "")]
    if result.first is not None:
        lines.append(f"first wrong stage: {result.first[1]} of {result.first[0]}")
    return "\n".join(lines)


def _worst(stage: "StageVerdict") -> str:
    ratios = [one.worst for one in stage.arrays if one.worst is not None]
    if stage.verdict == "invalid" or (stage.verdict == "out" and not any(ratios)):
        return ""
    return f"{max(ratios):.3g}" if ratios else ""


def _remark(stage: "StageVerdict") -> str:
    masked = sum(one.masked for one in stage.arrays)
    remarks = [f"{masked} edge elements differ"] if masked else []
    remarks += ["made from wrong inputs"] if stage.upstream == "dirty" else []
    remarks += [stage.causes[0].cause] if stage.causes else []
    return "; ".join(remarks)
