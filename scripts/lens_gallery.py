"""One scene through each shipped lens, for the page of lenses: docs/howto/lenses-gallery.jpg.

Each lens is scaled so that its design field covers the same small array.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vcam_cli.camera.camera import Camera

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "docs" / "howto" / "lenses-gallery.jpg"
ROWS, COLUMNS, PITCH = 240, 320, 4e-6
LENSES = ("cooke-triplet", "double-gauss", "r-biotar", "sonnar", "topogon")
SPARE = 0.97
"""Part of a lens's design field that the array's corner sees."""
SCENE = ROOT / "configs" / "scenes" / "street.png"
SETS = (
    f"array={{rows: {ROWS}, columns: {COLUMNS}, pattern: bayer-rggb}}",
    f"pixel.width={PITCH * 1e6:g} um",
    f"scene.source={{kind: image, file: {SCENE}}}",
    "scene.distance=10 m",
    "exposure={auto: {max: 100 ms}}",
)


def scale(name: str) -> float:
    """Return the factor by which a lens's design field covers the array."""
    from vcam_cli.lenses.fields import View
    from vcam_cli.lenses.files import shipped_lens

    lens = shipped_lens(name)
    corner = math.hypot(ROWS, COLUMNS) / 2 * PITCH
    return corner / (View(lens).image_scale * math.tan(SPARE * lens.field))


def camera(name: str) -> Camera:
    """Return the camera with a lens; `fisheye` has its projection alone."""
    from vcam_cli import load

    if name == "fisheye":
        return load("fisheye", SETS)
    factor = f"{scale(name):.4g}"
    sets = (*SETS, f"optics.prescription={{use: {name}, scale: {factor}}}")
    return load("phone-double-gauss", sets)


def title(name: str) -> str:
    """Return the name, year and numbers of a lens."""
    from vcam_cli.camera.derived.geometry import geometry
    from vcam_cli.lenses.files import shipped_lens

    solved = geometry(camera(name))
    numbers = f"{solved.focal_length * 1e3:.3g} mm, f/{solved.f_number:.3g}"
    if name == "fisheye":
        return f"equidistant fisheye: {numbers}"
    lens = shipped_lens(name)
    return f"{lens.title}: {numbers}, {math.degrees(SPARE * lens.field):.3g} deg"


def pictures() -> dict[str, Any]:
    """Return the render of each lens by its title."""
    from vcam_cli import simulate

    return {title(name): simulate(camera(name)).render for name in (*LENSES, "fisheye")}


def main() -> None:
    """Write the picture."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.use("Agg")
    figure = Figure(figsize=(12, 6.6), dpi=100, layout="constrained")
    found = pictures()
    for axes, (name, render) in zip(figure.subplots(2, 3).flat, found.items(), strict=True):
        axes.imshow(render, interpolation="nearest")
        axes.set_title(name, fontsize=9)
        axes.set_axis_off()
    figure.savefig(TARGET, pil_kwargs={"quality": 88})


if __name__ == "__main__":
    main()
