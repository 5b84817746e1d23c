"""The literal text as a port: what each stage's form writes from the arrays that it reads."""

import numpy as np

from refgi.vectors.rows import Form
from refgi.vectors.spec import as_read


def form_of(step):
    """Return the literal form of a stage; None where it has none."""
    return next((one for one in step.variants if isinstance(one, Form)), None)


def written(step, arrays):
    """Return what the literal form of a stage writes, in float64; None where it has none."""
    form = form_of(step)
    if form is None:
        return None
    made = form(as_read(arrays, step.reads, np.float64), np.float64)
    return {name: made[name] for name in step.writes}
