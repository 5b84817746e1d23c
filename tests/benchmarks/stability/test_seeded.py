"""Faults of precision can still be put into the sources as they are."""

from pathlib import Path

import pytest

from benchmarks.stability.seeded import PrecisionFault, faults

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.name)
def test_its_line_stands_once_in_its_file(fault: PrecisionFault) -> None:
    text = (ROOT / fault.file).read_text("utf-8")
    assert text.count(fault.old) == 1
    assert fault.put_into(text) != text
