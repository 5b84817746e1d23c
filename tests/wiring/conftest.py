"""Every setting's picture is made as `refgi.render` makes it: with what a method says of its own errors."""

import pytest

from refgi.diagnostics import diagnosing


@pytest.fixture(autouse=True)
def diagnosed():
    with diagnosing():
        yield
