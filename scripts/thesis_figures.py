"""Draws docs/thesis-figures.png: vcam's curves on the axes of the thesis's figures.

Axis limits are those that the thesis prints. Black marks are numbers that its text states; a cross
is vcam's optimum. Red: sizes at which a curve leaves the printed axis, and stated numbers that vcam
misses. Curves of sizes come from docs/thesis_runs.json, the others from closed forms and from the
tables of the studies, which `make thesis` runs before.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import thesis_pixels
import thesis_runs
from thesis_runs import OUT, Runs

from vcam_cli import schedule
from vcam_cli.files.plots import COLORS, plot_figure
from vcam_cli.sweeps.optimum import find_optimum

FILE = Path(__file__).parent.parent / "docs/thesis-figures.png"
MISS = "#c62828"
SIZES = (5.0, 15.0)
WIDTH = "pixel size [µm]"
ERROR = "mean ΔE"


def sizes(
    axes: Any, runs: Runs, cases: dict[str, str], stated: dict[str, tuple[float, float, float]],
    x: tuple[float, float], y: tuple[float, float], log: bool = False,
) -> None:  # fmt: skip
    """Draw errors over sizes of cases, and optima beside what the thesis states of them.

    stated: case -> the thesis's optimum and the two sizes between which it is met.
    """
    out = []
    for color, (case, name) in zip(COLORS, cases.items(), strict=False):
        width, curves = thesis_runs.curve(runs, case)
        mean = curves.mean(axis=0)
        axes.plot(width, mean, color=color, lw=1.2, label=name)
        out += [(a, b) for a, b in _outside(width, mean, y) if b > a]
        best = find_optimum(width, curves, "min")
        inside = min(max(best.value, y[0]), y[1])
        if not best.edge:
            axes.plot(best.place, inside, "x", color=color, ms=7, mew=1.8, zorder=5, clip_on=False)
        if case in stated:
            thesis, low, high = stated[case]
            missed = best.edge or not low <= best.place <= high
            axes.axvline(thesis, color=MISS if missed else "black", lw=0.9, ls=":", zorder=1)
    for a, b in out:
        axes.axvspan(a, b, color=MISS, alpha=0.08, lw=0)
    axes.set(xlim=x, ylim=y, xlabel=WIDTH, ylabel=ERROR)
    if log:
        axes.set_yscale("log")
        axes.set_yticks([0.6, 1, 2, 3, 4, 5], labels=["0.6", "1", "2", "3", "4", "5"])
        axes.minorticks_off()
    if len(cases) > 1:
        axes.legend(fontsize=6.5)


def _outside(x: np.ndarray, y: np.ndarray, limits: tuple[float, float]) -> Iterable[Any]:
    """Yield the stretches of x in which a curve leaves an axis."""
    fine = np.linspace(x[0], x[-1], 2000)
    values = np.interp(fine, x, y)
    wrong = np.concatenate([[False], (values < limits[0]) | (values > limits[1]), [False]])
    ends = np.flatnonzero(np.diff(wrong.astype(int)))
    yield from ((fine[a], fine[b - 1]) for a, b in zip(ends[::2], ends[1::2], strict=True))


def signal_to_noise(axes: Any, _: Runs) -> None:
    """Draw figure 3.2 (a)."""
    width = np.linspace(5.3, 15, 25)
    for color, (name, label) in zip(
        COLORS, {"dynamic_range_db": "DR", "snr_db": "SNR"}.items(), strict=False
    ):
        y = np.array([thesis_pixels.at_30_ms(name, float(w)) for w in width])
        axes.plot(width, y, color=color, lw=1.2, label=label)
        for a, b in _outside(width, y, (35, 70)):
            axes.axvspan(a, b, color=MISS, alpha=0.08, lw=0)
    axes.plot([5.3, 15], [38, 52], "o", color="black", ms=4)
    axes.errorbar([5.3, 15], [47.5, 67.5], yerr=2.5, color=MISS, fmt="s", ms=3.5, lw=1)
    axes.set(xlim=SIZES, ylim=(35, 70), xlabel=WIDTH, ylabel="dB")
    axes.legend(fontsize=6.5)


def transfer(axes: Any, _: Runs) -> None:
    """Draw figure 3.2 (b)."""
    for color, width in zip(COLORS, (6, 8, 10, 12), strict=False):
        x, y = thesis_pixels.mtf(width)
        axes.plot(x / (1e3 / 12), y, color=color, lw=1.2, label=f"{width} µm")
    axes.set(xlim=(0, 1), ylim=(0, 1), ylabel="MTF")
    axes.set_xlabel("frequency / Nyquist frequency of 6 µm")
    axes.legend(fontsize=6.5)


def vignetting(axes: Any, _: Runs) -> None:
    """Draw figure 3.12."""
    for color, (width, end) in zip(COLORS, ((6, 0.70), (12, 0.92)), strict=False):
        x, y = thesis_pixels.along_diagonal(width)
        axes.plot(x, y, color=color, lw=1.2, label=f"{width} µm")
        axes.plot([x[0], x[-1]], [end, end], "o", color="black", ms=4, clip_on=False)
    axes.set(xlim=(-1.95, 1.95), ylim=(0.5, 1), ylabel="normalized QE")
    axes.set_xlabel("along the diagonal [mm]; the thesis's axis ends at ±1.5")
    axes.legend(fontsize=6.5)


def scaling(axes: Any, runs: Runs) -> None:
    """Draw figure 3.15."""
    for case, feature in (("nominal", 0.35), ("cmos-0.25um", 0.25), ("cmos-0.18um", 0.18)):
        best = find_optimum(*thesis_runs.curve(runs, case), "min")
        axes.errorbar(
            feature, best.place, yerr=[[best.place - best.low], [best.high - best.place]],
            fmt="x", color=COLORS[0], mew=1.6, lw=1.2, label="vcam" if feature == 0.35 else None,
        )  # fmt: skip
    axes.plot([0.1, 0.4], [6.5 * 0.1 / 0.35, 6.5 * 0.4 / 0.35], color="gray", lw=0.9, ls="--",
              label="linear scaling of 6.5 µm")  # fmt: skip
    axes.plot([0.18, 0.35], [3.5, 6.5], "o", color="black", ms=4, label="stated")
    axes.set(xlim=(0.1, 0.4), ylim=(0, 8), xlabel="technology [µm]", ylabel="best size [µm]")
    axes.legend(fontsize=6.5)


def captures(
    axes: Any,
    _: Runs,
    study: str,
    limits: tuple[float, float],
    marks: Sequence[Any],
) -> None:
    """Draw figures 4.3, 4.6 and 4.7, the pdf as an inset."""
    with TemporaryDirectory() as folder:
        methods = "methods=[optimal, heuristic, uniform, exponential]"
        counts = "counts=[2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 18, 20]"
        found = schedule(study, f"{folder}/out", [methods, counts, "targets=[]"])
        rows, pdf = found.summary_rows, found.task.pdf
    for color, method in zip(
        COLORS, ("optimal", "heuristic", "uniform", "exponential"), strict=False
    ):
        if study == "captures" and method == "heuristic":
            continue
        some = [row for row in rows if row["method"] == method]
        axes.plot([r["count"] for r in some], [r["gain"] for r in some], color=color, lw=1.2,
                  marker="o", ms=2.5, label=method)  # fmt: skip
    axes.axhline(rows[0]["upper_bound"], color="gray", lw=0.9, ls="--", label="upper bound")
    for x, y in marks:
        axes.plot(x, y, "o", color="black", ms=4, zorder=5)
    axes.set(xlim=(2, 20), ylim=limits, xlabel="captures", ylabel="E[SNR] / single")
    axes.legend(fontsize=6, loc="lower right", ncols=3)
    inset = axes.inset_axes((0.77, 0.19, 0.2, 0.2))
    for low, high, share in zip(pdf.low, pdf.high, pdf.probability, strict=True):
        inset.fill_between([low, high], 0, share / (high - low), color=COLORS[0], alpha=0.4)
    inset.set(xlim=(0, 1), ylim=(0, None))
    inset.set_title("pdf", fontsize=6, pad=1)
    inset.tick_params(labelsize=5)


def segments(axes: Any, _: Runs) -> None:
    """Draw figure 4.10."""
    rows = _table("captures-segments/segments.csv")
    some = [r for r in rows if (r["method"], r["density"]) == ("optimal", "histogram")]
    axes.plot([int(r["segments"]) for r in some], [float(r["gain"]) for r in some], color=COLORS[0],
              marker="o", ms=3, lw=1.2)  # fmt: skip
    axes.axvline(3, color="black", lw=0.9, ls=":")
    axes.set(xlim=(1, 8), ylim=(1, 12), xlabel="segments", ylabel="E[SNR] / single, 20 captures")


def _bars(axes: Any, values: dict[str, float], stated: dict[str, float], missed: set[str]) -> None:
    for place, (name, value) in enumerate(values.items()):
        axes.bar(place, value, color=COLORS[0], width=0.55)
        if name in stated:
            color = MISS if name in missed else "black"
            axes.plot([place - 0.4, place + 0.4], [stated[name]] * 2, color=color, lw=1.6)
    axes.set_xticks(range(len(values)), labels=list(values), fontsize=7)
    axes.axhline(0, color="gray", lw=0.6)
    axes.set_ylabel("E[SNR] over the optimum [dB]")


def scene_of_twelve_bits(axes: Any, _: Runs) -> None:
    """Draw what figure 4.11 states: the thesis prints no axis."""
    found = _decibels("captures-hdr-scene", "optimal", ("uniform", "heuristic"))
    _bars(axes, found, {"uniform": -1.3, "heuristic": 0.0}, {"heuristic"})
    axes.set_ylim(-1.8, 0.3)


def dark_room(axes: Any, _: Runs) -> None:
    """Draw what figure 4.13 states: the thesis has pictures alone."""
    names = {"experiment": "5, 15, 30, 200 ms", "evenly": "uniform", "single": "5 ms alone"}
    found = _decibels("captures-dark-room", "optimal", tuple(names))
    _bars(axes, {names[name]: value for name, value in found.items()}, {}, set())


def _decibels(study: str, best: str, names: Sequence[str]) -> dict[str, float]:
    rows = _table(f"{study}/frames.csv")
    snr = {r["schedule"]: float(r["expected_snr"]) for r in rows if r["estimator"] == "lsbs"}
    return {name: float(10 * np.log10(snr[name] / snr[best])) for name in names}


def _table(name: str) -> list[dict[str, str]]:
    with (OUT / name).open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


DARK = {"nominal": "j", "dark-x10": "10 j", "dark-div10": "j / 10"}
LIGHT = {"nominal": "100 cd/m²", "luminance-x10": "1000 cd/m²", "luminance-div10": "10 cd/m²"}
TUNNEL = {"vignetting-bare": "without vignetting", "vignetting": "with it, f/2"}
LENSES = {"cmos-0.18um": "bare", "cmos-0.18um-microlens": "microlens"}
PROCESSES = {"nominal": "0.35 µm", "cmos-0.25um": "0.25 µm", "cmos-0.18um": "0.18 µm"}
SIX = {"nominal": (6.5, 6.35, 6.65)}
PANELS: dict[str, Callable[[Any, Runs], None]] = {
    "3.2 (a): squares: DR, missed": signal_to_noise,
    "3.2 (b)": transfer,
    "3.8": partial(sizes, cases={"nominal": ""}, stated=SIX, x=SIZES, y=(0.8, 1.8)),
    "3.9": partial(
        sizes, cases=DARK, x=SIZES, y=(0.6, 5), log=True,
        stated=SIX | {"dark-x10": (10, 9, 11), "dark-div10": (5.7, 5.45, 5.95)},
    ),
    "3.10": partial(
        sizes, cases=LIGHT, x=SIZES, y=(0.6, 6), log=True,
        stated=SIX | {"luminance-div10": (10, 9, 11), "luminance-x10": (5.5, 5.3, 5.7)},
    ),
    "3.11": partial(
        sizes, cases=TUNNEL, x=SIZES, y=(1, 5),
        stated={"vignetting": (8, 7.5, 8.5), "vignetting-bare": (6.5, 6.35, 6.65)},
    ),
    "3.12": vignetting,
    "3.13": partial(
        sizes, cases=LENSES, x=(2, 9), y=(0.8, 1.6),
        stated={"cmos-0.18um": (3.5, 3.34, 3.75), "cmos-0.18um-microlens": (3.2, 3, 3.4)},
    ),
    "3.14": partial(sizes, cases=PROCESSES, stated=SIX, x=(2, 15), y=(0.8, 1.8)),
    "3.15": scaling,
    "4.3": partial(captures, study="captures", limits=(1, 2.05), marks=[(10, 0.86 * 2)]),
    "4.6, pdf of 4.4": partial(
        captures, study="captures-two-segments", limits=(1, 2.05), marks=[]
    ),
    "4.7": partial(captures, study="captures-three-segments", limits=(1, 9), marks=[]),
    "4.10": segments,
    "4.11, stated": scene_of_twelve_bits,
    "4.13, four captures and one": dark_room,
}  # fmt: skip
"""Number of a figure -> what draws it."""


def draw(runs: Runs, file: Path = FILE) -> None:
    """Draw all figures on one page."""
    columns = 4
    rows = -(-len(PANELS) // columns)
    with plot_figure(file, (4.1 * columns, 3.1 * rows)) as figure:
        for number, (name, panel) in enumerate(PANELS.items(), start=1):
            axes = figure.add_subplot(rows, columns, number)
            panel(axes, runs)
            axes.set_title(f"Figure {name}", fontsize=8.5)
