"""Folders of results made by hand: two scenes of known pictures, no rendering."""

import numpy as np

from refgi.bench.folder import write_results
from refgi.bench.results import Figures, Result, Run, SceneResult
from refgi.compare.pictures import linear_planes
from refgi.image import write_exr

HEIGHT, WIDTH = 18, 24
ENVIRONMENT = {"versions": {"refgi": "1"}, "platform": "p", "cpu": "c", "threads": 2}


def light(seed):
    """Irradiance of a picture, the same for equal seeds; 0 in the first two columns, which show no surface."""
    made = np.random.default_rng(seed).uniform(0.5, 2, (3, HEIGHT, WIDTH)).astype(np.float32)
    made[:, :, :2] = 0
    return made


def radiance(irradiance):
    return (0.1 * (irradiance > 0) + irradiance / 4).astype(np.float32)


def make_run(method, lights, seconds, rmse, picture, unoccluded=False, **more):
    figures = Figures(rmse=rmse, low=0.8 * rmse, high=1.3 * rmse, bias=0.5 * rmse, spread=0.8 * rmse, noise=0.01)
    errors = {"truth": figures}
    if unoccluded:
        errors["unoccluded"] = figures.model_copy(update={"rmse": 0.5 * rmse})
    return Run(method=method, changes=(f"lights={lights}",), settings={"lights": lights, "pattern": "<grid>"},
               times=(3 * seconds, seconds, 0.5 * seconds), stages={"rsm": 0.25 * seconds}, errors=errors,
               picture=picture, **more)


def make_scene(name, folder, slower=1.0):
    runs = (make_run("sii", 16, 0.01 * slower, 0.5, f"{folder}/sii-01.exr", True, front=True),
            make_run("sii", 64, 0.04 * slower, 0.3, f"{folder}/sii-02.exr", True, front=True, in_equal_time=0.8),
            make_run("vpl", 64, 0.2 * slower, 0.35, f"{folder}/vpl-01.exr", in_equal_time=1.75),
            make_run("vpl", 128, 0.3 * slower, 0.4, None, in_equal_time=2.5))
    line = (make_run("truth", 1, 0.05, 0.4, f"{folder}/truth-01.exr"),
            make_run("truth", 2, 0.2, 0.2, f"{folder}/truth-02.exr"))
    return SceneResult(scene=name, width=WIDTH, height=HEIGHT, covered=HEIGHT * (WIDTH - 2), mean=1.2, runs=runs,
                       line=line, truth="+-1 %", failures={"val: broken": "no & way"})


def make_folder(folder, scenes=("box <1>", "hall")):
    """Write results.json and the pictures of its scenes: seed 0 the truth, 1 that without visibility, 2 ... runs."""
    result = Result(environment=ENVIRONMENT, scenes=tuple(
        make_scene(name, f"pictures/{number}", 1 + number) for number, name in enumerate(scenes)))
    folder.mkdir(parents=True, exist_ok=True)
    write_results(result, folder)
    for number in range(len(scenes)):
        place = folder / "pictures" / str(number)
        place.mkdir(parents=True)
        for seed, stem in enumerate(("truth", "truth_unoccluded")):
            spread = np.full((3, HEIGHT, WIDTH), 0.0025, np.float32)
            samples = (light(0)[0] > 0) * 64.0
            write_exr(place / f"{stem}.exr", linear_planes(radiance(light(seed)), light(seed), spread, samples),
                      {"exposure": 0.5})
        for seed, stem in enumerate(("sii-01", "sii-02", "vpl-01", "truth-01", "truth-02"), 2):
            write_exr(place / f"{stem}.exr", linear_planes(radiance(light(seed)), light(seed)))
        ids = np.arange(HEIGHT * WIDTH, dtype=np.uint32).reshape(HEIGHT, WIDTH)
        write_exr(place / "ids.exr", {"face": ids + 100_000, "material": ids % 7})
    return result
