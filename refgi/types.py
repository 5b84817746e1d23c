"""Types that many modules name."""

from typing import Any

import numpy.typing as npt

Array = npt.NDArray[Any]  # of any shape and kind; what it is stands beside it
