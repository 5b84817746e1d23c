"""Options that several verbs share, and how their values are read.

--threads: how many threads compiled kernels run on.
"""

import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import click

from refgi.cli.session import Session
from refgi.errors import expect

F = TypeVar("F", bound=Callable[..., Any])


class Size(click.ParamType[tuple[int, int]]):
    """WIDTHxHEIGHT in pixels, or one number for a square."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Read one size."""
        match = re.fullmatch(r"(\d+)(?:[xX](\d+))?", str(value))
        if match is None:
            self.fail(f"expected WIDTHxHEIGHT such as 512x512, got {value!r}", param, ctx)
        width, height = int(match[1]), int(match[2] or match[1])
        if not (1 <= width <= 65536 and 1 <= height <= 65536):
            self.fail(f"expected 1 to 65536 pixels either way, got {value!r}", param, ctx)
        return width, height


class Triple(click.ParamType[tuple[float, float, float]]):
    """Three numbers with commas between."""

    name = "x,y,z"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # type: ignore[override]
        """Read one vector."""
        if isinstance(value, tuple):
            return value
        try:
            x, y, z = map(float, str(value).split(","))
        except ValueError:
            self.fail(f"expected three numbers such as 0,1.5,-2, got {value!r}", param, ctx)
        return x, y, z


class Exposure(click.ParamType[float | str]):
    """A factor, or "auto"."""

    name = "FACTOR|auto"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        """Read one factor."""
        if value == "auto":
            return "auto"
        try:
            return float(value)
        except ValueError:
            self.fail(f"expected a number or auto, got {value!r}", param, ctx)


def _adding(*decorators: Callable[[Any], Any]) -> Callable[[F], F]:
    """Return what gives a verb some options and arguments, in the order of its help."""
    def add(function: F) -> F:
        for decorate in reversed(decorators):
            function = decorate(function)
        return function
    return add


def _keep(name: str) -> dict[str, Any]:
    """Return how a flag, wherever it stands, becomes the session's value of that name and no parameter of the verb."""
    def store(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        session = ctx.find_object(Session)
        if session is not None and value:
            setattr(session, name, True)
    return {"callback": store, "is_flag": True, "is_eager": True, "expose_value": False}


speech = _adding(
    click.option("--json", help="Put one JSON object on stdout.", **_keep("as_json")),
    click.option("--debug", help="Show the traceback of an error.", **_keep("debug")),
)

# what may be done to put results where --out says: the parameters of a `Permission`
writing = _adding(
    click.option("--parents", is_flag=True, help="Make every missing folder of --out, not the last alone."),
    click.option("--force", is_flag=True, help="Overwrite files that are not from refgi."),
)

# what is seen of a scene: size, camera, lights
seen = _adding(
    click.option("--size", type=Size(), help="Picture size in pixels; the scene's own where absent."),
    click.option("--eye", type=Triple(), help="Where the camera is, m."),
    click.option("--target", type=Triple(), help="What it looks at, m."),
    click.option("--up", type=Triple(), help="Which way is up."),
    click.option("--vfov-deg", type=float, help="Full vertical field of view."),
    click.option("--light", "lights", multiple=True, metavar="KIND:KEY=VALUE:...",
                 help="A light instead of the scene's own; repeatable. spot:position=0,2,0:target=0,0,0:"
                      "outer_deg=35:intensity=20, point:position=0,2,0:intensity=20 (W/sr) or "
                      "directional:direction=0,-1,0:irradiance=3 (W/m^2)."),
    click.option("--strict", is_flag=True,
                 help="Refuse a mesh that lacks material files, images or normals that it names."),
    click.option("--light-unit", type=click.Choice(["cd", "lm", "W/sr"]), default="cd", show_default=True,
                 help="What glTF's lights are in; exporters write cd (the format's), lm or W/sr."),
    click.option("--emissive", type=click.Choice(["seen", "lamps"]), default="seen", show_default=True,
                 help="Emissive surfaces are seen and light nothing, or each part gets a lamp, an approximation."),
)

# the scene and what is seen of it
view = _adding(click.argument("scene"), seen)

# how it is computed
machine = _adding(
    click.option("--dtype", type=click.Choice(["float32", "float64"]), default="float32", show_default=True,
                 help="Element type of every buffer and kernel."),
    click.option("--rsm-resolution", type=click.IntRange(1, 16384), default=512, show_default=True,
                 help="Texels along one side of a reflective shadow map."),
    click.option("--threads", type=click.IntRange(1), help="Threads of compiled kernels; all where absent."),
    click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="Which random numbers, where a method has any."),
)

# the frames that a still picture is blended of
still = _adding(
    click.option("--frames", type=click.IntRange(1, 100_000),
                 help="Frames of other random numbers that a method with a temporal filter blends."),
    click.option("--temporal", "filtering", multiple=True, metavar="KEY=VALUE",
                 help="A setting of the temporal filter of --frames, such as weight=0.8; repeatable."),
)


def shadows(default: str) -> Callable[[F], F]:
    """Return what adds where the direct light's shadows come from.

    `default`: "exact" where rays are traced in any case; "auto", which gives the verb None, where the method decides.
    """
    names = ["auto", "map", "exact"] if default == "auto" else ["map", "exact"]
    auto = "; auto: by rays where the method traces some anyway" if default == "auto" else ""
    return click.option("--shadows", type=click.Choice(names), default=default, show_default=True,
                        callback=lambda _, __, value: None if value == "auto" else value,
                        help=f"Direct light's shadows: from the shadow map as published, or by rays{auto}.")


def on_threads(count: int | None) -> AbstractContextManager[None]:
    """Run kernels on `count` threads, all where None, inside the block; InputError if there are not so many."""
    import numba

    from refgi.jit import threads

    config: Any = numba.config
    most = config.NUMBA_NUM_THREADS
    expect(count is None or 1 <= count <= most, "--threads", f"1 to {most} (NUMBA_NUM_THREADS)", count)
    return threads(count)
