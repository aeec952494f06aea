"""Frames of a slanted edge beside those that a camera file with a lens predicts."""

import numpy as np
import pytest
import yaml
from making import camera

from vcam_cli.simulation.simulate import simulate
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import verify

SIZE, FRAMES = 96, 4
CHANGES = {
    "array": {"rows": SIZE, "columns": SIZE, "pattern": "monochrome"},
    "pixel.readout.read_noise": "20 e",
    "pixel.fpn.gain_pixel": "0.5 %",
    "optics.f_number": 11,
    "adc": {"bits": 12, "offset": "40 DN"},
}
QUANTITIES = ("MTF50 [lp/mm]", "MTF at 0.25 c/px [1]", "edge profile, 10% to 90% [px]")


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """Frames of another sensor before an edge of 7 degrees, in more light than the file has."""
    folder = tmp_path_factory.mktemp("edge")
    made = camera(folder, CHANGES)
    chart = {"kind": "chart", "chart": "slanted-edge", "angle": "7 deg", "contrast": 0.7}
    real = made.with_({"scene.source": chart, "scene.radiance": "40 W/(sr m2)", "seed.sensor": 9})
    for n in range(FRAMES):
        np.save(folder / f"edge_{n}.npy", simulate(real.with_({"seed.frame": 40 + n})).dn)
    form = {
        "kind": "measurement",
        "frames": [{"files": "edge_*.npy", "exposure": "10 ms", "target": "slanted-edge"}],
        "levels": {"bits": 12},
        "pixel": {"width": "5 um"},
        "noise_tolerance": "4 %",
    }
    (folder / "bench.yaml").write_text(yaml.safe_dump(form))
    return made, measurement_file.read(folder / "bench.yaml")


@pytest.fixture(scope="module")
def verified(taken):
    return verify(*taken)


def test_the_right_lens_agrees(verified):
    found = verified
    assert tuple(row.quantity for row in found.rows) == QUANTITIES
    assert [row.verdict for row in found.rows] == ["agrees"] * 3
    assert found.rows[0].predicted == pytest.approx(found.rows[0].measured, rel=0.02)


def test_the_measured_sharpness_is_that_of_the_lens(verified):
    """MTF50 of the diffraction at f/11 and 550 nm times the photodetector's sinc, to 3 %."""
    found = verified.rows[0]
    cut_off, side = 1 / (11 * 550e-9), 5e-6 * 0.5**0.5

    def transfer(f):
        v = f / cut_off
        return 2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v**2)) * np.sinc(f * side)

    frequency = np.linspace(1e3, 0.99 * cut_off, 20_000)
    known = frequency[np.argmin(abs(transfer(frequency) - 0.5))]
    assert found.measured == pytest.approx(known * 1e-3, rel=0.03)


def test_a_wrong_lens_is_found(taken):
    made, measurement = taken
    rows = verify(made.with_({"optics.f_number": 16}), measurement).rows
    assert [row.verdict for row in rows] == ["missed"] * 3
