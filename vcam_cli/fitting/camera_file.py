"""The camera file of a fitted sensor under the light of its flat frames: bare, or behind a lens.

With a lens the scene is as bright as gives the sensor that light. The lens keeps none of it back
and falls off nowhere, since flat frames are taken without it.
"""

from __future__ import annotations

import math
from typing import Any

from vcam_cli import units
from vcam_cli.fitting.conditions import Conditions, usual_temperature
from vcam_cli.fitting.pattern import CYCLES
from vcam_cli.fitting.result import Fit
from vcam_cli.fitting.sensor import Transfer
from vcam_cli.physics.radiometry import irradiance_per_radiance

MTF = "mtf.csv"
"""The file of the lens's transfer, beside the camera file."""
BLACK = 1.0
"""Quantum efficiency assumed where it was not measured."""


def tree(found: Fit, conditions: Conditions, curves: list[Transfer]) -> dict[str, Any]:
    """Return the camera file as YAML has it; adds the keys left at a default to `found.unknown`."""
    measurement = found.measurement
    assert measurement.levels is not None
    assert measurement.pixel is not None
    assert measurement.pixel.width is not None
    entry = curves[0].conditions[len(curves[0].conditions) // 2].entry
    pixel = measurement.pixel
    gain, levels = found.value("system_gain") or 0.0, _black_levels(found)
    black = sum(levels.values()) / len(levels)
    offset = max(0, round(black))
    well = found.value("full_well") or (2**measurement.levels.bits - 1 - offset) / gain
    readout = {"full_well": _charge(well), **_noise(found)}
    if len(levels) == 1 and abs(black - offset) > 0.05:
        found.notes.append(f"the black level {black:.3f} DN is rounded to {offset} in the camera")
    height = {} if pixel.height is None else {"height": units.render(pixel.height, "length")}
    detector: dict[str, Any] = {"fill_factor": 1.0, "quantum_efficiency": BLACK}
    efficiencies = _efficiencies(found, curves)
    detector["quantum_efficiency"] = max(efficiencies.values())
    if found.value("dark_current"):
        detector |= _dark_current(found)
    scene: dict[str, Any] = {
        "source": {"kind": "chart", "chart": "uniform"},
        "illuminant": entry.light.to_yaml() if entry.light else "equal-energy",
        "irradiance": units.render(entry.irradiance or 0.01, "irradiance"),
    }
    optics: str | dict[str, Any] = "none"
    if measurement.optics is not None and found.lens is not None:
        lens = measurement.optics
        optics = {
            "f_number": lens.f_number,
            "focal_length": units.render(lens.focal_length, "length"),
            "transmittance": 1,
            "off_axis": "none",
            "mtf": {"file": MTF},
        }
        solid_angle = float(irradiance_per_radiance(lens.f_number))
        before = (entry.irradiance or 0.01) * math.pi / solid_angle
        scene |= {"irradiance": units.render(before, "irradiance"), "distance": "infinity"}
    if entry.irradiance is None:
        found.unknown.append("irradiance of the flat frames: the camera file assumes 0.01 W/m2")
    usual = usual_temperature(measurement)
    array: dict[str, Any] = {
        "rows": conditions.shape[0],
        "columns": conditions.shape[1],
        "pattern": measurement.pattern,
    }
    if measurement.pattern != "monochrome":
        top = max(efficiencies.values())
        array["filters"] = {color: value / top for color, value in efficiencies.items()}
    fpn: dict[str, Any] = {"offset_pixel": _charge(found.value("offset_pixel")),
           "offset_column": _charge(found.value("offset_column")),
           "gain_pixel": _percent(found.value("gain_pixel")),
           "gain_column": _percent(found.value("gain_column"))}  # fmt: skip
    uneven, slow = found.value("shading_offset"), found.value("shading_gain")
    if uneven or slow:
        fpn["shading"] = {"offset": _charge(uneven), "gain": _percent(slow), "cycles": CYCLES}
    return {
        "name": measurement.name,
        "scene": scene,
        "optics": optics,
        "pixel": {
            "width": units.render(pixel.width, "length"),
            **height,
            "photodetector": detector,
            "readout": readout,
            "fpn": fpn,
            **({} if usual is None else {"temperature": units.render(usual, "temperature")}),
            "defects": {"hot": found.value("hot") or 0, "dead": found.value("dead") or 0},
        },
        "array": array,
        "exposure": {"time": units.render(entry.exposure, "time")},
        "adc": {
            "bits": measurement.levels.bits,
            "offset": f"{offset} DN"
            if len(levels) == 1
            else {color: f"{max(level, 0):.2f} DN" for color, level in levels.items()},
            "gain": f"{gain:.6g} DN/e",
        },
        "processing": [],
    }


def _black_levels(found: Fit) -> dict[str, float]:
    """Return the black level of every color, or one of "" where they are alike [DN]."""
    listed = [p for p in found.parameters if p.name.startswith("black_level")]
    return {p.name.partition(".")[2]: p.value for p in listed}


def _dark_current(found: Fit) -> dict[str, Any]:
    """Return the dark current of the pixel, with its temperature where its rise is known."""
    current, rise = max(found.value("dark_current") or 0, 0), found.value("dark_current_doubling")
    value, usual = f"{current:.6g} e/s", usual_temperature(found.measurement)
    if rise is None or usual is None:
        return {"dark_current": value}
    known = {"temperature": units.render(usual, "temperature"), "doubling": f"{rise:.6g} K"}
    return {"dark_current": {"value": value, **known}}


def _noise(found: Fit) -> dict[str, Any]:
    """Return the keys of the readout's temporal noise."""
    out: dict[str, Any] = {"column_noise": _charge(found.value("column_noise"))}
    shape, correlation = found.value("read_noise_shape"), found.value("row_correlation")
    read, row = (_charge(found.value(name)) for name in ("read_noise", "row_noise"))
    if shape is None:
        out["read_noise"] = read
    else:
        out["heavy_tailed_noise"] = {"rms": read, "shape": round(shape, 6)}
    fraction = found.value("telegraph_fraction")
    if fraction:
        out["telegraph_noise"] = {
            "fraction": _percent(fraction),
            "amplitude": _charge(found.value("telegraph_amplitude")),
            "occupancy": _percent(found.value("telegraph_occupancy")),
        }
    if correlation is None:
        out["row_noise"] = row
    else:
        out["correlated_row_noise"] = {"rms": row, "correlation": round(correlation, 6)}
    return out


def _efficiencies(found: Fit, curves: list[Transfer]) -> dict[str, float]:
    """Return the quantum efficiency of every color in the first light, at most 1."""
    first = [curve for curve in curves if curve.light == curves[0].light]
    known = {c.color: c.efficiency.value for c in first if c.efficiency is not None}
    if len(known) < len(first):
        steps = {c.color: c.result.responsivity for c in first}
        found.unknown.append("quantum efficiency: relative to that of the best color, set to 1")
        return {color: value / max(steps.values()) for color, value in steps.items()}
    if max(known.values()) > 1:
        found.notes.append("the quantum efficiency is above 1: irradiance or photons are too low")
    return {color: min(value, 1.0) for color, value in known.items()}


def _charge(value: float | None) -> str:
    return f"{value or 0.0:.6g} e"


def _percent(value: float | None) -> str:
    return f"{100 * (value or 0.0):.6g} %"
