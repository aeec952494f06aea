"""Blurs that have a direction or change over the field, against sums in space."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from making import camera, long_except
from optical_paths import GRAY, Gaussian, Leaning
from scipy.special import erf

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.blurs import FieldTransfer, PlaneTransfer, RadialTransfer, Zone
from vcam_cli.image_formation import strategies
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates.power_spectrum import power_spectrum
from vcam_cli.image_formation.field_dependence import field_mixtures, tabulate_field
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.photon_rate import photo_rate
from vcam_cli.image_formation.scene_spectrum import SampledSpectrum, transform_planes
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import Tables, TableSize, mixtures, tabulate
from vcam_cli.records import dataclass
from vcam_cli.scenes.waves import Wave, WaveScene
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True)
class Changing(FieldTransfer):
    """One blur at the left edge, another at the right, straight in between."""

    left: RadialTransfer | PlaneTransfer
    right: RadialTransfer | PlaneTransfer
    half_width: float
    name = "aberration"

    @property
    def reach(self):
        return max(self.left.reach, self.right.reach)

    @classmethod
    def from_camera(cls, camera, geometry):
        return None

    def describe(self):
        return ""

    def rings(self, count):
        def share(x, y):
            return np.clip((x / self.half_width + 1) / 2, 0, 1) * np.ones((len(y), 1))

        return (
            Zone(self.left, lambda x, y: 1 - share(x, y)),
            Zone(self.right, share),
        )


def in_space(plane, pitch, x, y, blur):
    """Squares of light, mirrored at the border, through a Gaussian that lies beside its place."""

    def shares(at, samples, shift, sigma):
        n = np.arange(-2 * samples, 3 * samples)
        edge = n * pitch + shift
        upper = erf((edge + pitch - at[:, None]) / np.sqrt(2) / sigma)
        lower = erf((edge - at[:, None]) / np.sqrt(2) / sigma)
        own = np.where(n // samples % 2 == 0, n % samples, samples - 1 - n % samples)
        out = np.zeros((len(at), samples))
        np.add.at(out.T, own, ((upper - lower) / 2).T)
        return out

    return (
        shares(y, plane.shape[0], blur.down, blur.along_y)
        @ plane
        @ shares(x, plane.shape[1], blur.right, blur.along_x).T
    )


PITCH = 2e-6
BLURS = {
    "wide": Leaning(0.0, 0.0, 3e-6, 1.5e-6),
    "right": Leaning(1.7e-6, 0.0, 2e-6, 2e-6),
    "down": Leaning(0.0, -2.3e-6, 2e-6, 2e-6),
    "slanted": Leaning(2.5e-6, -1.3e-6, 1.6e-6, 2.4e-6),
}
AXES = {
    "folded": (
        Axis(40, PITCH, 40, PITCH, PITCH / 2, True, 6e5),
        Axis(32, PITCH, 32, PITCH, PITCH / 2, True, 6e5),
    ),
    "window": (
        Axis(40, PITCH, 15, 2 * PITCH, 5 * PITCH, True, 6e5),
        Axis(32, PITCH, 10, 2 * PITCH, 6 * PITCH, True, 6e5),
    ),
    "chirp": (
        Axis(40, PITCH, 33, 1.13 * PITCH, 0.7 * PITCH, True, 6e5),
        Axis(32, PITCH, 25, 1.1 * PITCH, 0.9 * PITCH, True, 6e5),
    ),
}


def light(*effects) -> Transfer:
    """Two wavelengths, one component, one color; 1 electron a second at rest."""
    return Transfer(np.array([500e-9, 600e-9]), np.full((1, 1, 2), 0.5), effects)


def tables_of(transfer: Transfer, top: float, entries: int = 1 << 14) -> Tables:
    """Tables with 32 entries a period of the phase over fx and fy."""
    size = TableSize(top, entries, 1e-6, 32)
    return tabulate(transfer, size, mixtures(transfer, size))


def through(x, y, tables, spectrum) -> np.ndarray:
    """The picture behind a filter, whose stretches follow the phase of blurs as far as these."""
    smooth = min(tables.top / strategies.SMOOTH, 1 / (strategies.PERIODS * 12e-6))
    filter = Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms), smooth)
    return filter.apply(spectrum, 1).signal(0, slice(None))


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize(
    ("name", "dtype"),
    long_except(
        [
            *(("wide", np.float32), ("right", np.float32)),
            *(("down", np.float64), ("slanted", np.float64)),
        ],
        itertools.product(BLURS, [np.float64, np.float32]),
        several=True,
    ),
)
def test_a_blur_of_the_plane_is_its_spread_in_space(name, axes, dtype):
    allowed = 2e-4
    blur, (x, y) = BLURS[name], AXES[axes]
    plane = np.random.default_rng(5).random((1, y.samples, x.samples)).astype(dtype)
    expected = in_space(
        plane[0].astype(float), PITCH, x.first + np.arange(x.pixels) * x.pixel_pitch,
        y.first + np.arange(y.pixels) * y.pixel_pitch, blur,
    )  # fmt: skip
    got = through(x, y, tables_of(light(blur), 8.5e5), transform_planes(plane.copy(), 1))
    assert got.dtype == dtype
    assert np.sqrt(np.mean((got - expected) ** 2)) < allowed


def test_a_blur_without_direction_needs_no_sines():
    assert tables_of(light(BLURS["wide"]), 8.5e5, 1024).parities == [0]
    assert tables_of(light(BLURS["slanted"]), 8.5e5, 1024).parities == [0, 1, 2, 3]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_what_a_sampled_spread_ends_stays_away(dtype):
    # Zero from a square of frequencies on: its tables end at the square's corner, the spectrum goes
    # further. Beyond the end there is no light to take away again.
    half = 1e5

    class Ends(Leaning):
        def otf_plane(self, fx, fy, wavelength):
            inside = (np.abs(fx) < half)[None, :] & (np.abs(fy) < half)[:, None]
            return inside.astype(complex)

    blur = Ends(0.0, 0.0, 3e-6, 3e-6)
    top = np.hypot(half, half)
    x = y = Axis(40, 0.5e-6, 5, 4e-6, 2.7e-6, True, top)
    tables = tables_of(light(blur), top)
    coefficients = np.zeros((1, 40, 40), dtype)
    beyond = np.hypot(x.frequencies[:, None], x.frequencies) > top
    assert beyond.any()
    coefficients[0, : y.terms, : x.terms][beyond] = 1
    spectrum = SampledSpectrum(coefficients)
    assert np.all(through(x, y, tables, spectrum) == 0)
    assert power_spectrum(spectrum, x, y, (), 1).filtered_power(tables).max() == 0


def test_power_is_the_mean_square_of_the_picture():
    blur = BLURS["slanted"]
    x, y = AXES["folded"]
    plane = np.random.default_rng(6).standard_normal((1, y.samples, x.samples))
    tables = tables_of(light(blur), 8.5e5)
    spectrum = transform_planes(plane.copy(), 1)
    fine = [
        replace(a, pixels=8 * a.pixels, pixel_pitch=PITCH / 8, first=PITCH / 16) for a in (x, y)
    ]
    dense = through(*fine, tables, spectrum)
    # A transfer function is judged at the centers of blocks, a twentieth of a frequency wide.
    power = power_spectrum(spectrum, x, y, (), 1).filtered_power(tables).sum()
    assert power == pytest.approx(np.mean(dense**2), rel=0.01)


def test_a_round_blur_that_changes_is_the_mean_of_its_zones(tmp_path):
    made = camera(tmp_path, {"array.rows": 24, "array.columns": 30})
    g = geometry(made)
    p = g.pitch_x
    ends = Gaussian(0.8 * p), Gaussian(1.6 * p)
    rings = Changing(*ends, g.sensor_width / 2).rings(2)
    top = 2.5 / p
    size = TableSize(top, 4096, 1e-6, 32)
    mean, modes = tabulate_field(light(), rings, g, size, field_mixtures(light(), rings, size))
    assert len(modes) == 1
    x = Axis(g.columns, p, g.columns, p, p / 2, True, 1.7 / p)
    y = Axis(g.rows, p, g.rows, p, p / 2, True, 1.7 / p)
    plane = np.random.default_rng(8).random((1, g.rows, g.columns))
    spectrum = transform_planes(plane.copy(), 1)

    def run(tables):
        return through(x, y, tables, spectrum)

    at_x = (np.arange(g.columns) + 0.5 - g.columns / 2) * p
    at_y = (np.arange(g.rows) + 0.5 - g.rows / 2) * p
    got = run(mean) + sum(mode.map(at_x, at_y) * run(mode.tables()) for mode in modes)
    expected = sum(
        ring.weight(at_x, at_y) * run(tables_of(light(end), top, 4096))
        for ring, end in zip(rings, ends, strict=True)
    )
    np.testing.assert_allclose(got, expected, atol=2e-5)


def test_a_wave_through_zones(tmp_path):
    made = camera(tmp_path, {"array.rows": 24, "array.columns": 30})
    g = geometry(made)
    p = g.pitch_x
    blurs = Leaning(0.6 * p, -0.4 * p, 0.9 * p, 1.2 * p), Leaning(-0.2 * p, 0, 0.5 * p, 0.7 * p)
    changing = Changing(*blurs, g.sensor_width / 2)
    knobs = replace(STANDARD, float_width=64)
    wave = Wave(fx=0.11 / p, fy=-0.07 / p, phase=0.4, weights=(0.5,))
    rest = Wave(fx=0.0, fy=0.0, phase=0.0, weights=(0.5,))
    scene = WaveScene(spectra=(Spectrum.flat(1.0),), waves=(rest, wave), white=Spectrum.flat(1.0))
    path = OpticalPath(light(), g, knobs, GRAY, (changing,), 2)
    rate = photo_rate(path, scene)
    x = (np.arange(g.columns) + 0.5 - g.columns / 2) * p
    y = ((np.arange(g.rows) + 0.5 - g.rows / 2) * p)[:, None]
    share = (x / g.sensor_width * 2 + 1) / 2
    expected = 0.5
    for blur, weight in zip(blurs, (1 - share, share), strict=True):
        size = np.exp(
            -2 * np.pi**2 * ((blur.along_x * wave.fx) ** 2 + (blur.along_y * wave.fy) ** 2)
        )
        phase = 2 * np.pi * (wave.fx * (x - blur.right) + wave.fy * (y - blur.down)) + 0.4
        expected = expected + weight * 0.5 * size * np.cos(phase)
    np.testing.assert_allclose(rate.values, expected, atol=1e-12)
    assert isinstance(strategies.image_layers(path, scene)[1].changes["aberration"], float)
