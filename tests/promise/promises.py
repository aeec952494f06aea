"""Cameras that have little in common, and what the plan promises of each, measured.

Small arrays, since nothing here depends on their size but time and memory.
"""

from __future__ import annotations

import math
import shutil
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from making import RINGS

from vcam_cli import load, simulate
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.measurements import is_median_known
from vcam_cli.accuracy_study.reference import effect_changes, prepare_converged
from vcam_cli.camera.camera import Camera
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.files.images.png import write_png
from vcam_cli.floats import rms
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import prepare

PRESETS = ("draft", "standard", "reference")
COMMON = """
array: {rows: 96, columns: 128, pattern: monochrome}
optics: {f_number: 2.8, focal_length: 4 mm, transmittance: [0.95, ir-cut-650]}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: front-illuminated-qe}
  readout: {conversion_gain: 40 uV/e, voltage_swing: 1 V, read_noise: 5 e}
scene: {illuminant: D65, luminance: 300 cd/m2, distance: 1 m}
exposure: {time: 20 ms}
adc: {bits: 12}
"""

CAMERAS = {
    "phone": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 3}, luminance: 150 cd/m2}
optics:
  f_number: 1.8
  focal_length: 0.15 mm
  distortion: {k1: -0.1}
  lateral_color: {table: {450: "-0.1 %", 650: "0.2 %"}}
pixel:
  width: 1.12 um
  photodetector: {fill_factor: 0.9, dark_current: 20 e/s}
  readout: {conversion_gain: 120 uV/e, voltage_swing: 0.6 V, read_noise: 2 e}
  fpn: {offset_pixel: 1 e, gain_pixel: 0.8 %}
array: {pattern: bayer-rggb}
exposure: {auto: {max: 100 ms}}
adc: {bits: 10}
""",
    "machine vision": """
scene: {source: {kind: chart, chart: slanted-edge}, illuminant: FL2, luminance: 1000 cd/m2}
optics: {f_number: 8, focal_length: 25 mm}
pixel:
  width: 5 um
  photodetector: {fill_factor: 0.8, dark_current: 300 e/s}
  readout: {conversion_gain: 60 uV/e, voltage_swing: 1.2 V, read_noise: 12 e, reset_noise: ktc}
  fpn: {offset_pixel: 10 e, offset_column: 4 e, gain_pixel: 1 %}
array: {rows: 120, columns: 160}
exposure: {auto: {max: 50 ms}}
adc: {bits: 8}
""",
    "night": """
scene: {source: {kind: chart, chart: colorchecker}, luminance: 0.05 cd/m2, distance: infinity}
optics: {f_number: 5.6, focal_length: 50 mm}
pixel:
  width: 9 um
  photodetector: {dark_current: 400 e/s}
  readout: {read_noise: 8 e, reset_noise: 20 e}
  fpn: {offset_pixel: 3 e, gain_pixel: 0.5 %}
exposure: {time: 500 ms}
adc: {bits: 14, offset: 200 DN}
""",
    "aliasing": """
scene: {source: {kind: chart, chart: csf, max_frequency: 60 lp/mm}}
optics: {f_number: 2.8, focal_length: 15 mm, transmittance: 1}
pixel:
  width: 15 um
  photodetector: {fill_factor: 0.3}
  readout: {conversion_gain: 5 uV/e, read_noise: 10 e, reset_noise: 1 e}
exposure: {auto: {max: 100 ms}}
""",
    "stopped down": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 8}, luminance: 5000 cd/m2}
optics: {f_number: 16, focal_length: 35 mm, off_axis: cos4}
pixel: {width: 3 um, photodetector: {fill_factor: 1, dark_current: 5 e/s}}
array: {pattern: bayer-gbrg}
exposure: {auto: {max: 100 ms, method: percentile}}
""",
    "beyond Nyquist": """
scene:
  source: {kind: chart, chart: sinusoid, frequency: 140 lp/mm, orientation: 20 deg}
  illuminant: {monochromatic: 633 nm}
  luminance: 500 cd/m2
optics: {f_number: 4, focal_length: 6 mm, transmittance: 0.9}
pixel: {width: 5 um, photodetector: {fill_factor: 0.6, dark_current: 2000 e/s}}
exposure: {auto: {max: 100 ms}}
""",
    "color photograph": """
scene:
  source: {kind: image, file: color.png, model: laser}
  illuminant: null
  luminance: 200 cd/m2
optics: {f_number: 2, focal_length: 3 mm}
pixel:
  width: 2.2 um
  photodetector: {fill_factor: 0.7, dark_current: 60 e/s}
  readout: {conversion_gain: 70 uV/e, read_noise: 3 e, reset_noise: 4 e}
  fpn: {offset_pixel: 2 e, offset_column: 1 e, gain_pixel: 0.6 %, gain_column: 0.1 %}
array: {pattern: bayer-grbg}
exposure: {auto: {max: 100 ms}}
""",
    "shading by color": """
scene: {source: {kind: image, file: color.png}, luminance: 300 cd/m2}
optics:
  f_number: 2.4
  focal_length: 4 mm
  off_axis: {R: {file: red.csv}, G: {file: green.csv}, B: {file: green.csv}}
pixel: {width: 2 um, photodetector: {fill_factor: 0.7}, readout: {read_noise: 3 e}}
array: {pattern: bayer-bggr}
exposure: {auto: {max: 100 ms}}
""",
    "no diffraction": """
scene: {source: {kind: image, file: gray.png, model: reflectance}, illuminant: A}
optics: {diffraction: false, off_axis: none}
pixel: {width: 6 um, photodetector: {fill_factor: 0.25}, readout: {read_noise: 40 e}}
exposure: {auto: {max: 100 ms}}
""",
    "overexposed": """
scene: {source: {kind: chart, chart: colorchecker}, luminance: 800 cd/m2}
optics: {f_number: 2.8, focal_length: 2 mm}
pixel:
  photodetector: {dark_current: 1000 e/s}
  readout: {full_well: 15 ke, voltage_swing: null, read_noise: 4 e}
  fpn: {gain_pixel: 2 %}
  blooming: 30 %
array: {pattern: bayer-rggb}
exposure: {auto: {max: 100 ms, method: mean, target: 0.5}}
""",
    "wide and fast": """
scene: {source: {kind: chart, chart: slanted-edge, angle: 5 deg}, illuminant: {blackbody: 3200 K}}
optics: {f_number: 1.2, focal_length: 0.25 mm}
pixel:
  width: 6.5 um
  photodetector: {fill_factor: 0.6}
  readout: {conversion_gain: 10 uV/e, reset_noise: 0.5 e}
exposure: {auto: {max: 100 ms}}
""",
    "bright and quiet": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 1}, luminance: 20000 cd/m2}
optics: {f_number: 5.6, focal_length: 100 mm}
pixel:
  width: 8 um
  photodetector: {fill_factor: 0.9, dark_current: 50 e/s}
  readout: {conversion_gain: 5 uV/e, voltage_swing: 1 V, read_noise: 0.5 e, reset_noise: 0.5 e}
  fpn: {offset_pixel: 0.5 e, gain_pixel: 1 %}
exposure: {auto: {max: 100 ms}}
adc: {bits: 16}
""",
    "odd pixels": """
scene:
  source: {kind: chart, chart: colorchecker}
  illuminant: FL11
  extent: {width: 0.4 m}
optics: {f_number: 4, focal_length: 4 mm}
pixel:
  width: 6 um
  height: 3 um
  photodetector: {fill_factor: null, width: 3 um, height: 2 um, x: 0.5 um, y: 0.3 um}
  readout: {read_noise: 1 e, conversion_gain: 15 uV/e}
array: {rows: 130, columns: 90, pattern: bayer-bggr}
exposure: {auto: {max: 1 s}}
""",
    "out of focus": """
scene:
  source: {kind: chart, chart: dead-leaves, seed: 5}
  illuminant: {lamp: FL2, flicker: {frequency: 100 Hz, depth: 2 %}}
optics: {f_number: 2, defocus: 15 um, stray_light: 0.04, off_axis: cos4}
pixel: {architecture: aps-4t, readout: {column_noise: 3 e, row_noise: 2 e}}
array: {rows: 60, columns: 80, pattern: bayer-rggb}
exposure: {auto: {max: 100 ms}}
""",
    "a hexagonal aperture": """
scene: {source: {kind: chart, chart: slanted-edge}}
optics:
  f_number: 2.8
  defocus: 30 um
  aperture: {blades: 6, rotation: 10 deg, obscuration: 30 %, spiders: {count: 4, width: 2 %}}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "coma": """
scene: {source: {kind: chart, chart: slanted-edge}}
optics:
  f_number: 2.8
  zernike: {7: 30 nm, 8: 80 nm, 11: 40 nm}
  low_pass: {displacement: 2 um, axes: diagonal}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "passing by": """
scene:
  source: {kind: chart, chart: slanted-edge, motion: {x: 1 mm/s, y: -0.3 mm/s}}
  distance: 0.1 m
optics: {f_number: 2.8}
array: {rows: 60, columns: 80}
exposure: {time: 20 ms, shutter: {rolling: {line_time: 100 us}}}
""",
    "turning": """
scene:
  source: {kind: image, file: color.png, motion: {rotate: 90 deg/s}}
  camera_motion: {roll: -20 deg/s, pan: 2 deg/s}
optics: {f_number: 2.8}
array: {rows: 60, columns: 80, pattern: bayer-rggb}
exposure: {time: 20 ms, shutter: {rolling: {line_time: 100 us, direction: left}}}
""",
    "changing field": """
scene:
  source: {kind: image, file: color.png, model: laser}
  illuminant: null
  luminance: 200 cd/m2
  wavelengths: {start: 440 nm, stop: 660 nm}
optics:
  f_number: 2.8
  zernike: [{field: 0, 11: 30 nm}, {field: 0.7, 8: 50 nm, 7: 20 nm}, {field: 1, 8: 80 nm, 4: 50 nm}]
array: {rows: 60, columns: 80, pattern: bayer-rggb}
exposure: {auto: {max: 100 ms}}
""",
    "curved field": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 6}}
optics: {f_number: 4, zernike: [{field: 0, 4: 0 nm}, {field: 1, 4: 120 nm}]}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "nearly perfect": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 7}}
optics: {f_number: 4, zernike: [{field: 0, 4: 0 nm}, {field: 1, 8: 6 nm}]}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "measured spread": """
scene: {source: {kind: image, file: gray.png, model: reflectance}}
optics: {psf: {file: spread.png, pitch: 1 um}}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "deep silicon": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 9}, illuminant: A}
optics: {f_number: 2}
pixel:
  technology: cmos-0.35um
  temperature: 320 K
  width: 6.5 um
  photodetector:
    {kind: ndiff-psub, quantum_efficiency: null, fill_factor: null, charge_diffusion: junction}
  readout: {reset_noise: ktc, conversion_gain: null, voltage_swing: null}
  fpn: {dark: 10 %, offset_column: 2 e}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "no lens, deep silicon": """
scene: {source: {kind: chart, chart: dead-leaves, seed: 10}}
optics: {diffraction: false}
pixel:
  photodetector:
    charge_diffusion: {diffusion_length: 20 um, depletion_width: 0.5 um, substrate_depth: 8 um}
array: {rows: 60, columns: 80}
exposure: {auto: {max: 100 ms}}
""",
    "layers": """
scene: {source: {kind: chart, chart: colorchecker}}
optics: {f_number: 2.8, exit_pupil_distance: 3 mm}
pixel:
  lag: 2 %
  architecture: ccd
  stack: {passivation: {thickness: 0.5 um, index: 2.0}, oxide: {thickness: 3 um, index: 1.46}}
  microlens: {gain: 1.6, shift: optimal}
  readout: {charge_transfer: {inefficiency: 1e-4, phases: 3, smear: 0.5 %}, reset_noise: ktc}
  photodetector: {capacitance: 5 fF, dark_current: 500 e/s}
  fpn: {dark: 30 %, offset_pixel: 2 e}
array: {rows: 60, columns: 80, pattern: bayer-rggb}
exposure: {auto: {max: 100 ms}}
""",
    "crosstalk": """
scene: {source: {kind: chart, chart: colorchecker}, camera_motion: {jitter: 0.2 px}}
pixel:
  readout: {read_noise: 3 e}
  crosstalk:
    optical: {table: {450: 0.3 %, 650: 0.8 %}}
    electrical: 0.5 %
    interpixel_capacitance: 0.4 %
array: {rows: 60, columns: 80, pattern: bayer-rggb}
exposure: {auto: {max: 100 ms}}
""",
    "defective": """
scene: {source: {kind: chart, chart: slanted-edge}}
pixel:
  architecture: aps-3t
  defects: {hot: 1e-3, dead: 1e-3}
  photodetector: {dark_current: 2000 e/s}
  readout:
    column_noise: 4 e
    row_noise: 4 e
    reset_noise: 10 e
    heavy_tailed_noise: {rms: 4 e, shape: -0.15}
    correlated_row_noise: {rms: 3 e, correlation: 0.8}
    telegraph_noise: {fraction: 3 %, amplitude: 30 e}
  fpn:
    dark: 20 %
    offset_column: 5 e
    gain_column: 0.2 %
    shading: {offset: 4 e, gain: 1 %}
    offset_map: rings.npy
array: {rows: 60, columns: 80}
adc: {noise: 0.7 DN}
exposure: {auto: {max: 100 ms}}
""",
}
"""Name -> what it has different from `COMMON`; null takes a key away."""


def made(name: str, folder: Path, *sets: str) -> Camera:
    """One of the cameras, read from a file as a user's are."""
    import yaml

    picture_files(folder)
    tree = _merged(yaml.safe_load(COMMON), yaml.safe_load(CAMERAS[name]))
    if "auto" in tree["exposure"]:
        del tree["exposure"]["time"]
    path = folder / f"{name.replace(' ', '-')}.yaml"
    path.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
    return load(path, sets)


def _merged(base: dict, over: dict) -> dict:
    out = dict(base)
    for key, value in over.items():
        if value is None:
            out.pop(key, None)
        elif isinstance(value, dict) and isinstance(base.get(key), dict):
            out[key] = _merged(base[key], value)
        else:
            out[key] = value
    return out


def picture_files(folder: Path) -> None:
    """Pictures with the spectrum of natural ones, 1 / f: color.png and gray.png; and tables."""
    if (folder / "color.png").exists():
        return
    rows, columns = 150, 200
    f = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None, :])
    noise = np.fft.rfft2(np.random.default_rng(5).standard_normal((3, rows, columns)))
    field = np.fft.irfft2(noise / np.maximum(f, 1 / columns), s=(rows, columns))
    field = 0.4 + 0.2 * (0.3 * field + 0.7 * field.mean(axis=0)) / field.mean(axis=0).std()
    planes = (np.clip(field, 0, 1) * 65535).astype(np.uint16)
    write_png(folder / "color.png", np.ascontiguousarray(np.moveaxis(planes, 0, 2)))
    write_png(folder / "gray.png", planes[0])
    shutil.copy(RINGS, folder / "rings.npy")
    for color, fall in (("red", 0.3), ("green", 0.02)):
        table = f"image_height_mm,value\n0,1\n0.1,{1 - fall / 2}\n1,{1 - fall}\n"
        (folder / f"{color}.csv").write_text(table, encoding="utf-8")
    y, x = np.indices((24, 32)) - np.array([10, 12])[:, None, None]
    spot = np.exp(-(x**2 + y**2) / 8) + 0.2 * np.exp(-((x - 6) ** 2 + (y - 3) ** 2) / 18)
    write_png(folder / "spread.png", (spot / spot.max() * 65535).astype(np.uint16))


# --- what is measured ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Kept:
    """The promise of one camera at one preset."""

    preset: str
    tolerance: float
    mean: float
    """rms of (mean raw under auto - mean raw with everything on, converged) / full signal"""
    variance: float
    """Largest relative change of a variance at a percentile of the signal, of at most 2 T"""


@dataclass(frozen=True)
class Truth:
    """One camera, converged."""

    found: Prepared
    mean: np.ndarray
    full: float
    auto: dict[str, Prepared]
    """The camera as its file has it, at every preset."""


def truth(camera: Camera) -> Truth:
    """The camera with everything on, and finer than its reference."""
    auto = {preset: prepare(at_preset(camera, preset))[0] for preset in PRESETS}
    found = prepare_converged(camera, auto["reference"], 2)
    return Truth(found, ablation.mean_raw(found), ablation.full_signal(found), auto)


def kept(true: Truth) -> Iterator[Kept]:
    """Both promises, at every preset."""
    for preset, auto in true.auto.items():
        mean = rms(ablation.mean_raw(auto) - true.mean) / true.full
        lost = variance_lost_of(auto, true.found)
        yield Kept(preset, auto.settings.tolerance, mean, lost)


def at_preset(camera: Camera, preset: str) -> Camera:
    return camera.model_copy(update={"accuracy": type(camera.accuracy)(preset=preset)})


def variance_lost_of(auto: Prepared, found: Prepared, levels: np.ndarray | None = None) -> float:
    """Largest relative change of a variance, as the effects state it, with what is left out.

    found: the camera with everything on; levels: signals [electrons], by default its own.
    """
    at = scene_levels(found) if levels is None else levels
    return max(_variance_lost(auto, found, scope, at) for scope in ("frame", "sensor"))


PERCENTILES = (1, 10, 50, 90, 99)


def scene_levels(found: Prepared) -> np.ndarray:
    """Percentiles of a camera's noise-free signal in every color, from all pixels [electrons]."""
    mean = ablation.mean_raw(found)
    planes = mean if mean.ndim == 3 else mean[None]
    block = np.array(found.mosaic.block)
    if mean.ndim == 3 or block.shape[0] > mean.shape[0] or block.shape[1] > mean.shape[1]:
        return np.array([np.percentile(plane, PERCENTILES) for plane in planes]).ravel()
    names = np.tile(block, [-(-n // b) for n, b in zip(mean.shape, block.shape, strict=True)])
    names = names[: mean.shape[0], : mean.shape[1]]
    return np.array(
        [np.percentile(mean[names == color], PERCENTILES) for color in np.unique(names)]
    ).ravel()


def _variance_lost(auto: Prepared, found: Prepared, scope: str, levels: np.ndarray) -> float:
    """At the percentiles of the scene's own signal, with the dark signal that each has."""
    worst = 0.0
    time = auto.exposure_time
    missing = (found.dark_rate - auto.dark_rate) * time
    for level in levels:
        everything = _variance(found, scope, level, found.dark_rate * time)
        own = _variance(auto, scope, max(0.0, level - missing), auto.dark_rate * time)
        if everything:
            worst = max(worst, abs(own - everything) / everything)
    return worst


def _variance(ready: Prepared, scope: str, level: float, dark: float) -> float:
    """Of pixels that are read as one, of their mean [electrons squared]."""
    draws = [e for e in ready.plan.active if isinstance(e, NoiseSource) and e.scope == scope]
    return sum(e.binned_variance(level, dark, ready.camera.array.binning) for e in draws)


@dataclass(frozen=True)
class Estimate:
    """One effect of one camera."""

    name: str
    predicted: float
    measured: float

    @property
    def ratio(self) -> float:
        """Never below 0.9, at most 10; nothing predicted and nothing measured agree."""
        if self.measured == 0:
            return 1.0 if self.predicted == 0 else math.inf
        return self.predicted / self.measured


NOTHING = 1e-9
"""Of full signal: what is below both ways is rounding."""


def estimates(camera: Camera, true: Truth) -> list[Estimate]:
    """The plan's contribution of every effect at standard, beside its ablation."""
    auto = true.auto["standard"]
    names = tuple(ablation.wanted_effects(camera))
    changed = effect_changes(camera, true.found.exposure_time, names, 2)
    shares = ablation.variance_shares(true.found, true.full, 2)
    out = []
    for d in auto.plan.decisions:
        if d.name not in names:
            continue
        assert d.contribution is not None, d
        measured = shares.get(d.name, float(changed[d.name][0]) / true.full)
        if max(measured, d.contribution) < NOTHING:
            out.append(Estimate(d.name, 0.0, 0.0))
        else:
            out.append(Estimate(d.name, d.contribution, measured))
    return out


COSTLY = tuple(kind.name for kind in ORDER if issubclass(kind, NoiseSource))
"""Effects whose draws cost a tenth of a second each at twelve megapixels."""


def worth_leaving_out(preset: str, true: Truth, shares: dict[str, float]) -> list[tuple[str, bool]]:
    """(effect, whether it is off) of costly ones with an ablation under a tenth of their share.

    Their share is what the promise lets go of a variance: 2 T.
    """
    auto = true.auto[preset]
    limit = 0.1 * 2 * auto.settings.tolerance
    states = {d.name: d.state == "off" for d in auto.plan.decisions}
    return [(n, states[n]) for n in COSTLY if n in shares and shares[n] < limit]


def idle_work(camera: Camera) -> list[tuple[str, bool]]:
    """(work, whether it is not done) of what this camera does not call for, after a frame."""
    result = simulate(camera)
    _ = result.render, result.metrics
    out = []
    if not camera.quality:
        out.append(("ideal image", "ideal" not in result.stages.seconds))
        out.append(("metrics", "quality" not in result.stages.seconds))
    if not camera.array.mosaic:
        steps = [step.name for step in camera.processing]
        out.append(("demosaic", "demosaic" not in steps))
        out.append(("white balance", "white_balance" not in steps))
    return out


def seconds(camera: Camera) -> tuple[float, float]:
    """Processor time of a frame with its render: auto at standard, all at reference, medians.

    Every frame forms its own light.
    """
    everything = ablation.with_effects(at_preset(camera, "reference"), "all")
    return _timed(camera), _timed(everything)


def _timed(camera: Camera) -> float:
    runs: list[float] = []
    while not is_median_known(runs):
        start = time.process_time()
        _ = simulate(camera, shared=Shared()).render
        runs.append(time.process_time() - start)
    return statistics.median(runs)
