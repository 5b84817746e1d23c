"""Change the bytes of a file at random: flips, cuts, repeats, odd tokens, odd numbers, odd values in JSON."""

import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.scene.samples import glb_bytes

TOKENS = [b"0", b"-1", b"1e999", b"NaN", b"4294967295", b"99999999999", b"null", b"[", b"}", b'"', b"\0", b"\xff", b"",
          b"-inf", b"1e-400", b"9" * 400, b"1" * 5000, b"\n", b"\r", b"#", b"\\\n", b"''' ", b"{}", b"true", b"0x1p5",
          "\u2028".encode(), b"\xed\xa0\x80", b"x" * 3000, b"1_0"]
ODD: list[Any] = [0, -1, 1, 1e300, -1e300, 1e-300, float("inf"), float("nan"), 2**31, 2**63, 10**30, True, None, "",
                  "x", [], {}, [[]], [0, 0, 0], [1e308] * 3, [1e-320] * 3, [float("nan")] * 3, "../x", "\0", [1] * 16,
                  "x" * 5000, {"x\ny": 1}, {"k" * 3000: 0}, "a\nb", "\ud800", [[[[[[]]]]]], 10**400, -0.0, "1", [1e200]]
WORDS = np.array([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7F800000, 0x7FC00000, 0xFF800000, 0x00000001, 0x7F7FFFFF,
                  0x40000000, 0x10000], "<u4")
WORD = re.compile(rb"[\w.+-]+")


def spoiled(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with one to four flips, cuts, repeats or insertions."""
    for _ in range(int(random.integers(1, 5))):
        if not content:
            break
        place, length = int(random.integers(len(content))), int(random.integers(1, 24))
        choice = int(random.integers(5))
        if choice == 0:
            content = content[:place] + bytes([content[place] ^ (1 << int(random.integers(8)))]) + content[place + 1 :]
        elif choice == 1:
            content = content[:place] + content[place + length :]
        elif choice == 2:
            content = content[: place + length] + content[place:]
        elif choice == 3:
            content = content[:place] + TOKENS[int(random.integers(len(TOKENS)))] + content[place + length % 4 :]
        else:
            content = content[:place] + random.bytes(min(length, 4)) + content[place + min(length, 4) :]
    return content


def with_odd_token(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with a word, such as a number or a key, replaced by an odd one or by another of the file."""
    words = [match.span() for match in WORD.finditer(content)]
    if not words:
        return spoiled(content, random)
    start, end = words[int(random.integers(len(words)))]
    if random.random() < 0.3:
        low, high = words[int(random.integers(len(words)))]
        new = content[low:high]
    else:
        new = TOKENS[int(random.integers(len(TOKENS)))]
    return content[:start] + new + content[end:]


def with_odd_line(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with a line left out, said twice, or moved."""
    lines = content.split(b"\n")
    place, to, choice = int(random.integers(len(lines))), int(random.integers(len(lines))), int(random.integers(3))
    line = lines[place] if choice == 1 else lines.pop(place)
    if choice:
        lines.insert(to, line)
    return b"\n".join(lines)


def with_odd_word(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with four of them in a row replaced by an odd integer or float."""
    place = int(random.integers(max(1, len(content) - 3)))
    return content[:place] + WORDS[int(random.integers(len(WORDS)))].tobytes() + content[place + 4 :]


def places(tree: Any, above: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Give the way to every value of a tree."""
    yield above
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        yield from places(value, (*above, key))


def with_value(tree: Any, place: tuple[str | int, ...], value: Any) -> Any:
    """Return the tree with one value replaced."""
    if not place:
        return value
    changed = json.loads(json.dumps(tree))
    owner = changed
    for key in place[:-1]:
        owner = owner[key]
    owner[place[-1]] = value
    return changed


def with_odd_values(tree: Any, random: np.random.Generator) -> Any:
    """Return a tree with one to three values replaced by odd ones or by others of the tree."""
    for _ in range(int(random.integers(1, 4))):
        ways = list(places(tree))
        place, other = ways[int(random.integers(len(ways)))], ways[int(random.integers(len(ways)))]
        value = ODD[int(random.integers(len(ODD)))]
        if random.random() < 0.2:
            value = tree
            for key in other:
                value = value[key]
        tree = with_value(tree, place, value)
    return tree


BYTEWISE = (spoiled, with_odd_token, with_odd_line, with_odd_word)


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes of a file changed in one of all ways; JSON and that of a GLB in half of the cases as a tree."""
    is_glb = content[:4] == b"glTF"
    if (is_glb or content[:1] == b"{") and random.random() < 0.5:
        tree, buffer = _parts_of_glb(content) if is_glb else (json.loads(content), b"")
        tree = with_odd_values(tree, random)
        return glb_bytes(tree, buffer) if is_glb else json.dumps(tree).encode()
    return BYTEWISE[int(random.integers(len(BYTEWISE)))](content, random)


def _parts_of_glb(content: bytes) -> tuple[Any, bytes]:
    length = int.from_bytes(content[12:16], "little")
    return json.loads(content[20 : 20 + length]), content[28 + length :]
