"""Figures the camera must reach, from a camera file to electrons, against closed forms.

Everything expected is worked out here: constants, cone, lamp (from the shipped tables of D65 and
V(lambda)), transfer functions. A tolerance that is a figure the camera has to reach is named so;
the engine does better, and a tighter bound beside it says by how much.
"""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from making import GONE, LIGHT, PLANCK, QUIET, camera, radiance_for

import vcam_cli
from vcam_cli import simulate

DATA = Path(vcam_cli.__file__).parent / "data"
WAVELENGTH = np.linspace(380e-9, 780e-9, 4001)  # knots of all tables are on whole nanometers
STANDARD = {"accuracy": "standard", "effects": QUIET}
LEVEL_FIGURE, MODULATION_FIGURE, FALLOFF_FIGURE = 2e-3, 4e-3, 3e-3


def column(file: str, name: str) -> np.ndarray:
    """A column of a shipped table, piecewise linear, on WAVELENGTH."""
    lines = (DATA / file).read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    known = [r for r in rows if r[name]]
    nodes = [float(r["wavelength_nm"]) * 1e-9 for r in known]
    return np.interp(WAVELENGTH, nodes, [float(r[name]) for r in known])


def integral(values: np.ndarray) -> float:
    return float(np.trapezoid(values, WAVELENGTH))


def cone(f_number: float, focal_length: float, distance: float) -> float:
    """Irradiance per radiance on the axis, eqs 2.15 and 2.18."""
    one_minus_m = 1.0 if math.isinf(distance) else distance / (distance - focal_length)
    return math.pi / (1 + 4 * (f_number * one_minus_m) ** 2)


def uniform(folder, **changes) -> float:
    """Mean electrons of a uniform scene, the same in every pixel."""
    keys = {k.replace("__", "."): v for k, v in changes.items()}
    mean = simulate(camera(folder, STANDARD | keys)).mean_electrons
    assert np.ptp(mean) <= 1e-6 * mean.max()  # 32 bits
    return float(mean.mean(dtype=float))


# --- level of light ------------------------------------------------------------------------------

LUMEN = 683.0  # lm/W at the top of V(lambda), to 3e-6 of the SI's K_cd at 540 THz


@pytest.mark.parametrize("nanometers", [450.0, 550.0, 555.0, 632.8])
@pytest.mark.parametrize("given", ["radiance", "luminance", "illuminance"])
def test_monochromatic_light(nanometers, given, tmp_path):
    visible = float(np.interp(nanometers * 1e-9, WAVELENGTH, column("cie-1931-2-degree.csv", "y")))
    stated, radiance = {
        "radiance": ("0.1 W/(sr m2)", 0.1),
        "luminance": ("50 cd/m2", 50 / (LUMEN * visible)),
        "illuminance": ("157 lx", 157 / math.pi / (LUMEN * visible)),
    }[given]
    photons = radiance * nanometers * 1e-9 / (PLANCK * LIGHT)
    # half of 25 um2, half of the photons counted, 18 % reflected, 10 ms
    expected = photons * cone(4, 5e-3, 1) * 12.5e-12 * 0.5 * 0.18 * 0.01
    level = {"scene__radiance": GONE, f"scene__{given}": stated}
    lamp = {"monochromatic": f"{nanometers} nm"}
    found = uniform(tmp_path, **level, scene__illuminant=lamp, scene__source__reflectance=0.18)
    assert found == pytest.approx(expected, rel=LEVEL_FIGURE)
    assert found == pytest.approx(expected, rel=1e-5)  # 32 bits, and 683 against 683.002


DAY = {
    "scene__radiance": GONE,
    "scene__luminance": "100 cd/m2",
    "scene__illuminant": "D65",
    "scene__source__reflectance": 0.5,
}


def daylight_electrons(response: np.ndarray, **lens: float) -> float:
    lamp = column("illuminants.csv", "D65")
    scale = 100 / (LUMEN * integral(lamp * column("cie-1931-2-degree.csv", "y")))
    photons = scale * integral(lamp * response * WAVELENGTH / (PLANCK * LIGHT))
    place = {"f_number": 4.0, "focal_length": 5e-3, "distance": 1.0} | lens
    return photons * cone(**place) * 12.5e-12 * 0.5 * 0.01


def test_daylight(tmp_path):
    """D65 at 100 cd/m2, half reflected, half counted. The trapezoids here are good to 1e-6."""
    expected = daylight_electrons(np.full_like(WAVELENGTH, 0.5))
    found = uniform(tmp_path, **DAY)
    assert found == pytest.approx(expected, rel=LEVEL_FIGURE)
    assert found == pytest.approx(expected, rel=1e-5)


def test_daylight_through_glass_and_a_narrow_filter(tmp_path):
    """A triangle 40 nm wide at 610 nm, where no step of the engine's wavelengths falls on it."""
    triangle = {596: 0.0, 613: 0.9, 636: 0.0}
    table = {"table": triangle, "outside": "zero"}
    response = 0.5 * 0.9 * np.interp(WAVELENGTH * 1e9, list(triangle), list(triangle.values()))
    found = uniform(tmp_path, **DAY, optics__transmittance=[0.9, table])
    assert found == pytest.approx(daylight_electrons(response), rel=LEVEL_FIGURE)
    assert found == pytest.approx(daylight_electrons(response), rel=1e-5)


@pytest.mark.parametrize("distance", ["6 mm", "10 mm", "1 m", "1 km", "infinity"])
@pytest.mark.parametrize("f_number", [0.8, 4, 22])
def test_lens_and_distance(f_number, distance, tmp_path):
    """Close to the focal length the cone closes: 1 - m is 6 at 6 mm, 2 at 10 mm, 1 at infinity."""
    meters = {"6 mm": 6e-3, "10 mm": 1e-2, "1 m": 1.0, "1 km": 1e3, "infinity": math.inf}[distance]
    found = uniform(tmp_path, **DAY, optics__f_number=f_number, scene__distance=distance)
    response = np.full_like(WAVELENGTH, 0.5)
    expected = daylight_electrons(response, f_number=float(f_number), distance=meters)
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "factor"),
    [
        ({"scene__luminance": "1000000 cd/m2"}, 1e4),
        ({"scene__luminance": "300 cd/m2"}, 3),
        ({"scene__luminance": "0.001 cd/m2"}, 1e-5),
        ({"exposure__time": "1/30 s"}, 10 / 3),
        ({"scene__source__reflectance": 0.05}, 0.1),
        ({"pixel__photodetector__fill_factor": 0.125}, 0.25),
        ({"pixel__photodetector__quantum_efficiency": 1.0}, 2),
        ({"pixel__photodetector__quantum_efficiency": {"pixel": 0.25}}, 1),
        ({"pixel__width": "10 um"}, 4),
        ({"pixel__width": "10 um", "pixel__height": "5 um"}, 2),
        ({"pixel__gap_x": "5 um"}, 1),
        ({"optics__transmittance": 0.9}, 0.9),
        ({"optics__transmittance": [0.9, 0.5]}, 0.45),
        ({"array__rows": 7, "array__columns": 13}, 1),
        ({"optics__diffraction": False}, 1),
    ],
)
def test_electrons_go_with_light_time_and_area(change, factor, tmp_path):
    """Ratios to one camera; 1e-6 is what 32 bits leave."""
    ratio = uniform(tmp_path, **(DAY | change)) / uniform(tmp_path, **DAY)
    assert ratio == pytest.approx(factor, rel=1e-6)


# --- modulation ----------------------------------------------------------------------------------

FREQUENCIES = (20e3, 50e3, 90e3, 130e3)  # the last beyond the pixels' 100 lp/mm: folded
DETECTOR = {
    "pixel.photodetector": {
        "width": "4 um",
        "height": "2.5 um",
        "x": "0.3 um",
        "y": "0.7 um",
        "quantum_efficiency": 0.5,
    }
}


def diffraction(frequency: float, wavelength, f_number: float = 4.0):
    """Incoherent OTF of a circular pupil, at 1 m with 5 mm."""
    nu = np.minimum(frequency * np.asarray(wavelength) * f_number / (1 - 5e-3), 1)
    return 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))


def aperture(frequency: float, angle: float) -> float:
    along_x, along_y = frequency * math.cos(angle), frequency * math.sin(angle)
    return float(np.sinc(along_x * 4e-6) * np.sinc(along_y * 2.5e-6))


def modulation(mean: np.ndarray, frequency: float, angle: float) -> float:
    """Amplitude over mean of the wave in it, by least squares."""
    rows, columns = mean.shape
    x = (np.arange(columns) + 0.5 - columns / 2) * 5e-6
    y = (np.arange(rows) + 0.5 - rows / 2) * 5e-6
    turn = 2 * np.pi * frequency * (x * math.cos(angle) - y[:, None] * math.sin(angle))
    basis = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=-1).reshape(-1, 3)
    level, cosine, sine = np.linalg.lstsq(basis, mean.ravel().astype(float), rcond=None)[0]
    return float(np.hypot(cosine, sine) / level)


def grating(frequency: float, angle: float) -> dict:
    wave = {
        "kind": "chart",
        "chart": "sinusoid",
        "frequency": f"{frequency / 1e3} lp/mm",
        "contrast": 0.7,
        "mean": 0.5,
        "orientation": f"{math.degrees(angle)!r} deg",
        "phase": "35 deg",
    }
    return STANDARD | DETECTOR | {"scene.source": wave}


ANGLES = pytest.mark.parametrize("degrees", [0, 30, 90])


@ANGLES
@pytest.mark.parametrize("frequency", FREQUENCIES)
@pytest.mark.parametrize("f_number", [4, 11])
def test_modulation_of_one_wavelength(frequency, degrees, f_number, tmp_path):
    """Optics times aperture; at f/11 the cutoff is 164 lp/mm."""
    angle = math.radians(degrees)
    changes = grating(frequency, angle) | {"optics.f_number": f_number}
    found = modulation(simulate(camera(tmp_path, changes)).mean_electrons, frequency, angle)
    lens = float(diffraction(frequency, 550e-9, f_number))
    expected = 0.7 * lens * abs(aperture(frequency, angle))
    assert found == pytest.approx(expected, rel=MODULATION_FIGURE)
    assert found == pytest.approx(expected, rel=2e-4)  # 32 bits, of waves down to 1 % of the mean


@ANGLES
@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_modulation_in_daylight(frequency, degrees, tmp_path):
    """The OTF averaged over the photo-electrons of D65; 10 nm steps are good to 6e-5 of it."""
    angle = math.radians(degrees)
    day = {k.replace("__", "."): v for k, v in DAY.items() if "source" not in k}
    changes = grating(frequency, angle) | day
    found = modulation(simulate(camera(tmp_path, changes)).mean_electrons, frequency, angle)
    weight = column("illuminants.csv", "D65") * WAVELENGTH
    lens = integral(weight * diffraction(frequency, WAVELENGTH)) / integral(weight)
    expected = 0.7 * lens * abs(aperture(frequency, angle))
    assert found == pytest.approx(expected, rel=MODULATION_FIGURE)
    assert found == pytest.approx(expected, rel=5e-4)


# --- falloff -------------------------------------------------------------------------------------


def disk(tangent: float, f_number: float) -> float:
    """Irradiance from a uniform Lambertian disk of diameter 1 / N at distance 1, off its axis.

    integral of cos cos / r^2 over the pupil, by Gauss in the radius and evenly around: 1e-12.
    """
    node, weight = np.polynomial.legendre.leggauss(60)
    radius = (node + 1) / (4 * f_number)
    angle = 2 * np.pi * (np.arange(240) + 0.5) / 240
    u, v = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    density = 1 / (1 + (u - tangent) ** 2 + v**2) ** 2
    return float((weight / (4 * f_number) * radius) @ density.mean(axis=1) * 2 * np.pi)


def falloff(folder, model: str, f_number: float, degrees: float, accuracy: str) -> float:
    """The last pixel of a row over the one in the middle; the last is `degrees` off the axis."""
    focal_length = 32 * 5e-6 / math.tan(math.radians(degrees))
    changes = {
        "array.rows": 1,
        "array.columns": 65,
        "optics": {
            "f_number": f_number,
            "focal_length": f"{focal_length!r} m",
            "off_axis": model,
        },
        "scene.distance": "infinity",
        "effects": QUIET,
        "accuracy": accuracy,
    }
    row = simulate(camera(folder, changes)).mean_electrons[0]
    assert np.argmax(row) == 32
    return float(row[-1]) / float(row[32])


@pytest.mark.parametrize("accuracy", ["standard", "reference"])
@pytest.mark.parametrize("degrees", [10, 30, 45, 60])
@pytest.mark.parametrize("f_number", [1.2, 8])
def test_exact_falloff(f_number, degrees, accuracy, tmp_path):
    """Eq 2.22 by summing the light of the whole pupil; at f/1.2, 45 degrees cos^4 is 18 % below."""
    tangent = math.tan(math.radians(degrees))
    expected = disk(tangent, f_number) / disk(0.0, f_number)
    found = falloff(tmp_path, "exact", f_number, degrees, accuracy)
    assert found == pytest.approx(expected, rel=FALLOFF_FIGURE)
    # 32 bits: a polynomial good to 1e-7 of the center, and 60 degrees are 6 % of it
    assert found == pytest.approx(expected, rel=1e-9 if accuracy == "reference" else 1e-5)


def test_exact_falloff_at_45_degrees_and_f_1_2_as_printed(tmp_path):
    """By its letters, with a = tan^2 theta = 1 / 2.4^2 and b = tan^2 phi = 1."""
    a, b = 1 / 2.4**2, 1.0
    off = 1 - (1 - a + b) / math.sqrt(b**2 + 2 * b * (1 - a) + (1 + a) ** 2)
    on = 1 - (1 - a) / (1 + a)
    found = falloff(tmp_path, "exact", 1.2, 45, "standard")
    assert found == pytest.approx(off / on, rel=FALLOFF_FIGURE)
    assert abs(found / 0.25 - 1) > FALLOFF_FIGURE, "and it is not cos^4"


@pytest.mark.parametrize("degrees", [10, 30, 45, 60])
def test_cos4_falloff(degrees, tmp_path):
    found = falloff(tmp_path, "cos4", 1.2, degrees, "standard")
    assert found == pytest.approx(math.cos(math.radians(degrees)) ** 4, rel=1e-5)


# --- shot noise ----------------------------------------------------------------------------------


@pytest.mark.parametrize("electrons", [3, 50, 2500])
def test_shot_noise(electrons, tmp_path):
    """Mean and variance within five standard errors of 160 000 pixels, in 32 bits.

    sqrt(m / n) for the mean; m sqrt((2 + 1/m) / n) for the variance (Poisson's fourth moment).
    """
    changes = {
        "accuracy": "standard",
        "scene.radiance": radiance_for(electrons),
        "array.rows": 400,
        "array.columns": 400,
    }
    found = simulate(camera(tmp_path, changes)).electrons.astype(float)
    n = found.size
    assert found.mean() == pytest.approx(electrons, abs=5 * math.sqrt(electrons / n))
    spread = 5 * math.sqrt((2 + 1 / electrons) / n)
    assert found.var() == pytest.approx(electrons, rel=spread)
    assert np.array_equal(found, np.rint(found))
    assert found.min() >= 0


def test_few_electrons_are_poisson(tmp_path):
    """Every count from 0 to 9 as often as e^-m m^k / k! says, within five standard errors."""
    changes = {"scene.radiance": radiance_for(3), "array.rows": 400, "array.columns": 400}
    found = simulate(camera(tmp_path, changes)).electrons
    n = found.size
    for k in range(10):
        share = math.exp(-3) * 3**k / math.factorial(k)
        error = math.sqrt(share * (1 - share) / n)
        assert np.mean(found == k) == pytest.approx(share, abs=5 * error)
