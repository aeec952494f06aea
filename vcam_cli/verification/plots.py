"""The histogram of the errors, as figure 2.19 of Chen 2003."""

from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.files.plots import COLORS, INK, LIMIT, plot_figure
from vcam_cli.verification.verify import Verification

LEAST_BINS, MOST_BINS = 10, 60


def draw_errors(path: Path, result: Verification) -> None:
    """Draw how many means have which error [%], and the tolerance that all share.

    Where noise is judged, also draw how far all quantities are from what is predicted.
    """
    percent = 100 * result.errors[np.isfinite(result.errors)]
    means = [row for row in result.rows if row.quantity.startswith("mean")]
    tolerances = {row.tolerance for row in means if row.tolerance is not None}
    reach = max([*np.abs(percent), *(100 * t for t in tolerances), 1e-3]) * 1.02
    width = _round_width(2 * reach / LEAST_BINS, 2 * reach / MOST_BINS)
    ends = np.ceil(reach / width) * width
    edges = np.arange(-ends, ends + width / 2, width)
    with plot_figure(path, (5.4, 6.2 if result.judged else 3.2)) as figure:
        panels = figure.subplots(2 if result.judged else 1, squeeze=False)[:, 0]
        if result.judged:
            _draw_deviations(panels[1], result)
        axes = panels[0]
        axes.hist(percent, edges, color=COLORS[0], edgecolor="white", linewidth=0.8)
        axes.set_xlabel("error of the prediction [%]")
        axes.set_ylabel("number of predictions")
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.axvline(0, color=INK, linewidth=0.7)
        for tolerance in tolerances if len(tolerances) == 1 else ():
            for side in (-100 * tolerance, 100 * tolerance):
                axes.axvline(side, color=COLORS[1], linewidth=1, linestyle=LIMIT)
        names = f"{result.measurement.name} against {result.camera.name}"
        largest = f"largest error {np.abs(percent).max():.2g} %" if percent.size else "no errors"
        axes.set_title(f"{names}\n{len(means)} predictions, {largest}")


def _draw_deviations(axes: Any, result: Verification) -> None:
    """Draw how many quantities deviate by how many standard errors, and the significance limit."""
    rows = result.judged
    limit = max(row.bound or 0.0 for row in rows)
    ends = 1.25 * limit
    values = np.clip([row.deviation or 0.0 for row in rows], -ends, ends)
    axes.hist(values, np.linspace(-ends, ends, 41), color=COLORS[0], edgecolor="white")
    for side in (-limit, limit):
        axes.axvline(side, color=COLORS[1], linewidth=1, linestyle=LIMIT)
    axes.set_xlabel("deviation [standard errors]; values beyond the axis are in the end bins")
    axes.set_ylabel("number of quantities")
    axes.yaxis.get_major_locator().set_params(integer=True)
    differing = sum(row.differs for row in rows)
    axes.set_title(f"{len(rows)} quantities of frames, {differing} differ significantly")


def _round_width(most: float, least: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten up to `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most) or least)
