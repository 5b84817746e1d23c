"""Write docs/papers.md: `python docs/papers_page.py [RESULTS ...]`, results.json of `python -m benchmarks paper`.

Figures of the results take the place of those in benchmarks/results/papers.json; the page sets them beside what
docs/papers.toml says the papers claim. A claim without a record, of a figure or of a row that a small run lacks, is
"not measured"; a column that a recorded table lacks is an error.
"""

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

from refgi.compare.pages import number
from refgi.image import canonical_json

PAGE = Path(__file__).with_name("papers.md")
CLAIMS, RECORD = PAGE.with_suffix(".toml"), PAGE.parents[1] / "benchmarks" / "results" / "papers.json"
NEAR = 1.25  # times: as near as a number must come
FITTED = "fitted"  # begins why, where a parameter was chosen for the print
RATES = {"GPU": "a graphics processor's rate; cores here", "GPU ms": "a graphics processor's time; cores here"}
TITLES = {"sii": "Splatting Indirect Illumination", "multires": "Adaptive multiresolution splatting",
          "val": "Clustered visibility", "hssil": "Hierarchical screen-space indirect illumination"}
HEAD = """# What the papers claim, and what comes of it

Every number that the four papers claim of speed, counts and errors, and the same of refgi, from recorded runs of
`python -m benchmarks paper` (`benchmarks/results/papers.json`). Met is what comes within a factor of {near} of the
print, of a rate also what is faster, or keeps a printed bound; what was fitted to the print is called so and counts as
neither. Scenes are stand-ins of the papers' face counts. Rates are of whole frames, at the size of the run, beside
those of graphics processors of 2006 to 2009; ratios within a run say more. A figure's own notes, on the page of a run,
say more of why.

This page is made by `python docs/papers_page.py`."""

Record = dict[str, dict[str, Any]]


def page(claims: dict[str, Any], record: dict[str, Record]) -> str:
    """Return the page: a table a paper, a row a claim."""
    blocks = [HEAD.format(near=NEAR)]
    for paper, rows in claims.items():
        found = record.get(paper, {})
        told = [(*row, cells(found, row[3])) for row in rows]
        verdicts = [verdict(printed, ours, why) for _, _, printed, _, why, ours in told]
        lines = [f"| {where} | {what} | {printed.replace('>', '> ').replace('<', '< ')} | {shown(ours)} | {met} | "
                 f"{'' if met == 'yes' else RATES.get(why, why)} |"
                 for (where, what, printed, _, why, ours), met in zip(told, verdicts, strict=True)]
        blocks += [f"## {TITLES[paper]}", counted(verdicts) + runs(found),
                   "| where | what | printed | here | met | why not |\n|---|---|--:|--:|---|---|\n" + "\n".join(lines)]
    return "\n\n".join(blocks) + "\n"


def cells(found: Record, names: str) -> float | None:
    """Return a cell of a figure's table, or the quotient of two; None where the figure is not recorded."""
    values = [cell(found, *(part.strip() for part in name.split("::"))) for name in names.split("//") if name]
    if not values or None in values:
        return None
    return values[0] if len(values) == 1 else values[0] / values[1]


def cell(found: Record, figure: str, row: str, column: str) -> float | None:
    """Return one cell, None where its figure or row is not recorded; a column that the table lacks raises KeyError."""
    key, _, number_of_table = figure.partition("#")
    if key not in found:
        return None
    table = found[key]["tables"][int(number_of_table or 0)]
    if column not in table["columns"]:
        raise KeyError(f"{figure} :: {row} :: {column}")
    lines = {line[0]: line for line in table["rows"]}
    return float(lines[row][table["columns"].index(column)]) if row in lines else None


def verdict(printed: str, ours: float | None, why: str) -> str:
    """Return whether ours is near the print, or on the side of its bound."""
    if ours is None:
        return "not measured"
    if why.startswith(FITTED):
        return FITTED
    value = float(printed.lstrip("<>"))
    near = ours >= value / NEAR or why == "GPU ms", ours <= value * NEAR or why == "GPU"
    met = {">": ours > value, "<": ours < value}.get(printed[0], all(near))
    return "yes" if met else "no"


def shown(ours: float | None) -> str:
    """Return a number as tables have it."""
    return "" if ours is None else number(ours)


def counted(verdicts: list[str]) -> str:
    """Return how many claims came out how."""
    kinds = (("yes", "met"), ("no", "not met"), (FITTED, FITTED), ("not measured", "not measured"))
    return f"Of {len(verdicts)}: " + ", ".join(f"{verdicts.count(kind)} {said}" for kind, said in kinds) + "."


def runs(found: Record) -> str:
    """Return how large the recorded figures were made, where there are any."""
    made = sorted({f"{one['size']}² pixels ({one['scale']} scale) on {one['threads']} threads of {one['cpu']}"
                   for one in found.values()})
    return f" Runs: {', '.join(made)}." if made else ""


def taken_over(record: dict[str, Record], results: dict[str, Any]) -> None:
    """Put the figures of a run in the record."""
    kept = record.setdefault(results["paper"]["name"], {})
    made = {name: results["scale"][of] for name, of in (("scale", "name"), ("size", "size"))}
    made |= {name: results["environment"][name] for name in ("cpu", "threads")}
    kept |= {key: made | {"tables": [{name: table[name] for name in ("columns", "rows")} for table in figure["tables"]]}
             for key, figure in results["figures"].items() if "tables" in figure}


def read(path: Path) -> Any:
    """Return what a JSON file holds."""
    return json.loads(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    content = read(RECORD) if RECORD.is_file() else {}
    for argument in sys.argv[1:]:
        taken_over(content, read(Path(argument)))
    RECORD.write_text(canonical_json(content) + "\n", encoding="utf-8")
    PAGE.write_text(page(tomllib.loads(CLAIMS.read_text(encoding="utf-8")), content), encoding="utf-8")
