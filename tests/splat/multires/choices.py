"""Settings of `multires` in the words of its tests."""

from functools import partial

from refgi.settings import of
from refgi.splat.multires.settings import MultiresSettings

FORMS = {"depth": "range", "derivative": "slope", "normal": "range", "curvature": "chord"}

unclamped = partial(of, MultiresSettings, clamp=None)  # near pairs as they are, to be summed pair by pair
by_irradiance = partial(unclamped, subsplats="irradiance")


def by_error(target, **values):
    return unclamped(**{"subsplats": "error", "subsplats.target": target} | values)


def only(*criteria):
    """Values that choose some of the criteria."""
    return {f"subsplats.criteria.{name}": form if name in criteria else None for name, form in FORMS.items()}
