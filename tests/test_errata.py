"""Ids of gaps and misprints lead somewhere: docs/errata.md has each that is used."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
ID = re.compile(r"E-(?:SII|VAL|HSS|AMS)-\d\d")
PLACES = ("refgi", "tests", "benchmarks", "docs", "examples")


def test_every_id_is_explained():
    explained = set(re.findall(rf"^\| ({ID.pattern}) \|", (ROOT / "docs" / "errata.md").read_text(), re.MULTILINE))
    files = [file for place in PLACES for suffix in ("py", "md", "c", "comp", "glsl", "toml")
             for file in (ROOT / place).rglob(f"*.{suffix}") if "_build" not in file.parts]
    used = {one: file for file in files for one in ID.findall(file.read_text())}
    assert {one: str(file) for one, file in used.items() if one not in explained} == {}
    assert len(explained) > 40
