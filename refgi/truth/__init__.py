"""Ground truth by ray tracing: one-bounce irradiance with a standard error for every pixel, and ray-traced VPLs.

`truth` averages independent passes of two unbiased estimators: picks among freshly traced light vertices from the
light's side, and hemisphere sampling with next-event estimation (NEE) from the receiver's, combined by multiple
importance sampling (MIS) at a bounded geometry term. `vpl` traces a shadow ray for each of the pixel lights of the
other methods, the limit of their visibility approximations.
"""

from refgi.truth.result import TruthResult
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import trace_truth, truth
from refgi.truth.vpl import VplSettings, vpl

__all__ = ["TruthResult", "TruthSettings", "VplSettings", "trace_truth", "truth", "vpl"]
