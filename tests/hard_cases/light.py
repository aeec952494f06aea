"""Hard cases of light: magnification, cones, falloff, diffraction, aberrations, spectra."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np

from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.physics import aberration, diffraction, radiometry, vignetting, zernike
from vcam_cli.spectra import Spectrum, integral

from .hard_case import Case, in_digits, pairs

FEW = "some ten roundings of 1.1e-16"

# --- eq 2.15 and 2.17 ----------------------------------------------------------------------------

FOCAL = 0.005
FAR_AWAY = 10.0 ** np.arange(0, 15)


def _magnification_by_image_distance() -> np.ndarray:
    image = 1 / (1 / FOCAL - 1 / FAR_AWAY)
    return 1 - image / FOCAL


MAGNIFICATION = Case(
    "2.15 magnification of what is far away",
    "the image distance differs from f in the last digits only, up to 1e14 m away",
    "50 digits",
    lambda: in_digits(lambda s: -mp.mpf(FOCAL) / (s - mp.mpf(FOCAL)), FAR_AWAY),
    lambda: radiometry.magnification(FOCAL, FAR_AWAY),
    _magnification_by_image_distance,
    "1/s_i = 1/f - 1/s_o, then m = 1 - s_i/f",
    1e-15,
    FEW,
)

SINES = 1 - 2.0 ** -np.arange(10, 51, 5)

APERTURE = Case(
    "2.17 f-number of a cone near 90 degrees",
    "1 - sin^2 of a sine that is almost 1",
    "50 digits",
    lambda: in_digits(lambda s: mp.sqrt(1 - s * s) / (2 * s), SINES),
    lambda: radiometry.f_number_of_numerical_aperture(SINES),
    lambda: np.sqrt(1 - SINES**2) / (2 * SINES),
    "sqrt(1 - s^2) / (2 s)",
    1e-15,
    FEW,
)

# --- eq 2.22 -------------------------------------------------------------------------------------


def _falloff_exact(a: mp.mpf, b: mp.mpf) -> mp.mpf:
    with mp.workdps(120):
        tilt = 1 - a + b
        return (1 - tilt / mp.sqrt(tilt**2 + 4 * a)) / 2 * (1 + a) / a


def _falloff_printed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    tilt = 1 - a + b
    return (1 - tilt / np.sqrt(tilt**2 + 4 * a)) / 2 * (1 + a) / a


CONES, ANGLES = pairs(10.0 ** np.arange(-30, 9, 2), np.tan(np.radians([1e-6, 5, 40, 85])) ** 2)
ON_AXIS = 10.0 ** np.arange(-30, 9, 2)

FALLOFF = Case(
    "2.22 relative illumination, small apertures",
    "1 - A/B cancels: at f/1e6 nothing is left; tan^2 of the cone from 1e-30 to 1e8",
    "the printed form, 120 digits",
    lambda: in_digits(_falloff_exact, CONES, ANGLES),
    lambda: radiometry.relative_illumination_exact(CONES, ANGLES),
    lambda: _falloff_printed(CONES, ANGLES),
    "as printed: (1 - A/B)/2 over sin^2",
    2e-15,
    FEW,
)

FALLOFF_ON_AXIS = Case(
    "2.22 relative illumination, on the axis",
    "must be 1 at every aperture",
    "exactly 1",
    lambda: np.ones(ON_AXIS.size),
    lambda: radiometry.relative_illumination_exact(ON_AXIS, 0.0),
    lambda: _falloff_printed(ON_AXIS, np.zeros(ON_AXIS.size)),
    "as printed: (1 - A/B)/2 over sin^2",
    1e-15,
    FEW,
)

# --- diffraction ---------------------------------------------------------------------------------

NEAR_CUTOFF = 1 - 2.0 ** -np.arange(4, 53, 4)  # exact: at wavelength 1 and f/1 the cut-off is 1
BEYOND = np.array([1.0, 1 + 2.0**-52, 1.5, 1e6, 1e300])


def _otf_textbook(shift: np.ndarray) -> np.ndarray:
    return 2 / np.pi * (np.arccos(shift) - shift * np.sqrt(1 - shift**2))


OTF_NEAR = Case(
    "OTF of a circular pupil, up to its cut-off",
    "falls as (1 - nu)^1.5: acos and nu sqrt(1 - nu^2) become equal",
    "the textbook form",
    lambda: in_digits(lambda v: 2 / mp.pi * (mp.acos(v) - v * mp.sqrt(1 - v * v)), NEAR_CUTOFF),
    lambda: diffraction.otf_circular(NEAR_CUTOFF, 1.0, 1.0),
    lambda: _otf_textbook(NEAR_CUTOFF),
    "2/pi (acos nu - nu sqrt(1 - nu^2))",
    2e-15,
    FEW,
)

OTF_BEYOND = Case(
    "OTF of a circular pupil, at and beyond cut-off",
    "nothing passes: exactly 0, and no square root of a negative number",
    "exactly 0",
    lambda: np.zeros(BEYOND.size),
    lambda: diffraction.otf_circular(BEYOND, 1.0, 1.0),
    lambda: _otf_textbook(BEYOND),
    "2/pi (acos nu - nu sqrt(1 - nu^2))",
    0.0,
    "a property",
)

WIDTH = 4e-6
LOW = np.array([0.0, 1e-300, 1e-9, 1.0, 5e4])

SINC = Case(
    "2.23 transfer of the pixel at frequency 0",
    "sin(x)/x where x is 0",
    "50 digits",
    lambda: in_digits(lambda f: mp.sincpi(f * mp.mpf(WIDTH)), LOW),
    lambda: PixelAperture(WIDTH, WIDTH).along_x(LOW),
    lambda: np.sin(np.pi * LOW * WIDTH) / (np.pi * LOW * WIDTH),
    "sin(pi f w) / (pi f w)",
    1e-15,
    FEW,
)

# --- pixel vignetting ----------------------------------------------------------------------------

CONE, DEPTH, SIDE = 0.1, 4e-6, 4e-6
CHIEF = np.array([0.5, 0.9, 1.0, 1.09, 1.0999, 1.099999])  # light vanishes at 1.1 = w/t + cone
TUNNEL = [(DEPTH, 1.0)]  # filled with air: no reflection, no refraction, a closed form


def _part_along(x: mp.mpf, half: mp.mpf) -> mp.mpf:
    """Integral over y = -half .. half of (1 - t |y| / h) / (1 + x^2 + y^2)^2."""
    k, top = 1 + x * x, min(half, mp.mpf(SIDE) / mp.mpf(DEPTH))
    whole = top / (k * (k + top**2)) + mp.atan(top / mp.sqrt(k)) / k ** mp.mpf(1.5)
    return whole - mp.mpf(DEPTH) / mp.mpf(SIDE) * (1 / k - 1 / (k + top**2))


def _sliver(chief: mp.mpf) -> mp.mpf:
    """Light that reaches the bottom, chord by chord of the pupil, over all that comes in."""
    cone, end = mp.mpf(CONE), mp.mpf(SIDE) / mp.mpf(DEPTH)

    def chord(x: mp.mpf) -> mp.mpf:
        half = mp.sqrt(cone**2 - (x - chief) ** 2)
        return (1 - x / end) * _part_along(x, half)

    lit = mp.quad(chord, [chief - cone, min(chief + cone, end)])
    a, b = cone**2, chief**2
    return lit / (mp.pi * a / (1 + a) * _falloff_exact(a, b))


def _by_rays() -> list[float]:
    """64 x 64 rays, evenly over the square around the pupil."""
    at = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(CONE * at, CONE * at)
    inside = x**2 + y**2 < CONE**2
    found = []
    for chief in CHIEF:
        tx, ty = (chief + x)[inside], y[inside]
        light = 1 / (1 + tx**2 + ty**2) ** 2
        seen = np.clip(1 - DEPTH * np.abs(tx) / SIDE, 0, 1) * (1 - DEPTH * np.abs(ty) / SIDE)
        found.append(np.sum(light * seen) / np.sum(light))
    return found


VIGNETTING = Case(
    "pixel vignetting where the light just vanishes",
    "a sliver of the pupil, down to 1e-14 of the light, ends inside the quadrature",
    "integral by chords",
    lambda: in_digits(_sliver, CHIEF),
    lambda: vignetting.collected_fraction(CHIEF, 0 * CHIEF, CONE, TUNNEL, SIDE, SIDE),
    _by_rays,
    "64 x 64 rays through the pupil",
    1e-9,
    "the sliver's edge is known to 1e-16 of the tangent: 1e-10 of a sliver 1e-6 wide",
)

SHIFTS = (np.array([4e-6, 4.1e-6, 8e-6, 1.0]), np.array([5e-6, 6e-6, 9e-6, 1.0]))

OVERLAP = Case(
    "overlap of tunnel and photodetector, shifted off",
    "shifted off along both axes: two negative lengths make a positive area",
    "exactly 0",
    lambda: np.zeros(4),
    lambda: vignetting.overlap(*SHIFTS, SIDE, SIDE),
    lambda: (SIDE - np.abs(SHIFTS[0])) * (SIDE - np.abs(SHIFTS[1])) / SIDE**2,
    "(w - |dx|)(h - |dy|) / (w h)",
    0.0,
    "a property",
    absolute=True,
)

GRAZING, INTO = pairs(10.0 ** -np.arange(1, 13), [1.5, 1.5 + 2.0**-40, 2.0])

SNELL = Case(
    "refraction at grazing incidence, like indices",
    "1 - sin^2 of light that comes along the surface",
    "50 digits",
    lambda: in_digits(
        lambda c, n: mp.sqrt(1 - (mp.mpf(1.5) / n) ** 2 * (1 - c * c)), GRAZING, INTO
    ),
    lambda: vignetting.refracted_cosine(GRAZING, 1.5, INTO),
    lambda: np.sqrt(1 - (1.5 / INTO) ** 2 * (1 - GRAZING**2)),
    "cos2 = sqrt(1 - (n1/n2)^2 (1 - cos1^2))",
    1e-15,
    FEW,
)

# --- aberrations ---------------------------------------------------------------------------------

ORDER, SPHERICAL = 50, 1276  # Noll's index of n = 50, m = 0
RADII = np.linspace(0.05, 1.0, 20)


def _powers(rho, factorial, root):
    """Z_n^0 as textbooks have it: a sum of powers with factorials."""
    total = 0 * rho
    for k in range(ORDER // 2 + 1):
        above = (-1) ** k * factorial(ORDER - k)
        below = factorial(k) * factorial(ORDER // 2 - k) ** 2
        total = total + above / below * rho ** (ORDER - 2 * k)
    return root(ORDER + 1) * total


ZERNIKE = Case(
    "Zernike polynomial of order 50",
    "powers with coefficients up to 1e18 of both signs, for values below 7",
    "sum of powers",
    lambda: in_digits(lambda r: _powers(r, mp.factorial, mp.sqrt), RADII),
    lambda: zernike.polynomial(SPHERICAL, RADII, 0.0),
    lambda: _powers(RADII, math.factorial, math.sqrt),
    "the sum of powers with factorials",
    1e-12,
    "a recurrence of 25 steps on values below 7, and there are zeros",
    absolute=True,
)

WAVES = 20.0
DEFOCUS = ((zernike.DEFOCUS, WAVES / math.sqrt(12)),)  # 20 waves from the center to the edge
LAGS = np.array([1 / 128, 1 / 8, 0.5, 0.9375, 1 - 1 / 128])


def _defocused(lag: mp.mpf) -> mp.mpf:
    """Mean of cos(2 pi dW) over the overlap of two disks 2 lag apart; dW is linear in x."""
    turn = 2 * mp.pi * mp.mpf(DEFOCUS[0][1]) * mp.sqrt(3) * 8 * lag
    cuts = mp.linspace(0, 1 - lag, int(turn * (1 - lag) / mp.pi) + 2)
    mean = mp.quad(lambda x: mp.sqrt(1 - (x + lag) ** 2) * mp.cos(turn * x), cuts)
    return 2 * mean / (mp.acos(lag) - lag * mp.sqrt(1 - lag * lag))


def _by_pupil_grid() -> np.ndarray:
    """A pupil of 128 x 128 samples, correlated with itself by transforms of 256 x 256."""
    at = (np.arange(128) + 0.5) / 64 - 1
    rho2 = at**2 + at[:, None] ** 2
    pupil = (rho2 < 1).astype(complex)
    perfect = np.fft.ifft2(np.abs(np.fft.fft2(pupil, (256, 256))) ** 2)[0].real
    pupil = pupil * np.exp(2j * np.pi * WAVES * rho2)
    aberrated = np.fft.ifft2(np.abs(np.fft.fft2(pupil, (256, 256))) ** 2)[0].real
    lag = np.round(LAGS * 128).astype(int)
    return aberrated[lag] / perfect[lag]


DEFOCUSED = Case(
    "OTF under 20 waves of defocus",
    "the wavefront turns by more than half a wave between the samples of a fine pupil",
    "integral by half turns",
    lambda: in_digits(_defocused, LAGS),
    lambda: aberration.otf_ratio_symmetric(LAGS, 1.0, 1.0, DEFOCUS),
    _by_pupil_grid,
    "Fourier transforms of a 128 x 128 pupil",
    1e-9,
    "what the function promises",
    absolute=True,
)

# --- spectra -------------------------------------------------------------------------------------

LINE = (589.25e-9, 589.3e-9, 589.35e-9)  # a sodium lamp's, 0.05 nm wide at half its height
FILTER = (400e-9, 700e-9)


def _line_through_filter() -> list[mp.mpf]:
    (a, m, b), (low, high) = (tuple(map(mp.mpf, ends)) for ends in (LINE, FILTER))
    rising = mp.quad(lambda wl: (wl - a) / (m - a) * (wl - low) / (high - low), [a, m])
    falling = mp.quad(lambda wl: (b - wl) / (b - m) * (wl - low) / (high - low), [m, b])
    return [rising + falling]


def _line_ours() -> float:
    lamp = Spectrum.from_samples(np.array(LINE), np.array([0.0, 1.0, 0.0]), "zero")
    filtered = lamp.multiply(Spectrum.from_samples(np.array(FILTER), np.array([0.0, 1.0]), "hold"))
    return integral(filtered, 400e-9, 700e-9)


def _line_on_grid() -> float:
    at = np.arange(400, 701) * 1e-9
    lamp, glass = np.interp(at, LINE, [0, 1, 0]), np.interp(at, FILTER, [0, 1])
    return float(np.trapezoid(lamp * glass, at))


NARROW_LINE = Case(
    "light of a line 0.05 nm wide, through a filter",
    "falls between the wavelengths of any fixed grid",
    "integral",
    _line_through_filter,
    _line_ours,
    _line_on_grid,
    "trapezoid rule, 1 nm steps",
    1e-12,
    "widths of 0.05 nm are differences of wavelengths: 1e-16 x 589 / 0.05",
)

CASES = (
    MAGNIFICATION, APERTURE, FALLOFF, FALLOFF_ON_AXIS, OTF_NEAR, OTF_BEYOND, SINC, VIGNETTING,
    OVERLAP, SNELL, ZERNIKE, DEFOCUSED, NARROW_LINE,
)  # fmt: skip
