"""The picture of scenes.csv: which effects are simulated before which scenes, and at what cost.

A cell is colored where the effect is simulated, by its contribution over the limit. It is white
where the effect is skipped, with the milliseconds that this saves. At the right are the seconds of
a frame with the plan, over those with all effects.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.files.plots import plot_figure
from vcam_cli.simulation.plan import Decision
from vcam_cli.simulation.scene_plans import (
    NEVER_SKIPPED,
    ScenePlan,
    effect_names,
    mark,
    time_text,
)

DECADES = 3.0
"""Powers of ten of contribution over limit that the colors show."""
PALE, DARK = 0.22, 0.82
"""Ends of the color map: paler is hard to tell from white, darker hides the text."""
ALWAYS = "#d9d9d9"
"""Color of effects that no plan skips."""
CELL = 0.315, 0.235
"""Width and height of a cell [in]."""
BARS = 1.85
"""Width of the seconds [in]."""
CHARACTERS, LINE = 14.5, 0.15
"""Characters in an inch, height of a line of text [in]."""
WORDS = (
    "Color: simulated, share of the effect over the limit of all skipped effects. White: skipped; a"
    " number: milliseconds that skipping saves, as estimated. free: could be skipped, but skipping"
    " it saves no time. Gray: never skipped. Shares are of full signal, of temporal variance or of"
    " fixed-pattern variance (largest over five signal levels)."
)


def plot_scene_plans(path: Path | str, title: str, plans: Sequence[ScenePlan], times: str) -> None:
    """Draw which effects run before which scenes, and the seconds of a frame.

    Parameters
    ----------
    path : Path or str
        PNG file to write.
    title : str
        Title of the picture.
    plans : sequence of ScenePlan
        Plans of one camera.
    times : str
        A sentence on the seconds.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    names = effect_names(plans)
    width, height = CELL[0] * len(names), CELL[1] * len(plans)
    labels = max(len(each.scene) for each in plans) / CHARACTERS + 0.3
    above = 0.5 + 0.72 * max(map(len, names)) / CHARACTERS  # names are turned
    lines = textwrap.wrap(f"{WORDS} {times}", int((labels + width + BARS - 0.3) * CHARACTERS))
    below = 0.75 + LINE * len(lines)
    whole = labels + width + BARS, above + height + below
    with plot_figure(path, whole, dpi=160, layout=None) as figure:
        from matplotlib import colormaps

        bottom, tall = below / whole[1], height / whole[1]
        cells = figure.add_axes((labels / whole[0], bottom, width / whole[0], tall))
        place = (labels + width + 0.15) / whole[0], bottom, (BARS - 0.25) / whole[0], tall
        colors = colormaps["Blues"]
        _cells(cells, names, plans, colors)
        _seconds(figure.add_axes(place), plans)
        ramp = (labels / whole[0], (below - 0.36) / whole[1], 2.0 / whole[0], 0.13 / whole[1])
        _ramp(figure.add_axes(ramp), colors)
        figure.text(0.1 / whole[0], 0.1 / whole[1], "\n".join(lines), size=8.5, va="bottom")
        figure.suptitle(title, x=0.01, y=1 - 0.06 / whole[1], ha="left", va="top", size=10.5)


def _cells(axes: Any, names: Sequence[str], plans: Sequence[ScenePlan], colors: Any) -> None:
    """Draw a cell for every effect and scene."""
    image = np.ones((len(plans), len(names), 4))
    for row, each in enumerate(plans):
        for d in each.decisions:
            column = names.index(d.name)
            shade = _shade(d)
            if d.state == "on":
                image[row, column] = _rgba(ALWAYS) if shade is None else colors(shade)
            text = mark(d)
            if text != "on":
                ink = (
                    "white" if shade is not None and shade > 0.5 and d.state == "on" else "#333333"
                )
                axes.text(column, row, text, ha="center", va="center", size=8, color=ink)
    axes.imshow(image, aspect="auto", interpolation="nearest")
    axes.set_xticks(range(len(names)), [name.replace("_", " ") for name in names], size=8.5)
    axes.tick_params(axis="x", top=True, bottom=False, labeltop=True, labelbottom=False)
    for label in axes.get_xticklabels():
        label.set(rotation=50, ha="left", va="bottom", rotation_mode="anchor")
    axes.set_yticks(range(len(plans)), [each.scene for each in plans], size=8.5)
    axes.tick_params(length=0, pad=3)
    axes.set_xticks(np.arange(len(names) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(plans) + 1) - 0.5, minor=True)
    axes.grid(False)
    axes.grid(which="minor", color="#c8c8c8", linewidth=0.5)
    axes.tick_params(which="minor", length=0, top=False, bottom=False)
    for side in axes.spines.values():
        side.set(visible=True, color="#c8c8c8", linewidth=0.5)


def _shade(decision: Decision) -> float | None:
    """Return where in the color map an effect lies; None where it has no limit to compare with."""
    if decision.name in NEVER_SKIPPED or decision.contribution is None or not decision.allowed:
        return None
    ratio = max(decision.contribution / decision.allowed, 1e-300)
    return PALE + (DARK - PALE) * min(max(math.log10(ratio) / DECADES, 0.0), 1.0)


def _rgba(color: str) -> tuple[float, float, float, float]:
    """Return the parts of a color written as #rrggbb."""
    red, green, blue = (int(color[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue, 1.0


def _seconds(axes: Any, plans: Sequence[ScenePlan]) -> None:
    """Draw seconds with the plan as bars over those with all effects, and write both."""
    for row, each in enumerate(plans):
        auto, every = each.seconds
        share = auto / every if every else 1.0
        axes.barh(row, 1.0, height=0.72, color="#e3e3e3")
        axes.barh(row, min(share, 1.1), height=0.72, color="#6b6b6b")
        text = f"{time_text(auto)} / {time_text(every)}"
        axes.text(1.2, row, text, va="center", size=8.5)
    axes.set_xlim(0, 2.6)
    axes.set_ylim(len(plans) - 0.5, -0.5)
    axes.axis("off")
    what = "measured" if all(each.times for each in plans) else "estimated"
    axes.text(0, -0.75, f"seconds, {what}:\nplan / all effects", size=8.5, va="bottom")


def _ramp(axes: Any, colors: Any) -> None:
    """Draw the colors of shares over their limit."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    shown = LinearSegmentedColormap.from_list("shown", colors(np.linspace(PALE, DARK, 256)))
    scale = ScalarMappable(LogNorm(1, 10**DECADES), shown)
    bar = axes.figure.colorbar(scale, cax=axes, orientation="horizontal")
    bar.set_ticks([1, 10, 100, 1000], labels=["1", "10", "100", "1000"])
    axes.text(1.04, 0.5, "times the limit", transform=axes.transAxes, va="center", size=8)
    axes.tick_params(labelsize=8, length=2, pad=2)
    bar.minorticks_off()
    bar.outline.set_linewidth(0.5)
