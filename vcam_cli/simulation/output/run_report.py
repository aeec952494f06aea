"""report.html: pictures, settings and results of a run on one page.

Nothing is simulated for it: pictures are those of the frame, drawings follow from its plan and its
effects, tables from the record that becomes `run.json`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.files import atomic
from vcam_cli.files.report import to_json
from vcam_cli.processing import tone
from vcam_cli.quality.error_map import scale_limit
from vcam_cli.reports import page, pictures
from vcam_cli.reports.page import Facts, Page, Part, Picture, Section, Table, Text
from vcam_cli.reports.run_facts import exposure_rows, geometry_rows, metric_rows, spoken
from vcam_cli.simulation.frame import Frame
from vcam_cli.simulation.output import report_plots
from vcam_cli.simulation.photograph import Photograph, needs_picture

GROUP = "frame"
"""Pictures of the same pixels, which zoom together."""


def write(path: Path, result: Photograph, record: Mapping[str, Any]) -> None:
    """Write report.html of a run.

    Parameters
    ----------
    path : Path
        File to write.
    result : Photograph
        Photograph to write.
    record : mapping
        Contents of `run.json`.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    page.write(path, report(result, record))


def report(result: Photograph, record: Mapping[str, Any]) -> Page:
    """Return the report of a run.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    record : mapping
        Contents of `run.json`.

    Returns
    -------
    Page
        Page with its plots.
    """
    frame = result.frame
    return Page(
        title=f"{record['name']}: one photograph",
        about=_about(frame),
        notes=record["notes"],
        sections=(
            Section("Pictures", list(_pictures(result))),
            Section("Exposure and metrics", [*_exposure(frame, record), _metrics(record)]),
            Section("Plan", [_plan(record)], _plan_text(record)),
            Section("Noise and codes", list(_noise(frame))),
            Section("Light and sharpness", list(_light(frame))),
            Section("Lens", list(_lens(frame))),
            Section("Provenance", list(_provenance(record))),
        ),
    )


def _about(frame: Frame) -> str:
    g = frame.geometry
    rows, columns = frame.dn.shape[-2:]
    lens = "without a lens"
    if math.isfinite(g.focal_length):
        lens = f"behind a lens of {g.focal_length * 1e3:.3g} mm at f/{g.f_number:.3g}"
    colors = ", ".join(frame.mosaic.colors)
    return f"{columns} x {rows} pixels of {g.pitch_x * 1e6:.3g} um {lens}. Colors: {colors}."


def _pictures(result: Photograph) -> Iterator[Part]:
    frame, name = result.frame, result.frame.solved.name
    if needs_picture(frame.solved):
        ideal, note = pictures.codes(tone.encode(result.ideal, "srgb", 8))
        about = "The scene at the centers of the pixels, without blur and noise, in the camera's"
        yield Picture("Scene", ideal, f"Ideal picture of the scene of {name}",
                      f"{about} colors. {note}", group=GROUP)  # fmt: skip
    joined = frame.mean_electrons
    if joined.ndim == 2 and min(joined.shape) > 1:
        upper = float(joined.max()) or 1.0
        yield pictures.map_picture(
            "Light collected", joined, upper, "e", f"Map of the mean electrons of {name}",
            "Mean electrons of every pixel behind its filter, before noise and saturation.", GROUP,
            len(frame.mosaic.colors) > 1,
        )  # fmt: skip
    yield from _raw(result)
    if needs_picture(frame.solved):
        codes = result.render if result.render.dtype == np.uint8 else result.render >> 8
        render, note = pictures.codes(codes.astype(np.uint8))
        yield Picture("Render", render, f"Photograph that {name} takes",
                      f"After {_steps(frame)}. {note}", group=GROUP)  # fmt: skip
    if "s-cielab" in frame.solved.quality:
        found = result.s_cielab
        note = f"S-CIELAB difference of render and scene, {found.mean():.3g} on average."
        yield pictures.map_picture(
            "Error", found, scale_limit(found), "ΔE", f"Map of the visible errors of {name}", note,
            GROUP,
        )  # fmt: skip


def _raw(result: Photograph) -> Iterator[Part]:
    dn = result.dn
    if dn.ndim == 1 or min(dn.shape[:2]) < 2 or (dn.ndim == 3 and dn.shape[2] != 3):
        return
    frame = result.frame
    low = min(frame.black_dn, frame.chain.saturated_dn - 1)
    shown = pictures.shades(dn - dn.dtype.type(low), frame.chain.saturated_dn - low)
    is_mosaic = len(frame.mosaic.colors) > 1 and shown.ndim == 2
    raw, note = pictures.codes(shown, is_mosaic)
    about = "Codes from the black level to saturation, brightened by a square root."
    yield Picture("Raw frame", raw, f"Raw codes of {frame.solved.name} as shades of gray",
                  f"{about} {note}".strip(), group=GROUP,
                  far=pictures.without_mosaic(shown) if is_mosaic else "")  # fmt: skip


def _lens(frame: Frame) -> Iterator[Part]:
    """Yield the page of a lens that is traced."""
    if frame.solved.optics.prescription is None:
        return
    from vcam_cli.simulation.lens_page import lens_page
    from vcam_cli.simulation.output.lens_plot import plot_lens

    found = lens_page(frame.solved)
    drawn = atomic.written_bytes("lens.png", lambda path: plot_lens(path, found))
    title = f"Rays, spots, MTF and colors of {found.title}"
    about = "From the center to the corner of the array; vcam plan --lens writes the numbers."
    yield Picture("Traced lens", pictures.png(drawn), title, about)


def _steps(frame: Frame) -> str:
    names = [step.name.replace("_", " ") for step in frame.solved.processing]
    return ", ".join(names) or "no processing"


def _exposure(frame: Frame, record: Mapping[str, Any]) -> Iterator[Part]:
    yield Facts("Exposure", exposure_rows(record["exposure"]))
    yield Facts("Geometry", geometry_rows(record["geometry"]))
    e = frame.electrical
    yield Facts(
        "Readout",
        [
            ("full well", f"{e.full_well:.5g} e"),
            ("one code", f"{e.electrons_per_dn:.4g} e"),
            ("codes", f"0 to {e.highest_code:g}, black at {frame.black_dn:.4g}"),
            ("dark signal", f"{frame.dark_rate * frame.exposure_time:.4g} e"),
        ],
    )


def _metrics(record: Mapping[str, Any]) -> Part:
    rows = metric_rows(record["metrics"])
    return Table("Metrics", ("metric", "value"), rows, "As metrics.csv has them.",
                 numbers=frozenset({1}))  # fmt: skip


def _plan_text(record: Mapping[str, Any]) -> str:
    plan = record["plan"]
    on = sum(effect["state"] == "on" for effect in plan["effects"])
    left = sum(e["state"] == "off" and e["by"] == "plan" for e in plan["effects"])
    return (
        f"Simulated: {on} effects. Skipped, since the change is within the tolerance: {left}."
        f" Estimated: {plan['seconds']:.2g} s and {plan['memory_bytes'] / 1e6:.3g} MB;"
        f" taken: {sum(record['stages'].values()):.2g} s and"
        f" {record['peak_memory_bytes'] / 1e6:.3g} MB of the whole process."
    )


def _plan(record: Mapping[str, Any]) -> Part:
    head = ("effect", "state", "decided by", "effect, or reason for skipping it", "contribution",
            "allowed", "share of")  # fmt: skip
    effects = sorted(record["plan"]["effects"], key=lambda e: (e["state"] == "off", e["by"]))
    rows = [
        (
            spoken(e["name"]),
            e["state"],
            e["by"],
            e["reason"],
            _percent(e["contribution"]),
            _percent(e["allowed"]),
            e["unit"].removeprefix("of "),
        )
        for e in effects
    ]
    note = "Contribution: the largest change by leaving the effect out. Allowed: of all together."
    return Table("Effects", head, rows, note, numbers=frozenset({4, 5}))


def _percent(share: float | None) -> str:
    return "" if share is None or not math.isfinite(share) else f"{100 * share:.3g} %"


def _noise(frame: Frame) -> Iterator[Part]:
    signal, parts = report_plots.noise_parts(frame)
    names = [spoken(name) for name in parts]
    middle = float(np.sqrt(signal[-1]))
    shares = {
        name: float(np.interp(middle, signal, part))
        for name, part in zip(names, parts.values(), strict=True)
    }
    largest = max(shares, key=lambda name: shares[name])
    yield Picture(
        "Noise budget",
        pictures.drawing(
            partial(report_plots.draw_noise_budget, frame=frame, names=names), (5, 3.5)
        ),
        f"Stacked shares of {', '.join(names)} over the signal; at {middle:.3g} electrons {largest}"
        " is the largest",
        "Share of each source in the variance of a pixel. The gray bar: signals of this scene.",
    )
    yield Picture(
        "SNR",
        pictures.drawing(partial(report_plots.draw_snr, frame=frame), (5, 3.5)),
        "Signal-to-noise ratio over the signal, temporal and with fixed pattern, below the"
        " shot-noise limit",
        "Of one pixel, from the noise sources that are simulated.",
    )
    yield Picture(
        "Histogram",
        pictures.drawing(partial(report_plots.draw_histogram, frame=frame), (5, 3.5)),
        "Number of pixels over the raw code for each color, logarithmic",
        "Of the raw frame; the axis of pixels is linear up to 1 and logarithmic above.",
    )


def _light(frame: Frame) -> Iterator[Part]:
    yield Picture(
        "From light to electrons",
        pictures.drawing(partial(report_plots.draw_spectra, frame=frame), (5.2, 5.2)),
        "Three spectra: light of the perfect white, electrons per photon of each color, and the"
        " signal of white by wavelength",
        "Above: the light of white in photons, in any unit. Middle: lens, filter and silicon."
        f" Below: the signal of white on the axis in this exposure; a code is"
        f" {frame.electrical.electrons_per_dn:.4g} e.",
    )
    names = [spoken(name) for name in report_plots.mtf_parts(frame)[1]]
    if names:
        yield Picture(
            "Sharpness by factor",
            pictures.drawing(partial(report_plots.draw_mtf, frame=frame, names=names), (5.2, 4)),
            f"MTF over spatial frequency of {', '.join(names)}, and of all together",
            "Transfer along a row, averaged over the light of the scene.",
        )


def _provenance(record: Mapping[str, Any]) -> Iterator[Part]:
    seeds = ", ".join(f"{name} {seed}" for name, seed in record["seeds"].items())
    yield Facts("Versions and seeds", [*sorted(record["versions"].items()), ("seeds", seeds)])
    stages = sorted(record["stages"].items(), key=lambda item: -item[1])
    yield Facts("Time", [(name, f"{seconds:.3f} s") for name, seconds in stages])
    hashes = record["hashes"]
    rows = [("camera, every default filled in", hashes["camera"]), *hashes["inputs"].items()]
    yield Table("Inputs", ("file", "SHA-256"), rows, folded=True)
    yield Text("The camera with every default filled in", to_json(record["camera"]))
