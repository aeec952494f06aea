"""The diffraction OTF against reference values, integrals, limits and properties."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics.diffraction import cutoff_frequency, otf_circular

LAMBDA, N = 550e-9, 2.8
CUTOFF = 1 / (LAMBDA * N)


def otf(shift: float | np.ndarray) -> np.ndarray:
    """At a frequency given as a fraction of the cut-off, exactly: wavelength 1, f-number 1."""
    return otf_circular(shift, 1.0, 1.0)


def reference(shift: float) -> float:
    with mpmath.workdps(40):
        nu = mpmath.mpf(shift)
        return float(2 / mpmath.pi * (mpmath.acos(nu) - nu * mpmath.sqrt(1 - nu**2)))


@pytest.mark.parametrize(
    "shift",
    [1e-300, 1e-9, 0.1, 0.5, 0.87, 0.88, 0.99, 1 - 1e-6, 1 - 1e-10, 1 - 1e-15, 1 - 2**-53],
)
def test_agrees_with_40_digits(shift: float) -> None:
    """A few roundings, also beside the cut-off, where the printed form has no digit left."""
    assert otf(shift) == pytest.approx(reference(shift), rel=3e-15)


def test_closed_forms() -> None:
    assert otf(0.0) == 1
    assert otf(0.5) == pytest.approx(2 / 3 - np.sqrt(3) / (2 * np.pi), rel=1e-15)
    assert otf(1.0) == 0
    assert otf(7.0) == 0
    assert otf(np.inf) == 0
    assert (1 - otf(1e-6)) / 1e-6 == pytest.approx(4 / np.pi, rel=1e-9)  # slope at zero
    beside = 1e-12
    expected = 8 * np.sqrt(2) / (3 * np.pi) * beside**1.5  # leading term at the cut-off
    assert otf(1 - beside) == pytest.approx(expected, rel=1e-4)  # 1 - 1e-12 is rounded to 1e-16


def test_its_volume_is_the_area_of_the_pupil() -> None:
    """The OTF integrates to the peak of the point spread: integral of OTF nu d(nu) = 1/8."""
    node, weight = np.polynomial.legendre.leggauss(400)
    nu = (node + 1) / 2
    # (1 - nu)^1.5 at the end limits Gauss-Legendre to about points^-5
    assert weight / 2 @ (nu * otf(nu)) == pytest.approx(1 / 8, rel=1e-10)


def test_is_the_overlap_of_two_disks() -> None:
    """A sum over 100,000 chords: at height y both disks hold what is within |x| < sqrt(1 - y^2)."""
    half = np.sqrt(1 - ((np.arange(100_000) + 0.5) / 100_000) ** 2)
    for shift in (0.2, 0.6, 0.9):
        overlap = np.maximum(half - shift, 0.0)
        assert otf(shift) == pytest.approx(overlap.sum() / half.sum(), abs=1e-6)


def test_is_the_transform_of_the_airy_disk() -> None:
    """The sampled PSF of a camera, transformed back by a sum over the plane."""
    from scipy.special import j0, j1

    radius = np.arange(0.5, 60000) * LAMBDA * N / 50
    v = np.pi * radius / (LAMBDA * N)
    psf = (2 * j1(v) / v) ** 2
    step = radius[1] - radius[0]
    total = (psf * radius).sum() * step
    for fraction in (0.1, 0.4, 0.8):
        blurred = (psf * j0(2 * np.pi * fraction * CUTOFF * radius) * radius).sum() * step
        # the ring sums stop at 1200 Airy radii: 2/(pi^2 v) of the light, 3e-4, is beyond
        assert otf_circular(fraction * CUTOFF, LAMBDA, N) == pytest.approx(
            blurred / total, abs=1e-3
        )


def test_cutoff_in_known_units() -> None:
    """550 nm at f/2.8 passes up to 649.35 line pairs a millimeter; close-up, half of that."""
    assert cutoff_frequency(LAMBDA, N) == pytest.approx(649350.6, rel=1e-7)
    assert cutoff_frequency(LAMBDA, N, -1.0) == pytest.approx(649350.6 / 2, rel=1e-7)


@given(st.floats(-2e6, 2e6), st.floats(300e-9, 1.1e-6), st.floats(0.7, 64), st.floats(-5, 0))
def test_scales_with_its_cutoff(frequency: float, wavelength: float, n: float, m: float) -> None:
    value = otf_circular(frequency, wavelength, n, m)
    fraction = abs(frequency) / cutoff_frequency(wavelength, n, m)
    assert value == pytest.approx(float(otf(fraction)), abs=1e-14)
    assert value == otf_circular(-frequency, wavelength, n, m)
    assert 0 <= value <= 1


@given(st.floats(0, 1.2), st.floats(0, 1.2))
def test_falls_all_the_way(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert otf(high) <= otf(low) * (1 + 1e-15)


def test_broadcasts() -> None:
    values = otf_circular(np.linspace(0, CUTOFF, 5)[:, None], np.array([450e-9, LAMBDA]), N)
    assert values.shape == (5, 2)
    assert values[-1, 1] == pytest.approx(0, abs=1e-20)
    assert values[-1, 0] > 0.05
    assert np.isnan(otf_circular(np.nan, LAMBDA, N)), "a NaN must not become darkness"
