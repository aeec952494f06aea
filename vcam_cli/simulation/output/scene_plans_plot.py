"""The picture of scenes.csv: effects by scenes, contribution against what is allowed, on or off.

An effect that is left out has what that saves in its place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.files.plots import STYLE, load, save
from vcam_cli.simulation.plan import Decision
from vcam_cli.simulation.scene_plans import ScenePlan, effect_names

DECADES = 3.0
"""Powers of ten of contribution over what is allowed that the colors show, up and down."""
LEAST_SAVED = 5e-5
"""Time that is worth a number [s]."""


def plot_scene_plans(path: Path | str, title: str, plans: Sequence[ScenePlan]) -> None:
    """Draw which effects run before which scenes.

    Parameters
    ----------
    path : Path or str
        PNG file to write.
    title : str
        Title of the picture.
    plans : sequence of ScenePlan
        Plans of one camera.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    matplotlib = load()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = effect_names(plans)
    ratios = np.full((len(names), len(plans)), np.nan)
    marks: dict[tuple[int, int], str] = {}
    for column, each in enumerate(plans):
        for d in each.decisions:
            at = names.index(d.name), column
            marks[at] = _mark(d)
            if d.contribution is not None and d.allowed:
                ratio = d.contribution / d.allowed
                ratios[at] = math.log10(max(ratio, 10**-DECADES))
    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        size = 2.6 + 0.44 * len(plans), 2.4 + 0.3 * len(names)
        figure = Figure(figsize=size, dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        shown = axes.imshow(
            ratios, cmap="RdYlBu_r", vmin=-DECADES, vmax=DECADES, aspect="auto", alpha=0.75
        )
        axes.set_xticks(range(len(plans)), [each.scene for each in plans], rotation=60, ha="right")
        axes.set_yticks(range(len(names)), names)
        axes.grid(False)
        axes.tick_params(length=0)
        axes.set_title(title)
        for (row, column), text in marks.items():
            axes.text(column, row, text, ha="center", va="center", fontsize=7)
        bar = figure.colorbar(shown, ax=axes, shrink=0.8)
        exponents = np.arange(-DECADES, DECADES + 1, 1.0)
        bar.set_ticks(list(exponents), labels=[f"{10.0**e:g}" for e in exponents])
        bar.set_label("contribution over what may be left out together")
        said = 'an effect without "on" or "free" is left out; a time is what that saves'
        figure.supxlabel(said, size=8)
        save(figure, path)


def _mark(decision: Decision) -> str:
    """Return what is written of an effect before a scene."""
    if decision.state == "on":
        return "free" if decision.free else "on"
    saved = decision.saved if decision.by == "plan" else 0.0
    return f"{1000 * saved:.1g} ms" if saved >= LEAST_SAVED else ""
