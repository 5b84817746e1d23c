"""The options of all verbs as one table, how their values are read, and what makes a verb of a function."""

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType, SimpleNamespace
from typing import Any, TypeVar

import click

from refgi.cli.session import Session

T = TypeVar("T")
Asked = SimpleNamespace  # values by parameter
Verb = Callable[[Session, Asked], int | None]

LARGEST_PICTURE = 65536  # pixels either way


class Read(click.ParamType[T]):
    """A value by a function from text, which raises ValueError with what it expected."""

    def __init__(self, name: str, read: Callable[[str], T]) -> None:
        self.name, self._read = name, read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> T:
        """Read one value; what has been read stays."""
        if not isinstance(value, str):
            read: T = value
            return read
        try:
            return self._read(value)
        except ValueError as error:
            self.fail(f"expected {error}, got {value!r}", param, ctx)


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)(?:[xX](\d+))?", text)
    if match is None:
        raise ValueError("WIDTHxHEIGHT such as 512x512")
    width, height = int(match[1]), int(match[2] or match[1])
    if not (1 <= width <= LARGEST_PICTURE and 1 <= height <= LARGEST_PICTURE):
        raise ValueError(f"1 to {LARGEST_PICTURE} pixels either way")
    return width, height


def _triple(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise ValueError("three numbers such as 0,1.5,-2") from None
    return x, y, z


def _exposure(text: str) -> float | str:
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        raise ValueError("a number or auto") from None


def _part(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ValueError("a part such as 2/8, from 1 on")
    return int(match[1]), int(match[2])


def _tolerance(text: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d*)?(?:e-?\d+)?)(%?)", text)
    if match is None:
        raise ValueError("a share such as 0.02 or 2%")
    return float(match[1]) / (100 if match[2] else 1)


def _quantity(units: Mapping[str, float], expected: str) -> Callable[[str], float]:
    """Return what reads a number above 0 with a unit."""
    def read(text: str) -> float:
        found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\D*?)\s*", text)
        try:
            number = float(found[1]) * units[found[2]] if found else 0.0
        except (ValueError, KeyError):
            number = 0.0
        if not 0 < number < float("inf"):
            raise ValueError(expected)
        return number

    return read


def _session(name: str) -> dict[str, Any]:
    """Return how a flag, wherever it stands, becomes the session's value of that name and no parameter of the verb."""
    def store(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        session = ctx.find_object(Session)
        if session is not None and value:
            setattr(session, name, True)
    return {"callback": store, "is_flag": True, "is_eager": True, "expose_value": False}


def _flag(text: str) -> dict[str, Any]:
    return {"is_flag": True, "help": text}


def _option(text: str, kind: Any = None, **more: Any) -> dict[str, Any]:
    return {"help": text, "type": kind, **more}


def _many(metavar: str, text: str, **more: Any) -> dict[str, Any]:
    return {"help": text, "metavar": metavar, "multiple": True, **more}


# by name what is said and read; `to`: the parameter, where it is another
OPTIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType({
    "json": {"help": "Put one JSON object on stdout.", **_session("as_json")},
    "debug": {"help": "Show the traceback of an error.", **_session("debug")},
    # where results go: the parameters of a `Permission`
    "out": _option("Folder for results."),
    "parents": _flag("Make every missing folder of --out, not the last alone."),
    "force": _flag("Overwrite files that are not from refgi."),
    # what is seen of a scene
    "size": _option("Picture size in pixels; the scene's own where absent.", Read("WxH", _size)),
    "eye": _option("Where the camera is, m.", Read("x,y,z", _triple)),
    "target": _option("What it looks at, m.", Read("x,y,z", _triple)),
    "up": _option("Which way is up.", Read("x,y,z", _triple)),
    "vfov-deg": _option("Full vertical field of view.", float),
    "light": _many("KIND:KEY=VALUE:...", "A light instead of the scene's own; repeatable. "
                   "spot:position=0,2,0:target=0,0,0:outer_deg=35:intensity=20, point:position=0,2,0:intensity=20 "
                   "(W/sr) or directional:direction=0,-1,0:irradiance=3 (W/m^2).", to="lights"),
    "strict": _flag("Refuse a mesh that lacks material files, images or normals that it names."),
    "light-unit": _option("What glTF's lights are in; exporters write cd (the format's), lm or W/sr.",
                          ["cd", "lm", "W/sr"], default="cd"),
    "emissive": _option("Emissive surfaces are seen and light nothing, or each part gets a lamp, an approximation.",
                        ["seen", "lamps"], default="seen"),
    # which method, and how it is set
    "method": _option("Short name of a method; `refgi info` lists them.", default="sii"),
    "methods": _option("Methods to look at; all where absent.", metavar="A,B"),
    "preset": _option("Named settings to start from: default, or paper for the values printed.", default="default",
                      metavar="NAME"),
    "set": _many("KEY=VALUE", "A setting of the method; repeatable.", to="pairs"),
    "frames": _option("Frames of other random numbers that a method with a temporal filter blends.",
                      click.IntRange(1, 100_000)),
    "temporal": _many("KEY=VALUE", "A setting of the temporal filter of --frames, such as weight=0.8; repeatable.",
                      to="filtering"),
    # how it is computed
    "dtype": _option("Element type of every buffer and kernel.", ["float32", "float64"], default="float32"),
    "rsm-resolution": _option("Texels along one side of a reflective shadow map.", click.IntRange(1, 16384),
                              default=512),
    "threads": _option("Threads of compiled kernels; all where absent.", click.IntRange(1)),
    "seed": _option("Which random numbers, where a method has any.", click.IntRange(0, 2**32 - 1)),
    "shadows": _option("Direct light's shadows: from the shadow map as published, or by rays; auto: by rays where the "
                       "method traces some anyway.", ["auto", "map", "exact"], default="auto",
                       callback=lambda _, __, value: None if value == "auto" else value),
    "rounds": _option("How often each setting runs, with a seed each.", click.IntRange(1, 1000), default=3),
    # of pictures
    "exposure": _option("Factor before the sRGB curve of a PNG, the scene's where absent; auto makes the 98th "
                        "percentile white.", Read("FACTOR|auto", _exposure)),
    "allow-empty": _flag("Write a black picture where the camera sees no surface."),
    "engine": _option("literal: stages run by the plain NumPy of refgi/literal where they have it, after their "
                      "kernels; sii of cornell_box at 64x48 takes 6 times as long, hssil 3, multires, val and gather "
                      "1.1 to 1.2.", ["kernels", "literal"], default="kernels"),
    "again": _option("Make this picture again, and say whether it is the same to the bit.", metavar="FILE.exr"),
    "scene": _option("Where the scene of --again is now, if it was moved.", metavar="PATH", to="scene_path"),
    "no-temporal": {**_flag("Each frame by itself."), "to": "unfiltered"},
    "resume": _flag("Go on after the frames that are there as EXR."),
    "against": _option("The scene that the picture shows.", required=True, metavar="SCENE"),
    "layer": _option("What its channels' names begin with, such as ViewLayer.Combined.", metavar="NAME"),
    "part": _option("Name or number of its part in a file of several.", metavar="NAME"),
    # of measurements
    "measure": _flag("Time what is skipped at the picture's own size, and prove its bits."),
    "clock": _option("Of --measure: the time of day, or that of processors, all threads together.",
                     ["wall", "processor"], default="wall"),
    "grid": _option("Settings of each method as TOML.", metavar="FILE", to="grid_file"),
    "quick": _flag("Three or four settings a method in place of ten and more, pictures of 256 pixels at most."),
    "budget": _option("Time that all may take, such as 2m: what does not fit is left out, and said.",
                      Read("duration", _quantity({"s": 1.0, "": 1.0, "m": 60.0, "h": 3600.0},
                                                 "a time such as 90s or 2m"))),
    "split": _flag("Split each method's error into its approximations, at the default and at the knee of its curve."),
    "split-size": _option("Picture size of the split; 128 pixels along the longer side at most where absent.",
                          Read("WxH", _size)),
    "split-frames": _option("Frames of the resting scene that the split blends, of methods with a temporal filter.",
                            click.IntRange(2, 1000)),
    "error": _option("Largest RMSE over the truth's mean, such as 3%.", Read("share", _quantity(
        {"%": 0.01, "": 1.0}, "a share such as 3% or 0.03"))),
    "time": _option("Longest time of a frame with its buffers, such as 50ms.", Read("duration", _quantity(
        {"us": 1e-6, "ms": 1e-3, "s": 1.0, "": 1.0}, "a time such as 50ms or 0.05s")), to="seconds"),
    "emit": _option("Write the choice as a plan for `refgi batch` (TOML).", metavar="FILE"),
    "change": _many("NAME", "A change to try alone; repeatable.", to="changes"),
    # of batches
    "store": _option("Folder of truths that batches share; in --out where absent.", metavar="DIR"),
    "workers": _option("Processes of a machine, each with its part of the cores.", click.IntRange(1, 1024), default=1),
    "executor": _option("Scheduler of dask.distributed; its workers see all folders.", metavar="dask:ADDRESS"),
    "shard": _option("Do this part of the jobs alone, such as 2/8.", Read("I/N", _part)),
    "since": _option("Do jobs of methods alone whose code differs from a commit's.", metavar="COMMIT"),
    "retry-failed": _flag("Do jobs again that gave no picture."),
    "dry-run": _flag("Say what would be done and what it will take."),
    "baseline": _option("results.json of an earlier batch: fail where a figure is worse.", metavar="FILE"),
    "tolerance": _option("By which share of itself a figure may be worse than in the baseline.",
                         Read("SHARE", _tolerance), default="0.01"),
    "format": _option("How failures are said: as text, or as annotations of GitHub Actions.",
                      ["text", "github"], default="text", to="form"),
    # of kits
    "kit": _option("Ready cases, where no SCENE is named.  [quick]", ["quick", "full"]),
    "case": _option("Of a kit: only cases whose id begins so."),
    "stage": _option("Of SCENE: only stages whose name begins so.", default="", metavar="NAME"),
    "frame": _option("Of --frames: the number of the frame, from 0 on; the last where absent.", click.IntRange(0)),
    "most": _option("Of SCENE: refuse what would take more.", click.FloatRange(min=0, min_open=True), default=50.0,
                    metavar="MB"),
    # of other verbs
    "watch": _flag("Make the pages again whenever results change, until interrupted."),
    "all": {**_flag("Also keys of other choices, and those for studies."), "to": "everything"},
    "processes": _option("How many compile at a time; one a core where absent.", click.IntRange(1)),
})
WRITING = ("parents", "force")
SEEN = ("size", "eye", "target", "up", "vfov-deg", "light", "strict", "light-unit", "emissive")
MACHINE = ("dtype", "rsm-resolution", "threads", "seed")
EXACT = {"type": ["map", "exact"], "default": "exact",  # of --shadows: rays are traced in any case
         "help": "Direct light's shadows: from the shadow map as published, or by rays."}


def verb(name: str, *names: str, **others: Any) -> Callable[[Verb], click.Command]:
    """Return what makes a verb of a function that takes the session and what is asked.

    `names` of `OPTIONS`, in the order of its help; those in capitals are arguments. `others` say by name (- is _) what
    is not as in the table: the help, or parameters of click.
    """
    def make(function: Verb) -> click.Command:
        def run(**values: Any) -> int | None:
            return function(click.get_current_context().ensure_object(Session), Asked(**values))

        run.__doc__ = function.__doc__
        command: Any = run
        for one in reversed((*names, "json", "debug")):
            other = others.get(one.replace("-", "_"), {})
            more = {"help": other} if isinstance(other, str) else other
            command = click.argument(one.lower(), **more)(command) if one.isupper() else _added(one, more)(command)
        made: click.Command = click.command(name)(command)
        return made

    return make


def _added(name: str, other: Mapping[str, Any]) -> Callable[[Any], Any]:
    entry = {**OPTIONS[name], **other}
    to, kind = entry.pop("to", None), entry.pop("type", None)
    entry["type"] = click.Choice(kind) if isinstance(kind, list) else kind
    return click.option(f"--{name}", *([to] if to else []), **entry, show_default=entry.get("default", "") != "")
