"""Is the photosignal right? Photons one by one, where the thesis had a laboratory.

Section 2.4 of T. Chen, PhD thesis, Stanford University, 2003, compares the simulator with a
photodiode of 4 x 4 um, n+ in p-substrate, in a 0.18 um process, behind color filters at several
intensities, and shows a histogram of the errors in percent (Fig 2.19). Here the measurement is a
Monte Carlo: photons are drawn from the lamp's spectrum through the filter, absorbed at a depth of
Exp(absorption), and each minority carrier walks at random until it is collected or lost. Nothing of
it comes from the equations that it checks: the lamp is CIE's formula and not a table, the cone of
light is eq 2.18 written out, and of silicon there is only its measured absorption.

Run as a script this file prints the histogram.
"""

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from making import LIGHT, PLANCK, camera

import vcam_cli
from vcam_cli import simulate
from vcam_cli.camera.derived.junction import depths as junction_depths
from vcam_cli.camera.derived.process import Need

pytestmark = pytest.mark.long

UM = 1e-6

# The photodiode in the shipped technology of 0.18 um, written out: depth of the junction 0.103 um,
# neutral depth 2.57 um. The depletion region, 0.1436 um, is permittivity over the mean junction
# capacitance: MOSIS run T16X, 0.9925 fF/um2 at no bias with 0.727 V and 0.357, from 0.53 to 1.65 V.
SIDE = 4 * UM
X1, X2, X3 = 0.103 * UM, 0.2466 * UM, 2.8166 * UM

FILTERS = {
    "blue": ((380, 0.0), (420, 0.75), (470, 0.80), (520, 0.1), (560, 0.0), (780, 0.0)),
    "green": ((380, 0.0), (470, 0.0), (510, 0.6), (550, 0.85), (590, 0.4), (620, 0), (780, 0)),
    "yellow": ((380, 0.0), (480, 0.02), (520, 0.8), (600, 0.9), (680, 0.9), (700, 0), (780, 0)),
    "red": ((380, 0.0), (570, 0.0), (600, 0.7), (650, 0.9), (690, 0.8), (720, 0.0), (780, 0.0)),
    "clear": ((380, 0.9), (680, 0.9), (700, 0.0), (780, 0.0)),
}
"""Wavelength [nm], transmittance; straight between."""
ELECTRONS = (4e5, 8e5, 1.6e6)
"""Collected at three intensities, about: standard errors of 0.16, 0.11 and 0.08 %."""
START, STOP = 380e-9, 780e-9
F_NUMBER, FOCAL_LENGTH, DISTANCE, TIME = 4.0, 5e-3, 1.0, 0.1
LARGEST = 1.0  # [%], of all errors


# --- the measurement ----------------------------------------------------------------------------


def tungsten(wavelength):
    """CIE standard illuminant A by its definition, relative power; CIE 015:2004, section 3.1."""
    nm = wavelength * 1e9

    def planck(nm):
        return nm**-5.0 / np.expm1(1.435e7 / (2848 * nm))

    return planck(nm) / planck(560.0)


STEP = 0.1e-9
WAVELENGTH = np.arange(START + STEP / 2, STOP, STEP)
"""Centers of 4000 steps: fine against lamp, filters and absorption, whose corners lie between."""
_TABLE = Path(vcam_cli.__file__).parent / "data" / "silicon-absorption.csv"
_NM, _PER_CM = np.loadtxt(_TABLE, delimiter=",", skiprows=4).T
ABSORPTION = 100 * np.exp(np.interp(WAVELENGTH * 1e9, _NM, np.log(_PER_CM)))
"""Of silicon at WAVELENGTH [1/m], its logarithm straight between the measured ones."""


def photons(color, radiance):
    """Expected photons on the photodiode during the exposure, in every step of WAVELENGTH.

    radiance: of the scene from START to STOP [W / (sr m2)].
    """
    lamp = tungsten(WAVELENGTH)
    nm, transmittance = np.array(FILTERS[color]).T
    power = radiance * lamp / lamp.sum() * np.interp(WAVELENGTH * 1e9, nm, transmittance)
    working = F_NUMBER * DISTANCE / (DISTANCE - FOCAL_LENGTH)
    cone = math.pi / (1 + 4 * working**2)
    return power * cone * SIDE**2 * TIME * WAVELENGTH / (PLANCK * LIGHT)


def depths(color, radiance, rng):
    """Where the photons of one exposure are absorbed [m]; how many there are is chance, too."""
    counts = rng.poisson(photons(color, radiance))
    return rng.standard_exponential(counts.sum()) / np.repeat(ABSORPTION, counts)


def walks(start, low, high, rng):
    """Random walks from start until they leave low..high: how many leave at the high end.

    Walk on spheres: from any place a Brownian path leaves the largest interval around it that fits
    in through either end with the same chance, and one of them is the way out. Exact, and half of
    the walks end in every step.
    """
    place, out = np.asarray(start), 0
    while place.size:
        near_high = high - place < place - low
        step = np.where(near_high, high - place, place - low)
        up = rng.random(place.size) < 0.5
        out += np.count_nonzero(near_high & up)
        place = (place + np.where(up, step, -step))[near_high != up]
    return out


def measured(color, radiance, rng):
    """Electrons collected in one exposure, photon by photon.

    Born above the junction: walk between the surface, where they are lost, and its edge. In the
    depletion region: swept away and collected. Below: between its edge and x3, where they are lost.
    """
    depth = depths(color, radiance, rng)
    above = walks(depth[depth < X1], 0.0, X1, rng)
    inside = np.count_nonzero((depth >= X1) & (depth <= X2))
    below = depth[(depth > X2) & (depth < X3)]
    return above + inside + below.size - walks(below, X2, X3, rng)


# --- the simulation -----------------------------------------------------------------------------


def photographed(folder, color, radiance, **junction):
    """A small camera that sees a white wall; `junction` changes its technology's."""
    return camera(
        folder,
        {
            "scene.illuminant": "A",
            "scene.radiance": f"{radiance!r} W/(sr m2)",
            "scene.wavelengths": {"start": "380 nm", "stop": "780 nm"},
            "optics.transmittance": {"table": dict(FILTERS[color])},
            "pixel.technology": {"from": "cmos-0.18um", "quantum_efficiency_scale": 1},
            "pixel.photodetector": {"width": "4 um", "height": "4 um", "junction": junction},
            "pixel.readout": {},
            "exposure.time": f"{TIME} s",
            "array": {"rows": 3, "columns": 3, "pattern": "monochrome"},
            "effects": {"dark_current": "off"},
        },
    )


def predicted(folder, color, radiance, **junction):
    """Mean electrons of the middle pixel, before its well is full."""
    made = photographed(folder, color, radiance, **junction)
    return float(simulate(made).mean_electrons[1, 1])


# --- the comparison -----------------------------------------------------------------------------


class Point(NamedTuple):
    """One filter at one intensity."""

    color: str
    predicted: float
    measured: int

    @property
    def error(self) -> float:
        """Of the prediction [%]."""
        return 100 * (self.predicted / self.measured - 1)

    @property
    def standard_error(self) -> float:
        """Of the count [%]: a Poisson number, as photons and their fates are independent."""
        return 100 / math.sqrt(self.measured)


def compare(folder) -> list[Point]:
    """Five filters at three intensities."""
    rng = np.random.default_rng(20030601)
    points = []
    for color in FILTERS:
        per_radiance = predicted(folder, color, 0.01) / 0.01
        for electrons in ELECTRONS:
            radiance = electrons / per_radiance
            signal = predicted(folder, color, radiance)
            points.append(Point(color, signal, measured(color, radiance, rng)))
    return points


BINS = np.linspace(-LARGEST, LARGEST, 9)


def histogram(points: list[Point]) -> str:
    """The errors as text, a row for each bin and a sign for each point, like Fig 2.19."""
    counts, _ = np.histogram([point.error for point in points], BINS)
    bins = zip(BINS[:-1], BINS[1:], counts, strict=True)
    return "\n".join(f"{low:+.2f} .. {high:+.2f} %  {'#' * n}" for low, high, n in bins)


@pytest.fixture(scope="module")
def points(tmp_path_factory):
    return compare(tmp_path_factory.mktemp("photodiode"))


def test_every_point_is_within_one_percent(points):
    """At 4e5 electrons 1 % is 6.3 standard errors of the count, at 1.6e6 it is 12.6."""
    assert len(points) == len(FILTERS) * len(ELECTRONS) == 15
    assert min(point.measured for point in points) > 1e5
    assert max(abs(point.error) for point in points) < LARGEST
    assert max(point.standard_error for point in points) < LARGEST / 6


def test_the_errors_are_those_of_counting(points):
    """Fig 2.19: centered on 0, no wider and no narrower than chance makes them, no color apart."""
    deviates = np.array([point.error / point.standard_error for point in points])
    assert np.abs(deviates).max() < 4
    # the sum of 15 squared normal numbers is 3.5 to 37 in 998 of 1000 cases
    assert 3.5 < np.sum(deviates**2) < 37
    assert abs(deviates.mean()) < 5 / math.sqrt(15)
    for color in FILTERS:
        own = deviates[[point.color == color for point in points]]
        assert abs(own.mean()) < 5 / math.sqrt(3), color
    counts, _ = np.histogram([point.error for point in points], BINS)
    assert counts.sum() == 15, "all but one within half a percent"
    assert counts[2:6].sum() >= 14, "all but one within half a percent"


def test_the_measurement_would_see_a_wrong_photodiode(points, tmp_path):
    """A surface that loses nothing is 9 % more signal in blue; the count tells."""
    right = predicted(tmp_path, "blue", 0.01)
    wrong = predicted(tmp_path, "blue", 0.01, depth="1e-6 um")
    for point in points:
        if point.color == "blue":
            mistaken = point._replace(predicted=point.predicted * wrong / right)
            assert mistaken.error > 5 * LARGEST


@pytest.mark.parametrize("start", [0.1, 0.5, 0.77])
def test_a_random_walk_leaves_by_the_ends_in_proportion(start):
    """Without drift the chance of the high end is the distance from the low one."""
    n = 100_000
    out = walks(np.full(n, start), 0.0, 1.0, np.random.default_rng(7))
    assert out / n == pytest.approx(start, abs=5 * math.sqrt(start * (1 - start) / n))


def test_light_is_absorbed_in_the_measured_depth():
    """Half of red light of 600 to 690 nm within 1.7 to 3.4 um: ln 2 over 4175 to 2040 per cm."""
    depth = depths("red", 1e-4, np.random.default_rng(3))
    assert math.log(2) / 4175e2 < np.median(depth) < math.log(2) / 2040e2


def test_the_photodiode_is_that_of_the_technology(tmp_path):
    """The numbers at the top are rounded to 0.05 nm."""
    taken = photographed(tmp_path, "clear", 0.01)
    found = junction_depths(taken, Need("pixel", "the photodiode"))
    np.testing.assert_allclose([found.x1, found.x2, found.x3], [X1, X2, X3], rtol=2e-4)
    # by Simpson's rule over the bias
    bias = np.array([0.53, 1.09, 1.65])
    per_area = 0.9925e-3 * (1 + bias / 0.727) ** -0.357 @ np.array([1, 4, 1]) / 6
    assert 11.7 * 8.8541878e-12 / per_area == pytest.approx(X2 - X1, rel=2e-3)


def test_the_histogram_shows_every_point(points):
    text = histogram(points)
    assert text.count("#") == 15
    assert len(text.splitlines()) == len(BINS) - 1


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        found = compare(Path(made))
    for point in found:
        error = f"{point.error:+.3f} +- {point.standard_error:.3f} %"
        print(f"{point.color:7} {point.measured:8} e  {error}")
    print(histogram(found))
