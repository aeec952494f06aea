"""Cameras drawn at random, every effect that their kind has, and what a tolerance makes of them.

Sizes and strengths are spread over what cameras have, evenly in their logarithm where they span
more than a factor of three. Every fifth scene moves, by some pixels in 10 ms; before some hangs a
card, out of focus. The arrays are small: nothing here depends on their size but time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from promises import picture_files, variance_lost_of

from vcam_cli import load
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.knobs import with_accuracy
from vcam_cli.accuracy_study.reference import prepare_converged
from vcam_cli.camera.camera import Camera
from vcam_cli.floats import rms
from vcam_cli.simulation.simulate import prepare

COUNT = 40
TOLERANCES = (0.02, 0.005, 0.001)
MOST_BYTES = 1e8
"""Of memory for a truth: the arrays are small."""
LAMPS = ("D65", "A", "FL2", "FL11", "D50")
PICTURES = (
    {"kind": "image", "file": "color.png", "model": "laser"},
    {"kind": "image", "file": "gray.png", "model": "reflectance"},
)
SCENES = (
    {"kind": "chart", "chart": "colorchecker"},
    *PICTURES,
    {"kind": "chart", "chart": "slanted-edge"},
    *PICTURES,
)
"""More pictures than charts, which are painted as finely as edges call for."""


def tree(number: int) -> dict:
    """A camera file, as a mapping; every number gives another camera, always the same."""
    rng = np.random.default_rng((8, number))

    def spread(low: float, high: float, unit: str = "") -> str | float:
        value = float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")
        return f"{value:g} {unit}" if unit else value

    def share(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 4)

    source = dict(SCENES[number % len(SCENES)])
    scene: dict = {"source": source, "distance": "1 m", "luminance": spread(20, 5000, "cd/m2")}
    if source.get("model") != "laser":
        lamp = LAMPS[int(rng.integers(len(LAMPS)))]
        flicker = {"frequency": "100 Hz", "depth": f"{0.2 * 2 ** (number % 8):g} %"}
        scene["illuminant"] = {"lamp": lamp, "flicker": flicker}
    blur: dict = {"defocus": spread(1, 15, "um")}
    if number % 3 == 0:
        blur = {"zernike": {k: spread(5, 60, "nm") for k in (4, 7, 8, 11)}}
    if number % 20 == 5:  # a field takes a minute
        near, far = ({k: spread(5, 60, "nm") for k in (4, 11)} for _ in range(2))
        blur = {"zernike": [{"field": 0, **near}, {"field": 1, **far}]}
    stack = {
        "passivation": {"thickness": spread(0.2, 1, "um"), "index": 2.0},
        "oxide": {"thickness": spread(0.5, 4, "um"), "index": 1.46},
    }
    gain = spread(10, 100)
    ccd = number % 2 == 0  # it samples twice, and has no reset noise
    noise: dict = {"reset_noise": spread(0.3, 30, "e")}
    if ccd:
        leak = spread(0.01, 1, "%")
        transfer = {"inefficiency": spread(1e-6, 1e-3), "phases": 3, "smear": leak}
        noise = {"charge_transfer": transfer}
    drawn = {
        "name": f"random-{number}",
        "scene": scene,
        "optics": {
            "f_number": share(1.4, 8),
            "focal_length": spread(0.2, 20, "mm"),
            "transmittance": [0.95, "ir-cut-650"],
            "off_axis": "cos4" if number % 2 else "exact",
            "stray_light": spread(0.003, 0.05),
            "low_pass": {
                "displacement": spread(0.3, 3, "um"),
                "axes": ("both", "x", "y", "diagonal")[number % 4],
            },
            "exit_pupil_distance": spread(0.5, 20, "mm"),
            **blur,
        },
        "pixel": {
            "architecture": "ccd" if ccd else "aps-3t",
            "width": spread(1.5, 10, "um"),
            "stack": stack,
            "crosstalk": {"optical": spread(0.01, 2, "%"), "electrical": spread(0.01, 2, "%")},
            "microlens": {"gain": share(1.1, 1.8), "shift": "optimal"},
            "photodetector": {
                "fill_factor": share(0.25, 0.55),
                "quantum_efficiency": "front-illuminated-qe",
                "dark_current": spread(1, 3000, "e/s"),
                "charge_diffusion": {
                    "diffusion_length": spread(5, 50, "um"),
                    "depletion_width": spread(0.3, 3, "um"),
                    "substrate_depth": spread(3, 10, "um"),
                },
            },
            "readout": {
                "conversion_gain": f"{gain} uV/e",
                "voltage_swing": "1 V",
                "read_noise": spread(0.3, 30, "e"),
                "heavy_tailed_noise": {"rms": spread(0.3, 10, "e"), "shape": -0.1},
                "correlated_row_noise": {"rms": spread(0.1, 5, "e"), "correlation": 0.8},
                "telegraph_noise": {"fraction": "3 %", "amplitude": spread(3, 60, "e")},
                **noise,
            },
            "fpn": {
                "offset_pixel": spread(0.3, 10, "e"),
                "offset_column": spread(0.1, 5, "e"),
                "gain_pixel": spread(0.1, 2, "%"),
                "shading": {"offset": spread(0.3, 5, "e"), "gain": spread(0.1, 2, "%")},
                "offset_map": "rings.npy",
            },
        },
        "array": {
            "rows": 24,
            "columns": 32,
            "pattern": ("monochrome", "bayer-rggb")[int(rng.integers(2))],
        },
        "exposure": {
            "auto": {"max": "100 ms"},
            "shutter": {"rolling": {"line_time": "370 us"}},
        },
        "adc": {"bits": int(rng.integers(8, 15)), "noise": "0.7 DN"},
    }
    if number % 8 == 6:
        shape = {"blades": int(rng.integers(5, 10)), "rotation": f"{rng.uniform(0, 60):.3g} deg"}
        vanes = {"count": int(rng.integers(1, 5)), "width": spread(0.5, 10, "%")}
        shape |= {"obscuration": spread(5, 50, "%")} if number % 16 == 6 else {}
        drawn["optics"]["aperture"] = shape | ({"spiders": vanes} if number % 16 == 14 else {})
    lengths = drawn["pixel"]["width"], drawn["optics"]["focal_length"]
    width, focal_length = (float(length.split()[0]) for length in lengths)
    in_scene = 1e-3 * width / focal_length  # a pixel's width, at 1 m [m]
    if number % 5 == 2:  # it moves, so many pixels in 10 ms
        pixels = {axis: share(-1, 1) * spread(0.5, 20) for axis in ("x", "y")}
        source["motion"] = {axis: f"{n * in_scene / 10e-3:.4g} m/s" for axis, n in pixels.items()}
    if number % 10 == 8 and source.get("model") != "laser":  # a card hangs before its middle
        near = share(0.6, 0.95)
        card = {"kind": "chart", "chart": "slanted-edge"}
        size = {"distance": f"{near} m", "width": f"{16 * near * in_scene:.4g} m"}
        behind = {"source": source, "distance": scene.pop("distance")}
        scene["source"] = {"kind": "layers", "layers": [{"source": card, **size}, behind]}
    return drawn


def made(number: int, folder: Path) -> Camera:
    """One of the cameras, read from a file as a user's are."""
    import yaml

    picture_files(folder)
    path = folder / f"random-{number}.yaml"
    path.write_text(yaml.safe_dump(tree(number), sort_keys=False), encoding="utf-8")
    return load(path)


@dataclass(frozen=True)
class Held:
    """What a tolerance makes of a camera; all but the first relative to full signal."""

    tolerance: float
    expected: float
    """Rms that the plan expects to lose: of the spectrum, and of what it leaves out."""
    mean: float
    """Rms of (mean raw under auto - mean raw with everything on, converged)."""
    variance: float
    """Largest relative change of a variance at a percentile of the signal, of at most 2 T."""


def held(camera: Camera, workers: int = 1) -> Iterator[Held]:
    """The promise of every tolerance, for one camera."""
    autos = [prepare(with_accuracy(camera, tolerance=t), workers)[0] for t in TOLERANCES]
    found = prepare_converged(camera, autos[-1], workers, MOST_BYTES)
    truth, full = ablation.mean_raw(found), ablation.full_signal(found)
    for tolerance, auto in zip(TOLERANCES, autos, strict=True):
        out = [d for d in auto.plan.decisions if d.state == "off" and d.by == "plan"]
        expected = auto.spectrum.lost_rms * auto.exposure_time / full
        expected += sum(d.contribution or 0 for d in out if d.unit == "of full signal")
        mean = rms(ablation.mean_raw(auto) - truth) / full
        yield Held(tolerance, expected, mean, variance_lost_of(auto, found))
