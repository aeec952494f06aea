"""A small camera of even light: its electrons have a closed form."""

from __future__ import annotations

import tempfile
from pathlib import Path

import mpmath as mp

from vcam_cli import load, simulate

CAMERA = """
name: small
scene:
  source: {kind: chart, chart: uniform}
  illuminant: {monochromatic: 550 nm}
  radiance: 0.1 W/(sr m2)
  distance: 1 m
optics: {f_number: 4, focal_length: 5 mm, transmittance: 1, off_axis: none}
pixel:
  width: 5 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.5}
  readout: {conversion_gain: 20 uV/e, full_well: 100 ke}
array: {rows: 4, columns: 4, pattern: monochrome}
exposure: {time: 10 ms}
adc: {bits: 12, offset: 0 DN}
processing: []
effects: {shot_noise: off, fpn: off, reset_noise: off, read_noise: off}
accuracy: reference
"""


def simulated(*sets: str):
    """The result of the camera with some keys set, as on the command line."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "small.yaml"
        path.write_text(CAMERA, encoding="utf-8")
        return simulate(load(path, list(sets)))


def electrons() -> mp.mpf:
    """What each of its pixels collects: eqs 2.15 and 2.18, photons of 550 nm, half of them seen."""
    planck, light = mp.mpf("6.62607015e-34"), mp.mpf(299792458)
    magnification = -mp.mpf("0.005") / (1 - mp.mpf("0.005"))
    cone = mp.pi / (1 + 4 * (4 * (1 - magnification)) ** 2)
    per_second = mp.mpf("0.1") * cone * mp.mpf("550e-9") / (planck * light) * mp.mpf("25e-12")
    return per_second * mp.mpf("0.01") / 4
