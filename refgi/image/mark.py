"""What refgi writes into each of its files, so that it is known again: one JSON object under one name.

An EXR has it as an attribute, a PNG as a tEXt chunk, a JSON file as a key; a page has a `generator` of that name.
"""

import json
from typing import Any

from refgi.errors import InputError

MARK = "refgi"


def canonical_json(value: Any) -> str:
    """Return JSON with sorted keys, no spaces and ASCII only; equal values give equal text.

    Parameters
    ----------
    value : object
        What JSON knows; NaN and infinity are refused.

    Returns
    -------
    str
        The text.

    Raises
    ------
    InputError
        If the value holds something JSON does not know.

    Examples
    --------
    >>> canonical_json({"b": 1, "a": (0.5, None)})
    '{"a":[0.5,null],"b":1}'
    """
    try:
        return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"attributes: expected finite JSON values, {error}") from error
