"""Spoiled files of more kinds than `benchmarks.stability` has: each is read or refused in lines that name it."""

import pytest

from benchmarks.stability.file_child import kinds, read_in_children

FORMATS = ("GLB", "OBJS", "LIBRARY", "POLYGONS", "IMAGE", "PICTURE", "KIT", "MANIFEST", "BUGS", "OUTPUT")
FILES, SEED = 1000, 37  # of each format


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_spoiled_files_are_read_or_refused(name: str) -> None:
    found = read_in_children(f"tests.fuzzed:{name}", SEED, range(FILES))
    assert not found, f"{kinds(found)}; {found[0]}"
