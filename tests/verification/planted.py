"""A camera with all kinds of noise, frames of it on a bench, and the ways to have it wrong.

`python tests/verification/planted.py` prints what `vcam verify` makes of each, and of right files.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from making import LIGHT, PLANCK

from vcam_cli import load
from vcam_cli.camera.camera import Camera
from vcam_cli.simulation.simulate import simulate
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import Verification, verify

WELL, EFFICIENCY, TIME, SIDE = 12e3, 0.6, 0.01, 4e-6
FULL = WELL / EFFICIENCY / TIME * PLANCK * LIGHT / 532e-9 / SIDE**2
"""Irradiance that fills a pixel [W/m2]."""
LINE = {"monochromatic": "532 nm"}
TRUE: dict[str, Any] = {
    "name": "true",
    "scene": {
        "source": {"kind": "chart", "chart": "uniform"},
        "illuminant": LINE,
        "irradiance": f"{FULL!r} W/m2",
    },
    "optics": "none",
    "pixel": {
        "width": "4 um",
        "photodetector": {
            "fill_factor": 1,
            "quantum_efficiency": EFFICIENCY,
            "dark_current": "600 e/s",
        },
        "readout": {
            "full_well": f"{WELL:g} e",
            "read_noise": "0 e",
            "heavy_tailed_noise": {"rms": "5 e", "shape": -0.05},
            "row_noise": "0 e",
            "correlated_row_noise": {"rms": "2 e", "correlation": 0.7},
            "column_noise": "1.5 e",
            "telegraph_noise": {"fraction": "2 %", "amplitude": "40 e", "occupancy": "40 %"},
        },
        "fpn": {
            "offset_pixel": "4 e",
            "offset_column": "2 e",
            "gain_pixel": "1 %",
            "gain_column": "0.4 %",
            "shading": {"offset": "3 e", "gain": "1 %"},
        },
        "defects": {"hot": 0.003, "dead": 0.003},
    },
    "array": {"rows": 96, "columns": 96, "pattern": "monochrome"},
    "exposure": {"time": "10 ms"},
    "adc": {"bits": 12, "offset": "64 DN", "gain": "0.3 DN/e"},
    "processing": [],
    "effects": "all",
}
READOUT, FPN = "pixel.readout", "pixel.fpn"
WRONG: dict[str, dict[str, Any]] = {
    "gain 3 % high": {"adc.gain": "0.309 DN/e"},
    "gain 3 % low": {"adc.gain": "0.291 DN/e"},
    "efficiency 3 % high": {"pixel.photodetector.quantum_efficiency": 1.03 * EFFICIENCY},
    "full well 3 % low": {f"{READOUT}.full_well": "11640 e"},
    "black level 1 DN high": {"adc.offset": "65 DN"},
    "black level 1 DN low": {"adc.offset": "63 DN"},
    "read noise 15 % high": {f"{READOUT}.heavy_tailed_noise.rms": "5.75 e"},
    "read noise normal": {f"{READOUT}.heavy_tailed_noise": "none", f"{READOUT}.read_noise": "5 e"},
    "no row noise": {f"{READOUT}.correlated_row_noise": "none"},
    "row noise not correlated": {
        f"{READOUT}.correlated_row_noise": "none",
        f"{READOUT}.row_noise": "2 e",
    },
    "no column noise": {f"{READOUT}.column_noise": "0 e"},
    "no telegraph noise": {f"{READOUT}.telegraph_noise": "none"},
    "dark current 10 % high": {"pixel.photodetector.dark_current": "660 e/s"},
    "DSNU 20 % high": {f"{FPN}.offset_pixel": "4.8 e"},
    "no column offsets": {f"{FPN}.offset_column": "0 e"},
    "PRNU 15 % high": {f"{FPN}.gain_pixel": "1.15 %"},
    "PRNU 15 % low": {f"{FPN}.gain_pixel": "0.85 %"},
    "no column gains": {f"{FPN}.gain_column": "0 %"},
    "no hot pixels": {"pixel.defects.hot": 0},
    "no dead pixels": {"pixel.defects.dead": 0},
    "gain 5 % low, efficiency matched": {
        "adc.gain": "0.285 DN/e",
        "pixel.photodetector.quantum_efficiency": EFFICIENCY / 0.95,
    },
    "read noise 5 % low": {f"{READOUT}.heavy_tailed_noise.rms": "4.75 e"},
    "DSNU 10 % high": {f"{FPN}.offset_pixel": "4.4 e"},
    "PRNU 10 % low": {f"{FPN}.gain_pixel": "0.9 %"},
}
"""What is wrong -> changes of the true camera."""
CONDITIONS = {
    "dark, short": (1e-3, 0.0),
    "dark, long": (0.4, 0.0),
    "dim": (TIME, 0.1),
    "half": (TIME, 0.5),
    "bright": (TIME, 0.8),
    "full": (TIME, 1.6),
}
"""Name -> exposure time [s], light over that which fills a pixel."""


def true_camera(folder: Path) -> Camera:
    (folder / "true.yaml").write_text(yaml.safe_dump(TRUE))
    return load(folder / "true.yaml")


def bench(
    camera: Camera,
    folder: Path,
    sensor: int,
    names: tuple[str, ...] = tuple(CONDITIONS),
    frames: int = 8,
) -> Path:
    """Take frames of a sensor; return the measurement's file."""
    entries, seed = [], 10_000 * sensor
    for number, name in enumerate(names):
        time, light = CONDITIONS[name]
        level = f"{light * FULL!r} W/m2"
        for k in range(frames):
            seed += 1
            taken = {"exposure.time": f"{time!r} s", "scene.irradiance": level,
                     "seed.sensor": 500 + sensor, "seed.frame": seed}  # fmt: skip
            np.save(folder / f"s{number}_{k}.npy", simulate(camera.with_(taken), 1).dn)
        lit = {"light": LINE, "irradiance": level} if light else {"light": "none"}
        told = {"files": f"s{number}_*.npy", "name": name, "exposure": f"{time!r} s"}
        entries.append(told | lit)
    form = {"kind": "measurement", "name": "bench", "frames": entries,
            "levels": {"bits": 12}, "pixel": {"width": "4 um"}}  # fmt: skip
    (folder / "bench.yaml").write_text(yaml.safe_dump(form))
    return folder / "bench.yaml"


def judged(camera: Camera, changes: dict[str, Any], bench_file: Path) -> Verification:
    """What is made of a camera file with changes."""
    return verify(camera.with_(changes), measurement_file.read(bench_file))


def told(found: Verification) -> str:
    """How many quantities differ, and which does most."""
    worst = max(found.judged, key=lambda row: abs(row.deviation or 0))
    most = f"{worst.frame}: {worst.quantity} {worst.deviation:+.1f} of {worst.bound:.1f}"
    return f"{sum(r.differs for r in found.judged)} of {len(found.judged)} differ, {most}"


def main(right: int = 20) -> None:
    """Print how many quantities differ, of correct camera files and of wrong ones."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        camera = true_camera(folder)
        for sensor in range(right):
            print(f"right {sensor}: {told(judged(camera, {}, bench(camera, folder, sensor)))}")
        for what, changes in WRONG.items():
            print(f"{what}: {told(judged(camera, changes, folder / 'bench.yaml'))}")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
