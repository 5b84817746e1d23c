"""Numbers that the literal text tells of the methods' defaults are those of the settings."""

import re

import pytest

from refgi import literal
from refgi.methods import find_method
from refgi.settings import flat
from refgi.sssil.settings import TemporalSettings


def told():
    for method, line in re.findall(r"^- (\w+): (.*?)(?=\n- |\n\n)", literal.__doc__, re.M | re.S):
        for key, value in re.findall(r"([\w.]+)=([\w.]+\w)", line):
            yield method, key, value


@pytest.mark.parametrize(("method", "key", "value"), list(told()))
def test_a_default(method, key, value):
    assert str(flat(find_method(method).settings())[key]).lower() == value


def test_each_method_has_some():
    assert f"a share of {TemporalSettings().weight} of the light before" in literal.__doc__
    assert {method for method, *_ in told()} == {"sii", "multires", "val", "hssil"}
