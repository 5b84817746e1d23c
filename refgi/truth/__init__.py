"""Ground truth by ray tracing: one-bounce irradiance with a standard error for every pixel, and ray-traced VPLs.

`truth` averages independent passes of two unbiased estimators: picks among freshly traced lit points from the light's
side, and hemisphere sampling at the receiver, split at a bounded geometry term. `vpl` keeps the pixel lights of the
other methods and asks a shadow ray for each, which is what their visibility approximations aim at.
"""

from refgi.truth.result import TruthResult
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import trace_truth, truth
from refgi.truth.vpl import VplSettings, vpl

__all__ = ["TruthResult", "TruthSettings", "VplSettings", "trace_truth", "truth", "vpl"]
