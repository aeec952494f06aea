"""The closed forms beside the measurement, against sums and draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from making import LIGHT, PLANCK, camera

from vcam_cli.characterization import datasheet
from vcam_cli.characterization.bench import prepare_bench
from vcam_cli.characterization.closed_form import clipped_variance, saturation_capacity
from vcam_cli.progress import Stages


def test_variance_of_a_clipped_normal():
    """Against a sum over its density; without a limit it is the plain variance."""
    z = np.linspace(-9, 9, 200001)
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) * (z[1] - z[0])
    for mean in (80.0, 95.0, 100.0, 130.0):
        x = np.minimum(mean + 10 * z, 100.0)
        expected = density @ x**2 - (density @ x) ** 2
        assert float(clipped_variance(mean, 10.0, 100.0)) == pytest.approx(expected, rel=1e-6)
    assert float(clipped_variance(5.0, 10.0, 1e6)) == pytest.approx(100)


def test_saturation_point_of_drawn_frames():
    """The largest variance of pairs of 250,000 draws, unequal wells included: to 0.5 %."""
    rng = np.random.default_rng(4)
    pixel = rng.standard_normal(1 << 18)
    levels = np.linspace(8500, 10000, 41)
    variance = []
    for level in levels:
        mean = level * (1 + 0.01 * pixel)
        frames = mean + np.sqrt(mean + 25) * rng.standard_normal((2, pixel.size))
        variance.append(np.mean(np.diff(np.minimum(frames, 10000), axis=0) ** 2) / 2)
    found = saturation_capacity(10000, 0, 25, lambda m: (0.01 * m) ** 2)
    best = np.polyfit(levels, variance, 6)
    assert found == pytest.approx(levels[np.argmax(np.polyval(best, levels))], rel=0.005)


@pytest.mark.parametrize("pattern", ["monochrome", "bayer-rggb"])
def test_responsivity_is_that_of_data_sheets(pattern, tmp_path):
    """V/(lx s) at the sensor: K Q A / (683 V h c / lambda), summed over the light of A."""
    import colour

    made = {
        "array.pattern": pattern,
        "optics.transmittance": 0.8,  # light is measured behind the lens
        "scene.illuminant": "D65",
        "pixel.readout.gain": 0.9,
        **({"array.filters": {"R": 0.2, "G": 0.5, "B": 0.1}} if pattern != "monochrome" else {}),
    }
    bench = prepare_bench(camera(tmp_path, made), 1, Stages())
    grid = np.arange(380.0, 781.0)
    efficacy = colour.SDS_LEFS["CIE 1924 Photopic Standard Observer"][grid]
    lamp = colour.SDS_ILLUMINANTS["A"].copy().interpolate(colour.SpectralShape(380, 780, 1))[grid]
    per_joule = grid * 1e-9 / (PLANCK * LIGHT)
    filters = {"Y": 1.0, "R": 0.2, "G": 0.5, "B": 0.1}
    for color in bench.ready.mosaic.colors:
        seen = 20e-6 * 0.9 * 0.25 * filters[color] * 25e-12  # volts for electrons, Q, area
        lumens = 683.002 * np.trapezoid(lamp * efficacy)
        a = seen * np.trapezoid(lamp * per_joule) / lumens
        green = seen * per_joule[170] / (683.002 * efficacy[170])
        transfer = SimpleNamespace(quantum_efficiency=0.5 * bench.efficiency(color))
        rows = datasheet._photometric_rows(bench, SimpleNamespace(color=color, transfer=transfer))
        found = {name: (measured, expected, unit) for name, measured, expected, unit, _ in rows}
        for name, value in (("responsivity_a", a), ("responsivity_green", green)):
            measured, expected, unit = found[name]
            assert unit == "V/(lx s)"
            assert expected == pytest.approx(value, rel=2e-3)  # tables of 1 and of 5 nm
            assert measured == pytest.approx(expected / 2)


def test_photons_of_a_luminous_exposure(tmp_path):
    """Monochromatic light of 550 nm: A / (683 lm/W V h c / lambda), with the CIE's V(550 nm)."""
    bench = prepare_bench(camera(tmp_path, {}), 1, Stages())
    energy = PLANCK * LIGHT / 550e-9
    expected = 25e-12 / (683.002 * 0.9949501 * energy)
    assert bench.photons_per_exposure == pytest.approx(expected, rel=1e-4)
