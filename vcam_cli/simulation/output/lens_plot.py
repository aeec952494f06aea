"""The page of a lens: section with rays, spots, MTF, distortion, illumination, color."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.files.plots import COLORS, DASHES, GRAY, INK, MARKERS, SMALL, plot_figure
from vcam_cli.simulation.lens_page import SHOWN, LensPage

SIZE = 11.0, 8.2
"""Width and height [in]."""
LIGHT = COLORS[0], COLORS[2], COLORS[1]
"""Colors of the three wavelengths, from short to long."""
GLASS = "#dbe9f4"
SPOT_SHARE = 0.995
"""Share of the rays that the frame of the spot diagrams holds."""


def plot_lens(path: Path | str, page: LensPage) -> None:
    """Draw the page of a lens.

    Parameters
    ----------
    path : Path or str
        File to write; its name says the format.
    page : LensPage
        What is drawn.
    """
    with plot_figure(path, SIZE, dpi=110) as figure:
        parts: Any = figure.subfigures(3, 1, height_ratios=(1.25, 0.85, 1.0))
        top, middle, bottom = parts
        top.suptitle(page.title, x=0.01, ha="left", fontsize=12)
        section, facts = top.subplots(1, 2, width_ratios=(2.6, 1))
        _draw_section(section, page)
        _write_facts(facts, page)
        _draw_spots(middle.subplots(1, len(SHOWN)), page)
        mtf, distortion, light, color = bottom.subplots(1, 4, width_ratios=(1.5, 1, 1, 1.2))
        _draw_mtf(mtf, page)
        heights = page.heights * 1e3
        _draw_curve(distortion, heights, 100 * page.distortion, "distortion [%]")
        _draw_curve(light, heights, 100 * page.illumination, "relative illumination [%]")
        light.set_ylim(0, 105)
        _draw_color(color, page)


def _draw_section(axes: Any, page: LensPage) -> None:
    drawing = page.drawing
    for i, (z, x) in enumerate(drawing.outlines):
        if drawing.glasses[i]:
            next_z, next_x = drawing.outlines[i + 1]
            edge_z = np.concatenate([z, next_z[::-1], z[:1]])
            edge_x = np.concatenate([x, next_x[::-1], x[:1]])
            keep = np.isfinite(edge_z)
            axes.fill(edge_z[keep] * 1e3, edge_x[keep] * 1e3, color=GLASS, lw=0, zorder=1)
            axes.plot(edge_z[keep] * 1e3, edge_x[keep] * 1e3, color="#46607a", lw=0.8, zorder=3)
    for number, (z, x) in enumerate(drawing.fans):
        style: Any = {"color": COLORS[number], "ls": DASHES[number]}
        axes.plot(z * 1e3, x * 1e3, lw=0.6, zorder=2, **style)
        angle = np.degrees(page.angles[[0, 5, 8][number]])
        axes.plot([], [], lw=1, label=f"{angle:.3g}°", **style)
    place, radius = drawing.stop
    reach = max(float(np.nanmax(np.abs(x))) for _, x in drawing.outlines)
    for side in (1, -1):
        ends = np.array([radius, max(1.15 * radius, radius + 0.12 * reach)]) * side
        axes.plot([place * 1e3] * 2, ends * 1e3, color="black", lw=2, zorder=4)
    image = page.view.lens.length * 1e3
    half = 1.05 * page.heights[-1] * 1e3
    axes.plot([image, image], [-half, half], color="black", lw=1)
    axes.axhline(0, color=GRAY, lw=0.5, dashes=(8, 3, 2, 3), zorder=0)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlabel("z [mm]")
    axes.set_ylabel(" ")  # keeps room for the numbers, which the aspect widens after the layout
    axes.set_title("y [mm]", loc="left", fontsize=SMALL)
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 1.14), fontsize=SMALL, ncols=3)


def _write_facts(axes: Any, page: LensPage) -> None:
    axes.axis("off")
    from textwrap import wrap

    shift = ", ".join(
        f"{f * 1e6:+.3g} um at {w * 1e9:.0f} nm"
        for f, w in zip(page.focus, page.wavelengths, strict=True)
    )
    told = [*page.facts, f"paraxial focus: {shift}", f"source: {page.view.lens.source}"]
    lines = [line for fact in (*told, *page.remarks) for line in wrap(fact, 44)]
    axes.text(0, 1, "\n".join(lines), va="top", fontsize=7.8, linespacing=1.5)


def _draw_spots(axes: Any, page: LensPage) -> None:
    far = np.hypot(page.spots.x, page.spots.y)
    half = 1e6 * float(np.nanquantile(far, SPOT_SHARE))
    for place, frame in enumerate(axes):
        for wave, color in enumerate(LIGHT):
            x, y = page.spots.x[place, wave], page.spots.y[place, wave]
            frame.plot(x * 1e6, y * 1e6, ".", ms=1.6, mew=0, color=color)
        number = SHOWN[place]
        height, angle = page.heights[number] * 1e3, np.degrees(page.angles[number])
        rms = page.spot_rms[number] * 1e6
        frame.set_title(f"{height:.3g} mm, {angle:.3g}°: rms {rms:.3g} um", fontsize=8.5)
        frame.set_xlim(-half, half)
        frame.set_ylim(-half, half)
        frame.set_aspect("equal")
        frame.set_xlabel("radial [um]", fontsize=SMALL)
    axes[0].set_ylabel("spot diagram, tangential [um]")


def _draw_mtf(axes: Any, page: LensPage) -> None:
    heights = page.heights * 1e3
    for i, frequency in enumerate(page.frequencies):
        name = f"{frequency / 1e3:.3g} lp/mm"
        axes.plot(heights, page.sagittal[i], MARKERS[i], ls="-", ms=3, color=COLORS[i], lw=1.2,
                  label=name)  # fmt: skip
        axes.plot(heights, page.tangential[i], color=COLORS[i], lw=1.2, ls="--")
    axes.plot([], [], color=INK, lw=1, label="sagittal")
    axes.plot([], [], color=INK, lw=1, ls="--", label="tangential")
    axes.set_ylim(0, 1.02)
    axes.set_ylabel("MTF, equal-energy light")
    axes.set_xlabel("image height [mm]")
    _legend_above(axes)


def _draw_curve(axes: Any, heights: Any, values: Any, label: str) -> None:
    axes.plot(heights, values, color=COLORS[0], lw=1.3)
    axes.set_ylabel(label)
    axes.set_xlabel("image height [mm]")


def _draw_color(axes: Any, page: LensPage) -> None:
    for i, wave in enumerate(page.wavelengths):
        name = f"{wave * 1e9:.0f} nm"
        axes.plot(page.heights * 1e3, page.color[:, i] * 1e6, color=LIGHT[i], lw=1.3, ls=DASHES[i],
                  label=name)  # fmt: skip
    axes.axhline(0, color=GRAY, lw=0.6)
    primary = page.view.lens.primary * 1e9
    axes.set_ylabel(f"lateral color [um], 0 at {primary:.0f} nm")
    axes.set_xlabel("image height [mm]")
    _legend_above(axes)


def _legend_above(axes: Any) -> None:
    """Put the legend above a panel, where no curve passes."""
    axes.legend(
        fontsize=SMALL,
        ncols=3,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderpad=0.2,
        columnspacing=1.0,
        handlelength=1.6,
    )
