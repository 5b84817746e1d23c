"""The lines of OBJ and MTL files, as words and numbers."""

from collections.abc import Iterator
from pathlib import Path

from refgi.errors import expect
from refgi.scene.files import read_text

TEXTURES = ("bump", "disp", "decal", "norm", "refl")  # and all that starts with map_
NAMED = ("newmtl", "usemtl", "mtllib", *TEXTURES)  # what a name follows


def lines_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line that says something, continued lines joined."""
    for number, line in enumerate(read_text(path).replace("\\\n", " ").split("\n"), 1):
        words = line.split()
        if words and "#" in line:
            words = _without_comment(words, line)
        if words:
            yield number, words


def _without_comment(words: list[str], line: str) -> list[str]:
    """Return the words before a comment; in a name, such as "Material #25", only a lone # starts one."""
    if words[0].lower() in NAMED or words[0].lower().startswith("map_"):
        return words[: words.index("#")] if "#" in words else words
    return line.partition("#")[0].split()


def numbers_of(words: list[str], where: str, count: int = 3) -> tuple[float, ...]:
    """Return so many numbers of a line; raises `InputError` if there are others."""
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    expect(len(values) == count, where, f"{count} number(s)", " ".join(words))
    return values


def colour_of(words: list[str], where: str) -> tuple[float, ...]:
    """Return the three numbers of a colour; one alone is grey."""
    return numbers_of(words * 3 if len(words) == 1 else words, where)
