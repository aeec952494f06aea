"""Numbers of chapter 3 on docs/thesis.md: closed forms of its cameras, and single pictures.

Every function returns one number; its row in thesis_rows.yaml has what the thesis says of it. What
takes a whole sweep is taken from its curves: the functions of `DERIVED`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from vcam_cli import load
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.quality.modes import density_modes
from vcam_cli.sweeps import properties
from vcam_cli.sweeps.error_maps import BIN, ErrorMaps, MapCache
from vcam_cli.sweeps.quantities import FREQUENCY, POSITION, WAVELENGTH
from vcam_cli.sweeps.study_cameras import FigureCamera

LENS = {"optics.focal_length": "8 mm", "optics.f_number": 2,
        "pixel.stack": {"passivation": {"thickness": "0.7 um", "index": 2.0},
                        "oxide": {"thickness": "3.35 um", "index": 1.46}}}  # fmt: skip
"""The lens and the tunnel of figures 3.11 and 3.12, as the study has them."""


def _camera(width: float, process: str = "0.35", **changes: object) -> Camera:
    return load(f"csf-{process}um").with_({"pixel.width": f"{width} um", **changes})


def _swing(process: str) -> float:
    return float(electrical(_camera(6.5, process)).voltage_swing)


def swing_035() -> float:
    """Swing of the 0.35 um process [V]."""
    return _swing("0.35")


def swing_025() -> float:
    """Swing of the 0.25 um process [V]."""
    return _swing("0.25")


def swing_018() -> float:
    """Swing of the 0.18 um process [V]."""
    return _swing("0.18")


def field_of_view() -> float:
    """Field of view of the study's camera over the width of its die [deg]."""
    return math.degrees(geometry(load("csf-0.35um")).report(0)["field_of_view_horizontal"])


def stated_inputs() -> float:
    """Count the inputs of section 3.4 that the study's camera has as the thesis states them."""
    camera, inch = load("csf-0.35um"), 0.0254
    stated = (
        (camera.optics.focal_length, 3.2e-3),
        (camera.optics.f_number, 1.2),
        (camera.array.die.width, 512 * 5.3e-6),
        (camera.scene.source.max_frequency, 33e3),
        (camera.scene.luminance, 100.0),
        (camera.exposure.auto.max, 0.1),
        (camera.display.width, 512 / 72 * inch),
        (camera.display.viewing_distance, 18 * inch),
    )
    return float(sum(math.isclose(own, thesis, rel_tol=1e-9) for own, thesis in stated))


def _property(name: str, width: float, process: str = "0.35") -> float:
    return float(properties.value(_camera(width, process), name))


def capacitance_15um() -> float:
    """Capacitance of a 15 um pixel in 0.35 um [fF]."""
    return _property("capacitance", 15)


def largest_dark_current() -> float:
    """Dark current density of the smallest pixels, the largest of the three processes [nA/cm2]."""
    smallest = (("0.35", 5.3), ("0.25", 3.785714), ("0.18", 2.725714))
    return max(_property("dark_current_density", w, process) for process, w in smallest)


def smallest_dark_current() -> float:
    """Dark current density of the largest pixels, the smallest of the processes [nA/cm2]."""
    largest = (("0.35", 15), ("0.25", 10.714286), ("0.18", 7.714286))
    return min(_property("dark_current_density", w, process) for process, w in largest)


def peak_efficiency() -> float:
    """Largest quantum efficiency of the three processes, over the wavelengths."""
    found = []
    for process in ("0.35", "0.25", "0.18"):
        (one, *_) = properties.curves(_camera(6.5, process), WAVELENGTH, 0.0)
        found.append(float(np.max(one.y["quantum_efficiency"])))
    return max(found)


@cache
def mtf(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequency [lp/mm], to the Nyquist frequency of 6 um, and system MTF of a size."""
    nyquist = 1e3 / (2 * 6.0)  # of a 6 um pixel, to which figure 3.2 normalizes [lp/mm]
    (one, *_) = properties.curves(_camera(width), FREQUENCY, nyquist)
    return np.asarray(one.x[FREQUENCY]), np.asarray(one.y["system_mtf"])


def _mtf_at_half(width: float) -> float:
    x, y = mtf(width)
    return float(np.interp(0.5e3 / 12, x, y))


def mtf_12_over_6um() -> float:
    """System MTF of 12 um pixels over that of 6 um pixels, there."""
    return _mtf_at_half(12) / _mtf_at_half(6)


def center_vignetting_6um() -> float:
    """QE of the center pixel of figure 3.12 over that without vignetting, 6 um."""
    return float(np.max(along_diagonal(6)[1]))


def along_diagonal(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places [mm] on the diagonal and QE over that without vignetting, figure 3.12."""
    (one, *_) = properties.curves(_camera(width, **LENS), POSITION, 0.0)
    return np.asarray(one.x[POSITION]), np.asarray(one.y["qe_over_no_vignetting"])


def at_30_ms(name: str, width: float) -> float:
    """Return a property of a size at the exposure of figure 3.2."""
    return float(properties.value(_camera(width, **{"exposure.time": "30 ms"}), name))


@cache
def _maps(width: float) -> ErrorMaps:
    """Return the error maps of the study's four phases."""
    phases = (f"{phase} deg" for phase in (0, 90, 180, 270))
    frames = tuple(
        _camera(width, **{"scene.source.phase": p, "quality": ["s-cielab"]}) for p in phases
    )
    return MapCache(1).maps(FigureCamera("nominal", width, frames))


def _line(width: float, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequency [lp/mm] and contrast of the line of a Delta E."""
    maps = _maps(width)
    (line,) = maps.axes.lines(maps.worst_delta_e, level)
    known = line[np.isfinite(line).all(axis=1)]
    return known[:, 0], known[:, 1]


def rise_of_line() -> float:
    """Rise of contrast along the line of Delta E 5 of 8 um pixels from 10 to 20 lp/mm."""
    x, y = _line(8, 5)
    inside = (x >= 10) & (x <= 20)
    return float(y[inside].max() - y[inside][0])


def line_8_over_15um() -> float:
    """Smallest contrast of the line of Delta E 3 of 8 um over that of 15 um, above 3 lp/mm."""
    (x8, y8), (x15, y15) = _line(8, 3), _line(15, 3)
    at = np.linspace(3.5, 30, 200)
    return float((np.interp(at, x8, y8) / np.interp(at, x15, y15)).min())


def crossing_of_lines() -> float:
    """Frequency above which 5.3 um pixels have the higher line of Delta E 3 than 15 um [lp/mm]."""
    (x5, y5), (x15, y15) = _line(5.3, 3), _line(15, 3)
    at = np.linspace(1, 30, 600)
    above = np.interp(at, x5, y5) > np.interp(at, x15, y15)
    return float(at[int(np.argmax(above))]) if above.any() else float("nan")


def _modes(width: float) -> float:
    maps = _maps(width)
    return float(len(density_modes(maps.counts, BIN, float(maps.delta_e.size)).locations))


def modes_5_3um() -> float:
    """Count the modes of the error map of 5.3 um pixels."""
    return _modes(5.3)


def modes_8um() -> float:
    """Count the modes of the error map of 8 um pixels."""
    return _modes(8)


Curves = Callable[[str], tuple[np.ndarray, np.ndarray]]
"""Case -> widths [um] and mean errors (phases, widths) of the sweep."""


def _first_below(curves: Curves, case: str, other: str) -> float:
    """Return the width above which a case has less error than another [um]; nan for never."""
    width, one = curves(case)
    _, two = curves(other)
    differs = one.mean(axis=0) - two.mean(axis=0)
    i = int(np.argmax(differs < 0))
    if differs[i] >= 0:
        return float("nan")
    if i == 0:
        return float(width[0])
    return float(np.interp(0, [differs[i], differs[i - 1]], [width[i], width[i - 1]]))


def tunnel_is_better_from(curves: Curves) -> float:
    """Width above which pictures with vignetting are the better ones [um]."""
    return _first_below(curves, "vignetting", "vignetting-bare")


def microlens_is_worse_from(curves: Curves) -> float:
    """Width above which pictures with microlenses are the worse ones, 0.18 um [um]."""
    width, lens = curves("cmos-0.18um-microlens")
    _, bare = curves("cmos-0.18um")
    differs = lens.mean(axis=0) - bare.mean(axis=0)
    i = int(np.argmax(differs > 0))
    return float(np.interp(0, [differs[i - 1], differs[i]], [width[i - 1], width[i]]))


DERIVED: dict[str, Callable[[Curves], float]] = {
    "tunnel_is_better_from": tunnel_is_better_from,
    "microlens_is_worse_from": microlens_is_worse_from,
}
"""What is read off the sweep's curves."""
