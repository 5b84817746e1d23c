"""`refgi bench`: run time against error of methods over a grid of settings."""

import warnings
from pathlib import Path
from typing import Any

import click

from refgi.cli.options import Size, on_threads, speech, writing
from refgi.cli.session import DONE, FAILED, Session, progress, say

FILES = ("index.html", "results.json", "results.csv", "results.md")


@click.command("bench")
@click.argument("scenes", nargs=-1)
@click.option("--methods", metavar="A,B", help="Methods of the grid to run; all where absent.")
@click.option("--grid", "grid_file", metavar="FILE", help="Settings of each method as TOML.")
@click.option("--quick", is_flag=True, help="Three settings a method in place of ten and more.")
@click.option("--rounds", type=click.IntRange(1, 1000), default=3, show_default=True,
              help="How often each setting runs, with a seed each.")
@click.option("--size", type=Size(), help="Picture size in pixels; the scenes' own where absent.")
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE",
              help="A setting of the truth, such as samples=1024 or checkpoint=DIR; repeatable.")
@click.option("--split", is_flag=True, help="Split each method's error into its approximations, at the default and at "
                                            "the knee of its curve.")
@click.option("--split-size", type=Size(), help="Picture size of the split; 128 pixels along the longer side at most "
                                                "where absent.")
@click.option("--split-frames", type=click.IntRange(2, 1000), help="Frames of the resting scene that the split blends, "
                                                                   "of methods with a temporal filter.")
@click.option("--threads", type=click.IntRange(1), help="Threads of compiled kernels; all where absent.")
@click.option("--out", required=True, help="Folder for index.html, results.json, results.csv, results.md and pictures.")
@writing
@speech
@click.pass_obj
def _bench(
    session: Session, /, scenes: tuple[str, ...], methods: str | None, grid_file: str | None, quick: bool, rounds: int,
    size: tuple[int, int] | None, pairs: tuple[str, ...], split: bool, split_size: tuple[int, int] | None,
    split_frames: int | None, threads: int | None, out: str, parents: bool, force: bool,
) -> int:
    """Measure error over time on SCENES (cornell_box where absent).

    Methods run over a grid of settings beside the path tracer stopped early; errors are told apart into bias and
    spread over seeds. Results are written after each scene.
    """
    from refgi.bench.grid import TRUTH, built_in, chosen, read_grid
    from refgi.bench.measure import bench_scene
    from refgi.bench.pictures import FOLDER, places
    from refgi.bench.report import said_of, write_page
    from refgi.bench.results import Result, markdown, write_results
    from refgi.bench.split import with_splits
    from refgi.cli.destination import Permission, folder
    from refgi.cli.settings import settings_for, still_frames
    from refgi.cli.view import View
    from refgi.compare.report import environment
    from refgi.errors import RefgiWarning, expect

    expect(not (quick and grid_file), "--grid", "--quick or --grid, not both", "both")
    for option, given in (("--split-size", split_size), ("--split-frames", split_frames)):
        expect(split or given is None, option, "--split beside it", "none")
    names = None if methods is None else [name.strip() for name in methods.split(",")]
    grid = chosen(read_grid(Path(grid_file)) if grid_file else built_in(quick), names)
    still = still_frames({one.method for one in grid.choices}, split_frames, ())
    truth = settings_for(TRUTH, pairs)
    sources = scenes or ("cornell_box",)
    loaded = [View(source, size, None, None, None, None, ()).load() for source in sources]
    kept = (str(file.relative_to(out)) for file in Path(out, FOLDER).rglob("*.exr"))
    path = folder(out, Permission(parents, force), (*FILES, *kept))
    path.mkdir(parents=True, exist_ok=True)
    made: list[Any] = []
    with on_threads(threads), progress() as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # of each of many settings in each round
        for number, (scene, place) in enumerate(zip(loaded, places(path, [one.name for one in loaded]), strict=True)):
            def told(what: str, done: float, number: int = number, name: str = scene.name) -> None:
                tell(f"{name} ({number + 1} of {len(loaded)}): {what}", done)

            one = bench_scene(scene, grid, rounds=rounds, truth=truth, tell=told, place=place,
                              source=sources[number], shadows="exact")
            if split:
                options: dict[str, Any] = dict(zip(("width", "height"), split_size or (), strict=False))
                one = with_splits(one, scene, grid, seeds=rounds, truth=truth, tell=told, still=still,
                                  shadows="exact", **options)
            made.append(one)
            result = Result(environment=environment(), scenes=tuple(made))
            write_results(result, path)
            write_page(result, path)
    lines = [f"{one.scene}: {said}" for one in made for said in said_of(one)]
    failures = [f"{one.scene}: {name} gave no picture: {why}" for one in made for name, why in one.failures.items()]
    for said in (*failures, *(f"{one.scene}: {doubt}" for one in made for doubt in one.doubts)):
        say(said)
    session.result("\n".join([markdown(result), *lines, "", f"open {out.rstrip('/')}/index.html"]),
                   result.model_dump(mode="json"))
    return FAILED if failures else DONE


command = _bench
