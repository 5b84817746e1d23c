"""The error that a picture is refined to."""

import dataclasses

from refgi.settings import Settings, setting

LEAST_TARGET = 1e-6  # about what rounding to float32 leaves of the full sum
MOST_CELLS = 65536  # along the longer side


@dataclasses.dataclass(frozen=True)
class ErrorTarget(Settings):
    """Subsplats refined until the picture is as near to the full sum as asked for."""

    PRINCIPAL = "target"

    target: float = setting(0.05, "RMSE to the full sum over its mean", least=LEAST_TARGET)
    coarsest: int = setting(16, "cells of the coarsest level along the longer side", least=1, most=MOST_CELLS)
