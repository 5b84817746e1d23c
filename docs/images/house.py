"""Draw docs/images/house.svg: the layers of imports in pyproject.toml, with the files and lines of each package."""

import tomllib
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
from matplotlib import pyplot as plt
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[2]
WIDTH, HEIGHT, GAP = 10.0, 0.62, 0.22


def layers() -> list[list[str]]:
    """Return the packages of each layer, from the command line down."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = next(one for one in content["tool"]["importlinter"]["contracts"] if one["type"] == "layers")
    return [[name.strip().removeprefix("refgi.") for name in layer.split("|")] for layer in contract["layers"]]


def size(package: str) -> tuple[int, int]:
    """Return files and lines of a package or module."""
    place = ROOT / "refgi" / package
    files = list(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
    return len(files), sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def draw() -> None:
    """Write the picture."""
    rows = layers()
    height = len(rows) * (HEIGHT + GAP)
    figure, axes = plt.subplots(figsize=(8.4, height * 0.72))
    mpl.rcParams.update({"svg.hashsalt": "refgi", "font.family": "sans-serif"})
    for number, row in enumerate(rows):
        low, wide = height - (number + 1) * (HEIGHT + GAP), (WIDTH - GAP * (len(row) - 1)) / len(row)
        for place, package in enumerate(row):
            left = place * (wide + GAP)
            axes.add_patch(FancyBboxPatch((left, low), wide, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
                                          facecolor=plt.cm.YlGnBu(0.12 + 0.5 * number / len(rows)), edgecolor="0.3"))
            files, lines = size(package)
            axes.text(left + wide / 2, low + HEIGHT / 2, f"{package}\n{files} files, {lines:,} lines" if files > 1 else
                      f"{package}\n{lines} lines", ha="center", va="center", fontsize=7)
        if number:
            axes.annotate("", (WIDTH / 2, low + HEIGHT), (WIDTH / 2, low + HEIGHT + GAP),
                          arrowprops={"arrowstyle": "->", "color": "0.3"})
    axes.set(xlim=(-0.1, WIDTH + 0.1), ylim=(-0.1, height))
    axes.axis("off")
    figure.savefig(Path(__file__).with_name("house.svg"), bbox_inches="tight", metadata={"Date": None})


if __name__ == "__main__":
    draw()
