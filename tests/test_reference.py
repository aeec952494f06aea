"""The slow camera of tests/reference.py held to closed forms, so that it may judge the engine."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference as ref
import reference_readout as readout
import reference_scenes as scenes

pytestmark = pytest.mark.long

H, C = ref.PLANCK, ref.LIGHT


def camera(scene, wavelength=(550e-9,), **changes) -> ref.Setup:
    """A 12 x 16 camera of spectral lines: f/2.8, pixels of 4 x 5 um, photodetector 3 x 3.5 um."""
    lines = np.array(wavelength)
    rows, columns = changes.pop("size", (12, 16))
    setup = ref.Setup(
        scene=scene, wavelength=lines, weight=np.ones(len(lines)),
        radiance=np.ones((1, len(lines))), response=np.full((1, len(lines)), 0.5),
        color=np.zeros((rows, columns), int), pitch_x=4e-6, pitch_y=5e-6,
        aperture=(0.0, 0.0, 3e-6, 3.5e-6), f_number=2.8, focal_length=3e-3, time=0.01,
        distance=0.5,
    )  # fmt: skip
    return replace(setup, **changes)


FLAT = ref.Waves((0.7,), (0.0,), (0.0,), (0.0,))


def wave(f: float, angle: float = 0.3) -> ref.Waves:
    return ref.Waves((0.5, 0.4), (0.0, f * math.cos(angle)), (0.0, f * math.sin(angle)), (0.0, 0.9))


def lens_disk_illumination(tan_theta: float, tan_phi: float, points: int = 400) -> float:
    """E / L by summing cos cos' / r^2 over a Lambertian disk at unit distance [sr], brute force."""
    node, weight = np.polynomial.legendre.leggauss(points)
    r = tan_theta * (node + 1) / 2
    angle = 2 * np.pi * (np.arange(4 * points) + 0.5) / (4 * points)
    squared = 1 + r[:, None] ** 2 + tan_phi**2 - 2 * r[:, None] * tan_phi * np.cos(angle)
    return float((weight * r * tan_theta / 2) @ (squared**-2).mean(axis=1) * 2 * np.pi)


# --- spectra and optics --------------------------------------------------------------------------


def test_nanometer_rule_is_exact_for_products_of_tables():
    # three points in every nanometer: exact up to degree five, so only rounding is left
    node, weight = ref.nanometer_rule(400e-9, 700e-9)
    rising = np.interp(node, [400e-9, 555e-9, 700e-9], [0, 1, 0])
    assert weight @ rising**4 == pytest.approx(300e-9 / 5, rel=1e-13)
    assert weight.sum() == pytest.approx(300e-9, rel=1e-13)


def test_planck_follows_wien_and_stefan_boltzmann():
    wavelength = np.linspace(100e-9, 200e-6, 400_001)
    cold, hot = (scenes.planck(wavelength, t) for t in (3000.0, 6000.0))
    assert wavelength[hot.argmax()] == pytest.approx(2.897771955e-3 / 6000, abs=0.5e-9)  # the grid
    assert hot.sum() / cold.sum() == pytest.approx(16, rel=1e-3)  # cut off at 200 um


@pytest.mark.parametrize("f_number", [1.2, 2.8, 16])
@pytest.mark.parametrize("degrees", [0, 20, 45])
def test_relative_illumination_is_the_sum_over_the_lens_disk(f_number, degrees):
    # extended precision loses four digits to the cancellation of eq 2.22 at f/16; 1e-12 is left
    setup = camera(FLAT, f_number=f_number, distance=math.inf, off_axis="exact")
    b = math.tan(math.radians(degrees))
    a = 1 / (2 * f_number)
    expected = lens_disk_illumination(a, b) / lens_disk_illumination(a, 0)
    found = ref.relative_illumination(setup, np.array([3e-3 * b]), np.array([0.0]))[0]
    assert found == pytest.approx(expected, rel=1e-11)


def test_small_lenses_follow_cos4():
    # eq 2.22 tends to cos^4 as tan^2 theta -> 0; f/16: tan^2 theta = 1e-3
    setup = camera(FLAT, f_number=16, off_axis="exact", distance=math.inf)
    place = np.array([1.5e-3]), np.array([1e-3])
    exact = ref.relative_illumination(setup, *place)
    cos4 = ref.relative_illumination(replace(setup, off_axis="cos4"), *place)
    assert exact == pytest.approx(cos4, rel=2e-3)


@pytest.mark.parametrize("nu", [0.0, 0.003, 0.1, 0.37, 0.8, 0.99, 1.2])
def test_airy_modulation_is_the_overlap_of_two_pupils(nu):
    # what is left out beyond the reach oscillates as reach^-2.5; at the cut-off as reach^-1.5: 5e-7
    closed = 2 / np.pi * (math.acos(nu) - nu * math.sqrt(1 - nu**2)) if nu < 1 else 0.0
    assert ref.airy_modulation(nu) == pytest.approx(closed, abs=1e-7 if nu < 0.9 else 1e-6)


def test_displacements_keep_all_light_and_follow_encircled_energy():
    setup = camera(FLAT, wavelength=(420e-9, 550e-9, 700e-9))
    places, shares = ref.displacements(setup, 1e-6, 80e-6)
    assert shares.sum(axis=0) == pytest.approx(1, abs=2e-5)  # the radial rule inside the core
    ring = setup.wavelength * 2.8 * ref.one_minus_m(3e-3, 0.5)
    for radius in (2.2e-6, 10e-6, 40e-6):  # within the share of one circle
        within = shares[:-1][np.hypot(*places.T) < radius].sum(axis=0)
        assert within == pytest.approx(ref.encircled(np.pi * radius / ring), abs=1e-2)


# --- uniform scenes and waves --------------------------------------------------------------------


def test_uniform_scene_is_the_closed_form():
    setup = camera(FLAT, wavelength=(450e-9, 550e-9), dark_rate=30.0)
    magnification = -3e-3 / (0.5 - 3e-3)
    irradiance = math.pi * 0.7 / (1 + 4 * (2.8 * (1 - magnification)) ** 2)
    photons = irradiance * (450e-9 + 550e-9) / (H * C)
    expected = 0.01 * (photons * 0.5 * 3e-6 * 3.5e-6 + 30)
    assert ref.mean_electrons(setup) == pytest.approx(expected, rel=1e-12)


def test_wave_has_the_modulation_of_optics_times_aperture():
    # closed forms: OTF of the circular pupil, sinc of the photodetector, value at each center
    f, angle = 70e3, 0.3
    setup = camera(wave(f, angle))
    nu = f * 550e-9 * 2.8 * ref.one_minus_m(3e-3, 0.5)
    otf = 2 / np.pi * (math.acos(nu) - nu * math.sqrt(1 - nu**2))
    fx, fy = f * math.cos(angle), f * math.sin(angle)
    box = np.sinc(fx * 3e-6) * np.sinc(fy * 3.5e-6)
    x, y = ref.centers(16, 4e-6), ref.centers(12, 5e-6)[:, None]
    expected = 0.5 + 0.4 * otf * box * np.cos(2 * np.pi * (fx * x + fy * y) + 0.9)
    level = ref.mean_electrons(camera(ref.Waves((1.0,), (0.0,), (0.0,), (0.0,)))).mean()
    assert ref.mean_electrons(setup) / level == pytest.approx(expected, abs=1e-7)


# --- squares -------------------------------------------------------------------------------------


def test_squares_without_blur_are_the_overlaps_of_rectangles():
    # against every overlap by itself, clipped interval by clipped interval, mirrored by hand
    picture = np.random.default_rng(1).uniform(size=(9, 11))
    setup = camera(ref.Squares(picture[None], 6.1e-6, 6.9e-6), diffraction=False,
                   aperture=(0.4e-6, -0.6e-6, 3e-6, 3.5e-6))  # fmt: skip
    full = np.pad(picture, 9, mode="symmetric")
    found = ref.mean_electrons(setup)
    level = ref.mean_electrons(camera(ref.Waves((1.0,), (0.0,), (0.0,), (0.0,)))).mean()
    for i, j in ((0, 0), (11, 15), (5, 7), (0, 9)):
        x, y = ref.centers(16, 4e-6)[j] + 0.4e-6, ref.centers(12, 5e-6)[i] - 0.6e-6
        total = 0.0
        for p in range(full.shape[0]):
            top = (p - full.shape[0] / 2) * 6.9e-6
            tall = max(0.0, min(top + 6.9e-6, y + 1.75e-6) - max(top, y - 1.75e-6))
            for q in range(full.shape[1]):
                left = (q - full.shape[1] / 2) * 6.1e-6
                wide = max(0.0, min(left + 6.1e-6, x + 1.5e-6) - max(left, x - 1.5e-6))
                total += full[p, q] * tall * wide
        assert found[i, j] == pytest.approx(level * total / (3e-6 * 3.5e-6), rel=1e-9)


def test_a_rectangle_is_the_same_as_its_squares():
    # 3 x 2 squares in a black surround; the same displacements, so only rounding differs
    planes = np.zeros((1, 6, 8))
    planes[0, 1:3, 2:5] = 1
    squares = camera(ref.Squares(planes, 8e-6, 10e-6, outside="black"))
    rectangle = (ref.Rectangle(-16e-6, 8e-6, -20e-6, 0.0),)
    expected = ref.mean_electrons(replace(squares, scene=rectangle))
    found = ref.mean_electrons(squares)
    assert found == pytest.approx(expected, abs=1e-9 * expected.max())
    sharp = replace(squares, diffraction=False)
    expected = ref.mean_electrons(replace(sharp, scene=rectangle))
    assert ref.mean_electrons(sharp) == pytest.approx(expected, abs=1e-9 * expected.max())


def test_squares_are_black_outside_when_asked():
    bright = ref.Squares(np.ones((1, 4, 4)), 4e-6, 5e-6, outside="black")
    found = ref.mean_electrons(camera(bright, diffraction=False))
    assert np.count_nonzero(found > found.max() / 2) == 16
    assert found[0, 0] == pytest.approx(0, abs=1e-9 * found.max())
    assert ref.mean_electrons(camera(bright)).sum() < found.sum()  # blur sends light elsewhere


@pytest.mark.parametrize("f_number", [1.2, 2.8, 8])
@pytest.mark.parametrize("kind", ["squares", "product"])
def test_blur_agrees_with_the_blurred_wave(kind, f_number):
    # painting on squares a 24th of the pixel errs by (pi f s)^2/3 = 1e-4
    scene = wave(30e3, angle=0.0)
    fx = scene.fx[1]
    exact = ref.mean_electrons(camera(scene, f_number=f_number, wavelength=(450e-9, 650e-9)))

    def swing(x):
        return 0.4 * np.cos(2 * np.pi * fx * x + 0.9)

    parts = (scenes.EVERYWHERE, ref.Product(swing, np.ones_like))
    radiance = np.array([[0.5, 0.5], [1.0, 1.0]])
    if kind == "squares":
        radiance = np.ones((1, 2))
        parts = scenes.painted(lambda x, y: 0.5 + swing(x), 16, 12, 4e-6, 5e-6, margin=40)
    setup = camera(parts, f_number=f_number, wavelength=(450e-9, 650e-9), radiance=radiance)
    found = ref.mean_electrons(setup)
    assert np.abs(found - exact).max() < 2e-4 * exact.max()


def test_blur_keeps_the_mean_of_a_mirrored_image():
    # the aperture covers the cell: every displacement only moves light about
    picture = np.random.default_rng(2).uniform(size=(1, 24, 32))
    scene = ref.Squares(picture, 2e-6, 2.5e-6)
    setup = camera(scene, aperture=(0.0, 0.0, 4e-6, 5e-6))
    sharp = ref.mean_electrons(replace(setup, diffraction=False))
    blurred = ref.mean_electrons(setup)
    assert blurred.mean() == pytest.approx(sharp.mean(), rel=2e-5)
    assert blurred.std() < sharp.std()


def test_uniform_squares_fall_off_as_the_uniform_wave_does():
    # sharp: squares are a quarter of the pixel, so the falloff inside them is left out: 1e-5
    flat = ref.Squares(np.full((1, 12, 16), 0.7), 4e-6, 5e-6)
    wide = camera(FLAT, off_axis="exact", focal_length=200e-6, diffraction=False)
    exact = ref.mean_electrons(wide)
    assert exact.min() < 0.98 * exact.max()
    found = ref.mean_electrons(replace(wide, scene=flat))
    assert np.abs(found - exact).max() < 1e-4 * exact.max()


def test_colors_and_components_add():
    # two components, two colors: every pixel's charge is the sum of its own color's four numbers
    planes = np.stack([np.full((6, 8), 0.25), np.full((6, 8), 0.5)])
    setup = camera(
        ref.Squares(planes, 8e-6, 10e-6), wavelength=(450e-9, 600e-9), diffraction=False,
        radiance=np.array([[1.0, 2.0], [3.0, 4.0]]), response=np.array([[0.1, 0.2], [0.3, 0.4]]),
        color=np.indices((12, 16)).sum(axis=0) % 2,
    )  # fmt: skip
    working = 2.8 * ref.one_minus_m(3e-3, 0.5)
    level = 0.01 * math.pi / (1 + 4 * working**2) * 3e-6 * 3.5e-6 / (H * C)
    blue, red = 0.25 * 1 + 0.5 * 3, 0.25 * 2 + 0.5 * 4
    expected = [level * (a * blue * 450e-9 + b * red * 600e-9) for a, b in ((0.1, 0.2), (0.3, 0.4))]
    found = ref.mean_electrons(setup)
    assert found[0, 0] == pytest.approx(expected[0], rel=1e-9)
    assert found[0, 1] == pytest.approx(expected[1], rel=1e-9)


# --- images, noise, codes ------------------------------------------------------------------------


def test_cropping_keeps_whole_samples_that_cover_the_array():
    picture = np.arange(20 * 30, dtype=float).reshape(20, 30, 1)
    squares = scenes.cropped(picture, 64e-6, 60e-6)  # 64/30 < 60/20: the height decides, 3 um
    assert squares.width == squares.height == 3e-6
    # 64 um / 3 um = 21.33 samples of 30: a = 4.33, b = 25.67, kept 4 .. 26
    assert squares.planes.shape == (1, 20, 22)
    assert squares.planes[0, 0, 0] == 4


def test_noise_variances_and_codes():
    setup = camera(FLAT, dark_rate=100.0)
    mean = ref.mean_electrons(setup)
    found = readout.noise_variance(setup, read=5.0, reset_capacitance=10e-15, gain_pixel=0.01)
    assert np.array_equal(found["shot_noise"], mean)
    assert found["read_noise"] == pytest.approx(25.0)
    assert found["reset_noise"] == pytest.approx(1613.5, rel=1e-4)  # 40.2 e at 10 fF, 300 K
    assert found["fpn"] == pytest.approx((0.01 * mean) ** 2)
    codes = readout.digital_number(np.array([0.0, 50.0, 1e9]), 20e-6, 2.0, 1.0, 10, 16)
    assert codes == pytest.approx([16, 18, 1023])  # 50 e = 2 mV: 16 + 2.014
