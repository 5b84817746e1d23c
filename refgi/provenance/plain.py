"""Values of Python as values of JSON."""

import dataclasses
import math
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Turn settings and figures into finite JSON values.

    Parameters
    ----------
    value : object
        Dataclasses, mappings, sequences, sets, numbers, text, types.

    Returns
    -------
    object
        The same as dict, list, str, int, float, bool and None.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(map(plain, value))
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)
