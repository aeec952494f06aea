"""What `run.json` says of a run, in words and with units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

Row = tuple[str, str]
UNITS = {
    "exposure_time": "s",
    "mean_electrons": "e",
    "well_capacity": "e",
}
"""Metric -> unit, where its name does not end in it."""


def spoken(name: str) -> str:
    """Return the name of an effect as it is said."""
    fixed = {
        "fpn": "fixed-pattern noise",
        "fpn_shading": "shading of the fixed pattern",
        "fpn_maps": "measured fixed pattern",
    }
    return fixed.get(name, name.replace("_", " "))


def metric_rows(metrics: Mapping[str, Any]) -> list[Row]:
    """Return the metrics of a run with their units."""
    return [(name, number(value, _unit(name))) for name, value in metrics.items()]


def _unit(name: str) -> str:
    return "dB" if name.endswith("_db") else UNITS.get(name, "")


def number(value: Any, unit: str = "") -> str:
    """Return a number of `run.json`, which writes infinity as a word, with six digits."""
    text = value if isinstance(value, str) else f"{float(value):.6g}"
    return f"{text} {unit}".rstrip()


def exposure_rows(exposure: Mapping[str, Any]) -> list[Row]:
    """Return how a frame was exposed."""
    rows = [("time", f"{1e3 * exposure['time']:.4g} ms"), ("gain", f"{exposure['gain']:.4g}")]
    if exposure["iso"]:
        rows.append(("ISO speed", f"{exposure['iso']:.3g}"))
    rows.append(("chosen by", "the camera" if exposure["automatic"] else "the file"))
    if exposure["stopped_by"]:
        rows.append(("stopped at its", exposure["stopped_by"]))
    rows.append(("raw peak", f"{100 * exposure['raw_peak']:.3g} % of full scale"))
    clipped = (f"{color} {100 * share:.3g} %" for color, share in exposure["clipped"].items())
    return [*rows, ("clipped pixels", ", ".join(clipped))]


def geometry_rows(geometry: Mapping[str, Any]) -> list[Row]:
    """Return distances, angles and frequencies."""
    return list(_geometry(geometry))


def _geometry(g: Mapping[str, Any]) -> Iterator[Row]:
    if _infinite(g["focal_length"]):
        yield "lens", "none: a bare sensor"
    else:
        yield from _lens(g)
    yield "sensor", f"{g['sensor_width'] * 1e3:.4g} x {g['sensor_height'] * 1e3:.4g} mm"
    yield "pixel pitch", f"{g['pixel_pitch_x'] * 1e6:.4g} x {g['pixel_pitch_y'] * 1e6:.4g} um"
    yield "Nyquist frequency", f"{g['nyquist_frequency'] / 1e3:.4g} lp/mm"


def _lens(g: Mapping[str, Any]) -> Iterator[Row]:
    distance = g["object_distance"]
    yield "distance", "infinite" if _infinite(distance) else f"{distance:.4g} m"
    angles = (g[f"field_of_view_{name}"] for name in ("horizontal", "vertical", "diagonal"))
    yield "field of view", " x ".join(f"{math.degrees(a):.3g}" for a in angles) + " deg diagonal"
    yield "focal length", f"{g['focal_length'] * 1e3:.4g} mm"
    yield "f-number", f"{g['f_number']:.4g}, working {g['working_f_number']:.4g}"
    yield "diffraction cut-off", f"{g['diffraction_cutoff_550nm'] / 1e3:.4g} lp/mm at 550 nm"


def _infinite(value: Any) -> bool:
    return value == "infinity" or (isinstance(value, float) and math.isinf(value))
