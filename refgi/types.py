"""Types that many modules name."""

from collections.abc import Callable
from typing import Any

import numpy.typing as npt

Array = npt.NDArray[Any]  # of any shape and kind; what it is stands beside it
Tell = Callable[[str, float], None]  # called with what runs and the fraction done
