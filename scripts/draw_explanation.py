"""Draw the figures of docs/explanation/: image formation, from radiance to codes, by the engine.

Run it as `python scripts/draw_explanation.py [NAME...]`; without a name, all. Lines are closed
forms of `vcam_cli.physics`, marks are simulated frames with fixed seeds: the same bytes every time.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import load, plan, simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.photodiode import quantum_efficiency
from vcam_cli.files.plots import COLORS, MARKERS, plot_figure
from vcam_cli.physics.depth_of_field import blur_diameter
from vcam_cli.physics.diffraction import otf_circular
from vcam_cli.physics.radiometry import relative_illumination_cos4, relative_illumination_exact
from vcam_cli.physics.silicon import absorption, diffusion_mtf

FOLDER = Path(__file__).parents[1] / "docs" / "explanation"
INK = "#444444"
GREEN = 550e-9
"""Wavelength of the figures in monochromatic light [m]."""
F_NUMBER, PITCH, SIDE = 4.0, 4e-6, 3.2e-6
"""Of the camera of the MTF: f-number, pixel pitch and width of the photodetector [m]."""
LENGTH, DEPLETION, NEUTRAL = 30e-6, 2e-6, 8e-6
"""Its silicon: diffusion length, depletion width, depth of the neutral region [m]."""
CAMERA = f"""
name: explanation
scene:
  source: {{kind: chart, chart: uniform}}
  illuminant: {{monochromatic: 550 nm}}
  luminance: 100 cd/m2
  distance: 10 m
optics: {{f_number: {F_NUMBER:g}, focal_length: 8 mm, off_axis: none}}
pixel:
  width: 4 um
  photodetector:
    fill_factor: 0.64
    quantum_efficiency: 0.6
    charge_diffusion: {{diffusion_length: 30 um, depletion_width: 2 um, substrate_depth: 10 um}}
  readout: {{conversion_gain: 50 uV/e, full_well: 20 ke}}
array: {{rows: 32, columns: 128, pattern: monochrome}}
exposure: {{time: 10 ms}}
effects: all
accuracy: 0.01 %
output: {{render: none}}
"""


def camera(**changes: object) -> Camera:
    """Return the camera of the MTF with changes: a path with `__` for dots, and its value."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "explanation.yaml"
        file.write_text(CAMERA, encoding="utf-8")
        found = load(file)
    return found.with_({key.replace("__", "."): value for key, value in changes.items()})


def figure(name: str, width: float = 8.2, height: float = 3.0) -> AbstractContextManager[Any]:
    """Return a figure of the common style that is written as docs/explanation/NAME.png."""
    return plot_figure(FOLDER / f"{name}.png", (width, height), dpi=120)


# What light reaches a pixel


def sinusoid(cycles: float) -> dict[str, object]:
    """Return keys of a camera before a sinusoid, by its cycles per pixel."""
    return {
        "scene.source": {
            "kind": "chart",
            "chart": "sinusoid",
            "frequency": f"{cycles / (PITCH * 1e3):.9g} lp/mm",
            "contrast": 0.8,
            "mean": 0.5,
        }
    }


def mtf() -> None:
    """Draw the transfer functions of lens, silicon and aperture, and a folded sinusoid."""
    cycles = np.linspace(0, 1.5, 301)
    f = cycles / PITCH
    base = camera()
    parts = {
        "diffraction, f/4": otf_circular(f, GREEN, F_NUMBER, 0),
        "charge diffusion": diffusion_mtf(f, absorption(GREEN), LENGTH, DEPLETION, NEUTRAL),
        "pixel aperture, 3.2 um": np.abs(np.sinc(f * SIDE)),
    }
    with figure("mtf") as drawn:
        left, right = drawn.subplots(1, 2)
        for (label, values), color in zip(parts.items(), COLORS[1:], strict=False):
            left.plot(cycles, values, color=color, lw=1.2, label=label)
        left.plot(cycles, np.prod([*parts.values()], axis=0), color=COLORS[0], lw=2, label="system")
        tried = np.arange(1, 12) / 8 - 1 / 64
        seen = [contrast(base.with_(sinusoid(c)), c) for c in tried]
        left.plot(tried, seen, "o", ms=4, mfc="white", color=COLORS[0], label="simulated sinusoids")
        left.axvline(0.5, ymax=0.7, color=INK, lw=0.8, ls=":")
        left.text(0.51, 0.02, "Nyquist", color=INK)
        left.set(xlabel="spatial frequency [cycles/pixel]", ylabel="MTF", ylim=(0, 1.42))
        left.set_yticks(np.arange(0, 1.1, 0.2))
        left.set(title="Every part multiplies the contrast", xlim=(0, 1.5))
        left.legend(loc="upper right", ncols=2)

        high = 0.85
        frame = simulate(base.with_(sinusoid(high))).mean_electrons[16, 52:76]
        mean = frame.mean()
        fine = np.linspace(-12, 12, 961)
        system = np.prod([np.interp(high, cycles, part) for part in parts.values()])
        # Phase 0 is a cosine at the center of the image, between two pixels.
        irradiance = 1 + 0.8 * system * np.cos(2 * np.pi * high * fine)
        right.plot(fine, irradiance, color=COLORS[1], lw=0.8, label=f"image, {high} cycles/pixel")
        alias = 1 + 0.8 * system * np.cos(2 * np.pi * (1 - high) * fine + np.pi)
        right.plot(fine, alias, color=COLORS[0], lw=1.2, ls="--", label="alias, 0.15 cycles/pixel")
        right.plot(np.arange(-11.5, 12), frame / mean, "o", ms=4, color=COLORS[0], label="pixels")
        right.set(title="Pixels fold frequencies above Nyquist", xlabel="position [pixels]")
        right.set(ylabel="signal, relative to its mean", ylim=(0.86, 1.2), xlim=(-12, 12))
        right.legend(loc="upper right", ncols=2)


def contrast(looking: Camera, cycles: float) -> float:
    """Return the MTF that a simulated sinusoid shows: modulation of its alias, over 0.8."""
    row = simulate(looking).mean_electrons[16]
    x = np.arange(len(row)) - (len(row) - 1) / 2
    basis = np.stack([np.ones(len(row)), np.cos(2 * np.pi * cycles * x)], axis=1)
    level, cosine = np.linalg.lstsq(basis, row, rcond=None)[0]
    return abs(cosine / level) / 0.8


def field() -> None:
    """Draw relative illumination over the field, and the image of points through a traced lens."""
    angle = np.linspace(0, 40, 161)
    tan2 = np.tan(np.deg2rad(angle)) ** 2
    with figure("field") as drawn:
        left, right = drawn.subplots(1, 2, width_ratios=(1, 1.15))
        left.plot(angle, relative_illumination_cos4(tan2), color=INK, lw=1.2, label="cos⁴, eq 2.21")
        for number, color in zip((8, 1.4, 0.9), COLORS, strict=False):
            exact = relative_illumination_exact(1 / (4 * number**2), tan2)
            left.plot(angle, exact, color=color, lw=1.2, ls="--", label=f"eq 2.22, f/{number:g}")
        left.set(xlabel="angle off the axis [degrees]", ylabel="relative illumination")
        left.set(title="Illumination falls off the axis", ylim=(0, 1.02), xlim=(0, 40))
        left.legend(loc="lower left")

        right.imshow(np.sqrt(points()), cmap="gray", extent=(0, 3, 0, 1))
        right.set(title="Coma and astigmatism grow with image height", xticks=[], yticks=[])
        right.grid(visible=False)
        for place, height in enumerate(("axis", "40 %", "80 %")):
            right.text(place + 0.5, -0.04, height, ha="center", va="top")
        right.set_xlabel("f/2.8, windows of 48 um, square root of signal", labelpad=14)


def points() -> np.ndarray:
    """Return images (48, 144) of a point on the axis and at two image heights, of maximum 1."""
    size, pitch = 48, "1 um"
    grid = {"kind": "chart", "chart": "point-grid", "spacing": f"{size} um", "diameter": "1 um"}
    wavefront = [{"field": 0, 6: "0 um", 8: "0 um"}, {"field": 1, 6: "0.25 um", 8: "0.2 um"}]
    look = camera(
        scene__source=grid,
        optics={"f_number": 2.8, "focal_length": "8 mm", "off_axis": "none", "zernike": wavefront},
        pixel__width=pitch,
        pixel__photodetector={"fill_factor": 1, "quantum_efficiency": 0.6},
        array={"rows": size, "columns": 5 * size, "pattern": "monochrome"},
        accuracy="0.1 %",
    )
    frame = simulate(look).mean_electrons[:, 2 * size :]
    windows = np.split(frame, 3, axis=1)
    return np.hstack([window / window.max() for window in windows])


def depth() -> None:
    """Draw the blur over distance, and the shipped table top at two f-numbers."""
    distance = np.geomspace(0.2, 3, 200)
    with figure("depth", height=2.4) as drawn:
        left, middle, right = drawn.subplots(1, 3, width_ratios=(1.1, 1, 1))
        for number, color in zip((1.8, 8), COLORS, strict=False):
            pixels = blur_diameter(distance, 0.5, 8e-3, number) / 4e-6
            left.plot(distance, pixels, color=color, label=f"f/{number:g}")
        left.set(xscale="log", xlabel="distance [m]", ylabel="blur diameter [pixels]")
        left.set(title="Focus at 0.5 m", ylim=(0, 28), xlim=(0.2, 3))
        left.set_xticks([0.2, 0.5, 1, 2], ["0.2", "0.5", "1", "2"])
        left.set_xticks([], minor=True)
        left.legend(loc="upper right")
        for axes, number in ((middle, 1.8), (right, 8)):
            changes = {"optics.f_number": number, "exposure.auto.max": "2 s"}
            axes.imshow(simulate(load("table-top").with_(changes)).render)
            axes.set(title=f"table-top at f/{number:g}", xticks=[], yticks=[])
            axes.grid(visible=False)


# Charge and noise


def response() -> None:
    """Draw the spectra that multiply, and the spectral signal of three colors."""
    look = load("starter")
    nm = np.arange(390, 721, 2)
    wavelength = nm * 1e-9
    light = look.scene.illuminant.resolve().evaluate(wavelength) * wavelength
    lens = look.optics.transmittance.resolve().evaluate(wavelength)
    silicon = quantum_efficiency(look).evaluate(wavelength)
    colors = dict(zip("RGB", ("#c0392b", "#2e8b57", "#2a5fb0"), strict=True))
    filters = {c: look.array.filters[c].resolve().evaluate(wavelength) for c in "RGB"}
    with figure("response") as drawn:
        left, right = drawn.subplots(1, 2)
        left.plot(nm, light / light.max(), color=INK, lw=1, label="D65, in photons")
        left.plot(nm, lens, color=COLORS[1], lw=1.2, ls="--", label="lens and infrared filter")
        left.plot(nm, silicon, color=COLORS[3], lw=1.2, ls="-.", label="quantum efficiency")
        for (name, values), style in zip(filters.items(), ("-", "--", ":"), strict=True):
            left.plot(nm, values, color=colors[name], lw=1.2, ls=style, label=f"filter {name}")
            product = light * lens * silicon * values
            right.plot(nm, product / light.max(), color=colors[name], ls=style, label=name)
        left.set(xlabel="wavelength [nm]", ylabel="relative value", ylim=(0, 1.05))
        left.set(title="Factors by wavelength")
        left.legend(loc="center left", bbox_to_anchor=(1, 0.5))
        right.set(xlabel="wavelength [nm]", ylabel="electrons per wavelength, relative")
        right.set(title="Their product; its integral is the signal", ylim=(0, None))
        right.legend()


READ_NOISE, PRNU, WELL = 5.0, 0.01, 20e3
"""Of the photon transfer: read noise [e], gain variation, full well [e]."""


def wall(electrons: float, **changes: object) -> Camera:
    """Return a camera before a uniform scene, exposed to a mean number of electrons."""
    base = camera(
        array__rows=128,
        pixel__photodetector={"fill_factor": 0.64, "quantum_efficiency": 0.6},
        pixel__readout={"conversion_gain": "50 uV/e", "full_well": f"{WELL:g} e",
                        "read_noise": f"{READ_NOISE:g} e"},
        pixel__fpn={"gain_pixel": f"{100 * PRNU:g} %"},
        adc={"bits": 14, "offset": "200 DN"},
    )  # fmt: skip
    rate = simulate(base).mean_electrons.mean() / 10e-3
    changed = {key.replace("__", "."): value for key, value in changes.items()}
    return base.with_({"exposure.time": f"{electrons / rate:.9g} s", **changed})


def photon_transfer() -> None:
    """Draw noise over signal, simulated and in closed form, and patches at four levels."""
    levels = np.geomspace(3, 30e3, 17)
    temporal, total = [], []
    for level in levels:
        first, second = (simulate(wall(level, seed__frame=seed)).electrons for seed in (1, 2))
        temporal.append(np.std(first - second) / np.sqrt(2))
        total.append(np.std(first))
    line = np.geomspace(2, WELL, 200)
    with figure("photon-transfer") as drawn:
        left, right = drawn.subplots(1, 2, width_ratios=(1.15, 1))
        parts = (
            (np.full(200, READ_NOISE), "read noise, 5 e", ":"),
            (np.sqrt(line), "shot noise, √μ", "--"),
            (PRNU * line, "PRNU, 1 % of μ", "-."),
        )
        for color, (values, label, style) in zip(COLORS[1:], parts, strict=False):
            left.loglog(line, values, color=color, lw=1.2, ls=style, label=label)
        left.loglog(line, np.sqrt(READ_NOISE**2 + line + (PRNU * line) ** 2), color=COLORS[0],
                    lw=1.6, label="total")  # fmt: skip
        left.loglog(levels, total, MARKERS[0], ms=4, color=COLORS[0], label="within a frame")
        left.loglog(levels, temporal, MARKERS[1], ms=4, mfc="white", color=INK,
                    label="between two frames")  # fmt: skip
        left.axvline(WELL, color=INK, lw=0.8, ls=":")
        left.text(WELL * 0.92, 1.15, "full well", rotation=90, ha="right", color=INK)
        left.set(xlabel="mean signal μ [e]", ylabel="noise [e rms]", ylim=(1, 400))
        left.set(title="Photon transfer", xlim=(2, 4e4))
        left.legend(loc="upper left")

        shown = (10, 100, 1000, 10000)
        patches = [simulate(edge(level)).electrons[:48, 40:88] / level for level in shown]
        right.imshow(np.vstack([np.hstack(patches[:2]), np.hstack(patches[2:])]), cmap="gray",
                     vmin=0.2, vmax=1.8)  # fmt: skip
        for place, level in enumerate(shown):
            x, y = 48 * (place % 2) + 2, 48 * (place // 2) + 2
            said = f"{level} e, {20 * np.log10(level / np.sqrt(level + READ_NOISE**2)):.0f} dB"
            right.text(x, y, said, va="top", bbox={"fc": "white", "ec": "none", "pad": 1.5})
        right.set(title="An edge of ± 20 % at four levels, and SNR", xticks=[], yticks=[])
        right.grid(visible=False)


def edge(electrons: float) -> Camera:
    """Return a camera before an edge of ± 20 %, exposed to a mean number of electrons."""
    chart = {"kind": "chart", "chart": "slanted-edge", "contrast": 0.2, "angle": "5 deg"}
    bare = wall(electrons, pixel__fpn={})
    mean = simulate(bare.with_({"scene.source": chart})).mean_electrons.mean()
    time = float(bare.exposure.time) * electrons / mean
    return bare.with_({"scene.source": chart, "exposure.time": f"{time:.9g} s"})


# From charge to codes


def codes() -> None:
    """Draw mean codes over charge, noise over gain, and the codes of a dark frame."""
    with figure("codes", height=2.9) as drawn:
        left, middle, right = drawn.subplots(1, 3)
        charge = np.geomspace(60, 40e3, 25)
        for (label, changes), color, mark in zip(READOUTS.items(), COLORS, MARKERS, strict=False):
            means = [simulate(wall(level, **changes)).dn.mean() for level in charge]
            left.semilogx(charge, means, f"{mark}-", ms=2.5, lw=1, color=color, label=label)
        left.set(xlabel="collected charge, unlimited [e]", ylabel="mean raw [DN]")
        left.set(title="Each readout ends at a limit", ylim=(0, 4400))
        left.legend(loc="upper left")

        gain = np.geomspace(1, 16, 60)
        step = WELL / 4095
        before, behind, rounding = 2.0, 1.5 * step / gain, step / gain / np.sqrt(12)
        for values, label, color, style in (
            (np.full(60, before), "before the gain", COLORS[1], ":"),
            (behind, "of the ADC, 1.5 DN", COLORS[2], "--"),
            (rounding, "rounding", COLORS[3], "-."),
            (np.sqrt(before**2 + behind**2 + rounding**2), "all", COLORS[0], "-"),
        ):
            middle.loglog(gain, values, color=color, ls=style, lw=1.3, label=label)
        tried = (1, 2, 4, 8, 16)
        seen = [dark(number).std() * step / number for number in tried]
        middle.loglog(tried, seen, "o", ms=4, color=COLORS[0], label="dark frames")
        middle.set_xticks(tried, [str(number) for number in tried], minor=False)
        middle.set_xticks([], minor=True)
        middle.set(xlabel="analog gain", ylabel="input-referred noise [e rms]")
        middle.set(title="Gain lowers the ADC's share", ylim=(0.05, 300))
        middle.legend(loc="upper right")

        for number, color, offset in ((1, COLORS[0], -0.2), (16, COLORS[1], 0.2)):
            values, count = np.unique(dark(number), return_counts=True)
            right.bar(
                values + offset, count / count.sum(), 0.4, color=color, label=f"gain {number}"
            )
        right.set(xlabel="raw [DN]", ylabel="share of pixels", title="Codes of a dark frame")
        right.set(xlim=(38, 90))
        right.axvline(64, color=INK, lw=0.8, ls=":")
        right.text(65, 0.245, "offset 64 DN", color=INK)
        right.legend(loc="center right")


READOUTS: dict[str, dict[str, object]] = {
    "gain 1": {"adc": {"bits": 12, "offset": "64 DN"}},
    "gain 4": {"adc": {"bits": 12, "offset": "64 DN"}, "exposure__gain": 4},
    "logarithmic": {"adc": {"bits": 12, "offset": "64 DN", "kind": "logarithmic"}},
}
"""Readouts of the figure of codes."""


def dark(gain: int) -> np.ndarray:
    """Return the codes of a dark frame at an analog gain: noise before the gain 2 e, ADC 1.5 DN."""
    return simulate(
        wall(
            100,
            scene__source={"kind": "chart", "chart": "dark"},
            pixel__fpn={},
            pixel__readout={"conversion_gain": "50 uV/e", "full_well": f"{WELL:g} e",
                            "read_noise": "2 e"},
            adc={"bits": 12, "offset": "64 DN", "noise": "1.5 DN"},
            exposure={"time": "10 ms", "gain": gain},
        )
    ).dn.ravel()  # fmt: skip


# Plan and accuracy


def bounds() -> None:
    """Draw the predicted change by skipping diffraction beside the true one, and errors over T."""
    numbers = (1.4, 2, 2.8, 4, 5.6, 8)
    photo = {"array.rows": 120, "array.columns": 180, "output.render": "none"}
    base = load("starter").with_({**photo, "quality": [], "accuracy": "draft"})
    predicted, true, kept = [], [], []
    for number in numbers:
        time = f"{15 * (number / 2.8) ** 2:.9g} ms"  # the same light on the sensor
        look = base.with_({"optics.f_number": number, "exposure": {"time": time}})
        decision = next(e for e in plan(look).effects if e["name"] == "diffraction")
        exact = look.with_({"accuracy": "0.01 %", "effects": "all"})
        whole = simulate(exact).mean_electrons
        without = simulate(exact.with_({"effects": {"diffraction": "off"}})).mean_electrons
        predicted.append(100 * decision["contribution"])
        true.append(100 * rms(without - whole) / whole.max())
        kept.append(decision["state"] == "on")
    with figure("bounds") as drawn:
        left, right = drawn.subplots(1, 2)
        left.loglog(numbers, predicted, "s--", ms=4, color=COLORS[1], label="bound, by the plan")
        left.loglog(numbers, true, "o-", ms=4, color=COLORS[0], label="true change")
        left.axhline(1, color=INK, lw=0.8, ls=":")
        left.text(8.8, 0.97, "T/2 at accuracy: draft", color=INK, va="top", ha="right")
        for number, bound, on in zip(numbers, predicted, kept, strict=True):
            said = "kept" if on else "skipped"
            left.annotate(said, (number, bound), (-3, 7), textcoords="offset points", ha="right")
        left.set_xticks(numbers, [f"f/{number:g}" for number in numbers])
        left.set_xticks([], minor=True)
        left.set(ylabel="rms change [% of full signal]", title="Diffraction before a ColorChecker")
        left.set(ylim=(0.25, 5), xlim=(1, 9))
        left.set_yticks([0.3, 0.5, 1, 2, 4], ["0.3", "0.5", "1", "2", "4"])
        left.set_yticks([], minor=True)
        left.legend(loc="lower right")

        tolerances = np.array([2, 1, 0.5, 0.2, 0.1, 0.05, 0.02])
        for name, color, mark in zip(SCENES, COLORS, MARKERS, strict=False):
            look = base.with_(
                {"scene.source": {"kind": "chart", "chart": name}, "exposure": {"time": "15 ms"}}
            )
            exact = simulate(look.with_({"accuracy": "0.001 %", "effects": "all"})).mean_electrons
            errors = [
                100 * rms(simulate(look.with_({"accuracy": f"{t} %"})).mean_electrons - exact)
                / exact.max()
                for t in tolerances
            ]  # fmt: skip
            right.loglog(tolerances, errors, f"{mark}-", ms=4, lw=1, color=color, label=name)
        right.loglog(tolerances, tolerances, color=INK, lw=0.8, ls=":")
        right.text(0.021, 0.035, "error = T", color=INK, rotation=38)
        right.set(xlabel="tolerance T [% of full signal]", ylabel="rms error [% of full signal]")
        right.set(title="Errors stay below the tolerance")
        right.legend(loc="lower right")


SCENES = ("colorchecker", "siemens-star", "dead-leaves")
"""Charts of the errors over the tolerance."""


def rms(values: np.ndarray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


FIGURES: tuple[Callable[[], None], ...] = (
    mtf, field, depth, response, photon_transfer, codes, bounds,
)  # fmt: skip


def main() -> None:
    """Draw the figures that the command line names."""
    FOLDER.mkdir(exist_ok=True)
    wanted = sys.argv[1:]
    for draw in FIGURES:
        if not wanted or draw.__name__ in wanted:
            print(draw.__name__, flush=True)
            draw()


if __name__ == "__main__":
    main()
