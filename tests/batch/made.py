"""A small plan, and results made by hand."""

from refgi.bench.results import Figures, PathResult, Result, Run, SceneResult

PLAN = """
[batch]
scenes = ["cornell_box"]
size = [24, 18]
rounds = 2
rsm_resolution = 32
truth = {samples = 48}
[truth]
passes = [2]
[sii]
lights = [16, 64]
[hssil]
"""


def run_of(method, changes=(), *, rmse=0.2, unoccluded=None, seconds=(1.0,), **more):
    def figures(value):
        return Figures(rmse=value, low=None, high=None, bias=0.1, spread=0.05, noise=0.01)

    errors = {"truth": figures(rmse)} | ({} if unoccluded is None else {"unoccluded": figures(unoccluded)})
    return Run(method=method, changes=changes, settings={}, times=seconds, stages={}, errors=errors, **more)


def scene_of(name, runs, line=()):
    return SceneResult(scene=name, width=4, height=3, covered=12, mean=1.0, truth="", runs=tuple(runs),
                       line=tuple(line), failures={})


MACHINE = {"platform": "a", "cpu": "b", "threads": 2, "versions": {"refgi": "0"}}


def result_of(*scenes, paths=()):
    return Result(environment=MACHINE, scenes=scenes, paths=paths)


def path_of(scene, method, changes=(), flicker=0.1, lag=0.5):
    return PathResult(scene=scene, method=method, changes=changes, frames=3, flicker=flicker, noise=0.0, lag=lag)
